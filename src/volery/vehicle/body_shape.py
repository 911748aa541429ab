"""Shape of a UAV for other UAVs' sensors: body, arms and rotors as meshes in the body frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.vehicle.airframe import Airframe, RotorGeometry
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.rotor_kernels import DISC_SIDES
from volery.world.scene_content import BodyShape

_ARM_WIDTH_M = 0.025

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
    """Returns box, arms and rotor discs of an airframe, in FLU about its centre of mass, m.

    A turning rotor is a disc to a LIDAR: a pulse of some nanoseconds hits a blade or passes, but a
    sweep covers the whole circle. A camera sees the blades at their angles (`world.rotor_kernels`).
    """
    solid = [_box(np.zeros(3), np.array(airframe.body.size_m), 0.0)]
    solid += [_arm(place) for place in airframe.rotors.places]
    radius = airframe.rotors.radius_m
    rotors = np.array([_turning(place, radius) for place in airframe.rotors.places])
    discs = [_disc(rotor) for rotor in rotors]
    return BodyShape(
        ((_joined(solid), Material.UAV_BODY), (_joined(discs), Material.ROTOR)), rotors
    )


def _box(center: Array, size: Array, yaw: float) -> tuple[Array, NDArray[np.uint32]]:
    corners = _BOX_CORNERS * size
    c, s = math.cos(yaw), math.sin(yaw)
    turned = corners @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return turned + center, _BOX_TRIANGLES


def _arm(place: RotorGeometry) -> tuple[Array, NDArray[np.uint32]]:
    """Returns a bar from the body's axis to below the rotor, at half the rotor's height."""
    x, y, z = place.position_m
    length = math.hypot(x, y)
    size = np.array([length, _ARM_WIDTH_M, _ARM_WIDTH_M])
    return _box(np.array([x / 2.0, y / 2.0, z / 2.0]), size, math.atan2(y, x))


def _turning(place: RotorGeometry, radius: float) -> Array:
    """Returns a row (10,) of `BodyShape.rotors`."""
    axis = np.array(place.axis)
    side = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side) * (1.0 if place.direction == "ccw" else -1.0)
    return np.concatenate([place.position_m, side, other, [radius]])


def _disc(rotor: Array) -> tuple[Array, NDArray[np.uint32]]:
    centre, side, other, radius = rotor[:3], rotor[3:6], rotor[6:9], rotor[9]
    angle = np.arange(DISC_SIDES) * (2.0 * math.pi / DISC_SIDES)
    rim = radius * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other)
    vertices = np.vstack([np.zeros(3), rim]) + centre
    k = np.arange(DISC_SIDES)
    triangles = np.stack([np.zeros_like(k), k + 1, (k + 1) % DISC_SIDES + 1], axis=1)
    return vertices, triangles.astype(np.uint32)


def _joined(parts: list[tuple[Array, NDArray[np.uint32]]]) -> Mesh:
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    return Mesh(
        np.vstack([vertices for vertices, _ in parts]).astype(np.float32),
        np.vstack(
            [triangles + offset for (_, triangles), offset in zip(parts, offsets, strict=True)]
        ).astype(np.uint32),
    )
