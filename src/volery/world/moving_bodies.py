"""Tables of a scene's moving bodies: shapes, materials, poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.world.materials import Material
from volery.world.scene_content import BodyShape, rotor_table
from volery.world.scene_memory import BodyTable

_NOWHERE = (0.0, 0.0, -1e6, 0.0, 0.0, 0.0, 1.0)
"""Pose of a body before its first placement: far below the map."""


class BodyRows(NamedTuple):
    """Shapes of N bodies, one row each."""

    scene: NDArray[np.int64]
    radius: NDArray[np.float64]
    material: NDArray[np.uint8]
    rotors: NDArray[np.float64]
    """(N, R, 10) as `BodyShape.rotors`, padded with zeros."""


NO_ROWS = BodyRows(
    np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 1), np.uint8), np.zeros((0, 0, 10))
)


def body_rows(
    shapes: Sequence[BodyShape], shape_index: ArrayLike, scenes: NDArray[np.int64]
) -> BodyRows:
    """Returns rows for the entries of `shape_index` (N,); `scenes` are Embree's, per shape."""
    index = np.asarray(shape_index, dtype=np.int64).reshape(-1)
    parts = max((len(shape.parts) for shape in shapes), default=1)
    materials = np.zeros((len(shapes), parts), dtype=np.uint8)
    for i, shape in enumerate(shapes):
        for k, (_, material) in enumerate(shape.parts):
            materials[i, k] = Material(material)
    radius = np.array([shape.radius for shape in shapes])
    rotors = rotor_table(shapes)
    return BodyRows(scenes[index], radius[index], materials[index], rotors[index])


def body_table(uavs: BodyRows, actors: BodyRows, uavs_per_env: int) -> BodyTable:
    """Returns the table of UAVs, then actors, all of them not yet placed."""
    both = uavs, actors
    widest = max(rows.material.shape[1] for rows in both)
    count = sum(len(rows.scene) for rows in both)
    material = np.zeros((count, widest), dtype=np.uint8)
    first = 0
    for rows in both:
        material[first : first + len(rows.scene), : rows.material.shape[1]] = rows.material
        first += len(rows.scene)
    start = np.tile(_NOWHERE, (count, 1))
    return BodyTable(
        scene=np.concatenate([rows.scene for rows in both]),
        radius=np.concatenate([rows.radius for rows in both]),
        material=material,
        start=start,
        end=start.copy(),
        uavs_per_env=uavs_per_env,
        actors=len(actors.scene),
        rotors=np.zeros((count, 0, 10)),
        turn=np.zeros((count, 0, 2)),
    )


def with_blades(
    table: BodyTable, uavs: BodyRows, start: NDArray[np.float64], end: NDArray[np.float64]
) -> BodyTable:
    """Returns the table for rays that see the blades of the UAVs' rotors instead of discs.

    start, end: (N, R or more) rad, rotor angles at either end of the interval.
    """
    count, max_rotors, _ = uavs.rotors.shape
    rotors = np.zeros((len(table.scene), max_rotors, 10))
    turn = np.zeros((len(table.scene), max_rotors, 2))
    rotors[:count] = uavs.rotors
    turn[:count, :, 0], turn[:count, :, 1] = start[:count, :max_rotors], end[:count, :max_rotors]
    return table._replace(rotors=rotors, turn=turn)
