"""The world of a scenario as a file."""

from __future__ import annotations

from pathlib import Path

from volery.runtime.build.worlds import geometry_of
from volery.scenario.schema import Scenario
from volery.sensors.cameras.light import base_colours
from volery.world.gltf import glb_of
from volery.world.trees.model import DetailLevel


def export_world(
    scenario: Scenario, path: Path, *, detail: DetailLevel = DetailLevel.SENSING
) -> int:
    """Write ground, trees and solids as binary glTF; the number of bytes.

    Raises `VoleryError` where the world cannot be built, `OSError` where the file cannot be
    written.
    """
    stands = geometry_of(scenario)
    content = glb_of(
        stands.terrain,
        stands.forest,
        stands.solids,
        colours=base_colours(),
        cover=stands.cover,
        detail=detail,
    )
    return path.write_bytes(content)
