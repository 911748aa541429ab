"""Shape of a UAV for other UAVs' sensors: body, arms, motors, legs and rotors as meshes, FLU, m.

It is the one that the page draws (`web/src/scene/uavs/airframeGeometry.ts`), made from the
airframe's data file: positions of rotors and feet, the body's box, colours.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.vehicle.airframe import Airframe, Colour, RotorGeometry
from volery.world.materials import Material
from volery.world.mesh import Mesh, concatenate
from volery.world.rotor_kernels import DISC_SIDES
from volery.world.scene_content import BodyShape

Piece: TypeAlias = tuple[Mesh, Material]

MATERIAL_OF: dict[Colour, Material] = {
    "black": Material.UAV_BODY,
    "grey": Material.UAV_GREY,
    "white": Material.UAV_WHITE,
    "red": Material.UAV_RED,
    "orange": Material.UAV_ORANGE,
    "amber": Material.UAV_AMBER,
    "blue": Material.UAV_BLUE,
    "green": Material.UAV_GREEN,
}
"""Materials of an airframe's colours."""
_SIDES = 14
"""Sides of motors and pads."""

_BOX_CORNERS = np.array(
    [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)], dtype=np.float64
)
_BOX_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    dtype=np.uint32,
)  # fmt: skip


def body_shape(airframe: Airframe) -> BodyShape:
    """Returns the shape of an airframe, with a part for each of its materials.

    A turning rotor is a disc to a LIDAR: a pulse of some nanoseconds hits a blade or passes, but a
    sweep covers the whole circle. A camera sees the blades at their angles (`world.rotor_kernels`).
    """
    pieces: dict[Material, list[Mesh]] = {}
    for mesh, material in _pieces(airframe):
        pieces.setdefault(material, []).append(mesh)
    radius = airframe.rotors.radius_m
    rotors = np.array([_turning(rotor, radius) for rotor in airframe.rotors.places])
    discs = concatenate([_disc(rotor) for rotor in rotors])
    solid = ((concatenate(meshes), material) for material, meshes in pieces.items())
    return BodyShape((*solid, (discs, Material.ROTOR)), rotors)


def _pieces(airframe: Airframe) -> Iterator[Piece]:
    yield from _hub(airframe)
    for rotor in airframe.rotors.places:
        yield from _arm(airframe, rotor)
    for foot in airframe.ground.feet_m:
        yield from _leg(airframe, np.array(foot))


def _hub(airframe: Airframe) -> Iterator[Piece]:
    """Yields two plates, electronics between them, the battery on top, a mark in front."""
    x, y, z = size = np.array(airframe.body.size_m)
    thick = 0.06 * size.min()
    plates, front = MATERIAL_OF[airframe.colours.plates], MATERIAL_OF[airframe.colours.front]
    yield _box([x, 0.8 * y, 1.5 * thick], [0.0, 0.0, 0.22 * z]), plates
    yield _box([0.9 * x, 0.72 * y, 1.5 * thick], [0.0, 0.0, -0.18 * z]), plates
    yield _box([0.55 * x, 0.45 * y, 0.32 * z], [0.0, 0.0, 0.02 * z]), Material.UAV_GREY
    yield _box([0.62 * x, 0.3 * y, 0.22 * z], [-0.04 * x, 0.0, 0.35 * z]), Material.UAV_BLUE
    yield _box([0.08 * x, 0.3 * y, 0.12 * z], [0.5 * x, 0.0, 0.02 * z]), front


def _arm(airframe: Airframe, rotor: RotorGeometry) -> Iterator[Piece]:
    """Yields a bar from the body to below the rotor, the motor, and the cap above it."""
    x, y, z = rotor.position_m
    radius, colours = airframe.rotors.radius_m, airframe.colours
    length = math.hypot(x, y)
    mount_z = z - 0.16 * radius
    start = [0.12 * x, 0.12 * y, min(mount_z, 0.18 * airframe.body.size_m[2])]
    colour = colours.front if x > 0.01 * length else colours.back
    yield _bar(start, [x, y, mount_z], 0.1 * length, 0.06 * length), MATERIAL_OF[colour]
    yield _cylinder(0.13 * radius, 0.22 * radius, [x, y, z - 0.12 * radius]), Material.UAV_GREY
    yield _cylinder(0.05 * radius, 0.1 * radius, [x, y, z + 0.02 * radius]), Material.UAV_WHITE


