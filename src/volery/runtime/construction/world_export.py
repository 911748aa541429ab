"""Exports the world of a scenario to a file."""

from __future__ import annotations

from pathlib import Path

from volery.core.whole_files import write_whole
from volery.runtime.construction.worlds import geometry_of
from volery.scenario.schema import Scenario
from volery.sensors.cameras.light import base_colours
from volery.world.gltf import glb_of
from volery.world.trees.model import DetailLevel


def export_world(
    scenario: Scenario, path: Path, *, detail: DetailLevel = DetailLevel.SENSING
) -> int:
    """Writes ground, trees and solids as binary glTF and returns the number of bytes.

    Raises `VoleryError` if the world cannot be built, `OSError` if the file cannot be written.
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
    return write_whole(path, content)
