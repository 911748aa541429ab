"""Closed convex meshes for shapes, outsides counter-clockwise, m."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volery.world.mesh import Mesh

_CORNERS = np.array(
    [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)], dtype=np.float64
)
_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    dtype=np.uint32,
)  # fmt: skip


def box(low: ArrayLike, high: ArrayLike) -> Mesh:
    """Returns a box between two opposite corners (3,)."""
    a, b = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    return Mesh(((a + b) / 2.0 + _CORNERS * (b - a)).astype(np.float32), _FACES)


def ellipsoid(centre: ArrayLike, half_axes: ArrayLike, sides: int = 12, rings: int = 8) -> Mesh:
    """Returns an ellipsoid with half axes (3,) along x, y, z; vertices lie on the exact surface."""
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings + 1)[1:-1]
    around = np.arange(sides) * 2.0 * np.pi / sides
    ring = np.cos(latitude)[:, None], np.sin(latitude)[:, None]
    body = np.stack(
        [ring[0] * np.cos(around), ring[0] * np.sin(around), np.tile(ring[1], sides)], axis=-1
    ).reshape(-1, 3)
    points = np.vstack([[0.0, 0.0, -1.0], body, [0.0, 0.0, 1.0]])
    i = np.arange(sides)
    j, last = (i + 1) % sides, len(points) - 1
    triangles = [np.column_stack([np.zeros(sides, int), 1 + j, 1 + i])]
    for k in range(rings - 2):
        a, b = 1 + k * sides, 1 + (k + 1) * sides
        triangles += [
            np.column_stack([a + i, a + j, b + j]),
            np.column_stack([a + i, b + j, b + i]),
        ]
    top = 1 + (rings - 2) * sides
    triangles.append(np.column_stack([top + i, top + j, np.full(sides, last)]))
    vertices = np.asarray(centre) + points * np.asarray(half_axes)
    return Mesh(vertices.astype(np.float32), np.concatenate(triangles).astype(np.uint32))


def wheel(centre: ArrayLike, radius: float, width: float, sides: int = 16) -> Mesh:
    """Returns a closed cylinder about an axis along y."""
    angle = np.arange(sides) * 2.0 * np.pi / sides
    rim = radius * np.column_stack([np.cos(angle), np.zeros(sides), np.sin(angle)])
    half = np.array([0.0, width / 2.0, 0.0])
    points = np.vstack([rim - half, rim + half, -half, half]) + np.asarray(centre)
    i = np.arange(sides)
    j, right, left = (i + 1) % sides, 2 * sides, 2 * sides + 1
    triangles = [
        np.column_stack([i, i + sides, j + sides]),
        np.column_stack([i, j + sides, j]),
        np.column_stack([np.full(sides, right), i, j]),
        np.column_stack([np.full(sides, left), j + sides, i + sides]),
    ]
    return Mesh(points.astype(np.float32), np.concatenate(triangles).astype(np.uint32))


def plate(corners: ArrayLike, thickness: float) -> Mesh:
    """Returns a thick plate: corners (4, 3) counter-clockwise from above, flat or bent."""
    middle = np.asarray(corners, dtype=np.float64)
    up = np.array([0.0, 0.0, thickness / 2.0])
    points = np.vstack([middle + up, middle - up])
    i = np.arange(4)
    j = (i + 1) % 4
    triangles = [
        np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]),
        np.column_stack([i, i + 4, j + 4]),
        np.column_stack([i, j + 4, j]),
    ]
    return Mesh(points.astype(np.float32), np.concatenate(triangles).astype(np.uint32))