def _leg(airframe: Airframe, foot: Array) -> Iterator[Piece]:
    """Yields a bar from the body down to a foot, and its pad."""
    radius = max(math.hypot(*rotor.position_m[:2]) for rotor in airframe.rotors.places)
    thick = 0.045 * radius
    legs = MATERIAL_OF[airframe.colours.legs]
    top = [0.7 * foot[0], 0.7 * foot[1], -0.1 * airframe.body.size_m[2]]
    yield _bar(top, foot + np.array([0.0, 0.0, 0.5 * thick]), thick, thick), legs
    pad = foot + np.array([0.0, 0.0, 0.25 * thick])
    yield _cylinder(1.1 * thick, 0.5 * thick, pad), legs


def _box(sides: ArrayLike, centre: ArrayLike) -> Mesh:
    return _mesh(np.asarray(centre) + _BOX_CORNERS * np.asarray(sides), _BOX_TRIANGLES)


def _bar(start: ArrayLike, end: ArrayLike, width: float, height: float) -> Mesh:
    """Returns a straight bar between two points (3,); its width is horizontal."""
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    level = math.hypot(along[0], along[1])
    across = np.array([-along[1], along[0], 0.0]) / level if level > 0.0 else np.array([0, 1.0, 0])
    axes = np.array([along, across, np.cross(along, across)])
    corners = (_BOX_CORNERS * [length, width, height]) @ axes
    return _mesh(0.5 * (a + b) + corners, _BOX_TRIANGLES)


def _cylinder(radius: float, height: float, centre: ArrayLike) -> Mesh:
    """Returns an upright closed cylinder."""
    angle = np.arange(_SIDES) * (2.0 * math.pi / _SIDES)
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(_SIDES)])
    half = np.array([0.0, 0.0, 0.5 * height])
    points = np.vstack([rim - half, rim + half, -half, half]) + np.asarray(centre)
    i = np.arange(_SIDES)
    j, low, high = (i + 1) % _SIDES, 2 * _SIDES, 2 * _SIDES + 1
    triangles = [
        np.column_stack([i, j, _SIDES + j]),
        np.column_stack([i, _SIDES + j, _SIDES + i]),
        np.column_stack([j, i, np.full(_SIDES, low)]),
        np.column_stack([_SIDES + i, _SIDES + j, np.full(_SIDES, high)]),
    ]
    return _mesh(points, np.vstack(triangles).astype(np.uint32))


def _turning(rotor: RotorGeometry, radius: float) -> Array:
    """Returns a row (10,) of `BodyShape.rotors`."""
    axis = np.array(rotor.axis)
    side = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side) * (1.0 if rotor.direction == "ccw" else -1.0)
    return np.concatenate([rotor.position_m, side, other, [radius]])


def _disc(rotor: Array) -> Mesh:
    centre, side, other, radius = rotor[:3], rotor[3:6], rotor[6:9], rotor[9]
    angle = np.arange(DISC_SIDES) * (2.0 * math.pi / DISC_SIDES)
    rim = radius * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other)
    vertices = np.vstack([np.zeros(3), rim]) + centre
    k = np.arange(DISC_SIDES)
    triangles = np.stack([np.zeros_like(k), k + 1, (k + 1) % DISC_SIDES + 1], axis=1)
    return _mesh(vertices, triangles.astype(np.uint32))


def _mesh(vertices: Array, triangles: NDArray[np.uint32]) -> Mesh:
    return Mesh(vertices.astype(np.float32), triangles)
