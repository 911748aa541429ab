"""Solids as seen from above: their tops and the edges of the tops."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from volery.figures.flight_data import Structures
from volery.world.mesh import Mesh

_CORNER_M = 1e-3
"""Tolerance within which corners of triangles coincide, m."""


def seen_from_above(meshes: Iterable[Mesh]) -> Structures | None:
    """Returns the tops of solids; None without any."""
    tops, edges = [], []
    for mesh in meshes:
        top = mesh.corners[mesh.face_normals[:, 2] > 0.1].astype(np.float64)
        if len(top):
            tops.append(top[:, :, :2])
            edges.append(_rim(top))
    return Structures(np.concatenate(tops), np.concatenate(edges)) if tops else None


def _rim(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the edges (E, 2, 2) that belong to only one of the triangles (K, 3, 3)."""
    _, number = np.unique(
        np.round(triangles.reshape(-1, 3) / _CORNER_M).astype(np.int64), axis=0, return_inverse=True
    )
    corner = number.reshape(-1, 3)
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2)
    lines = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    _, first, count = np.unique(
        np.sort(ends, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(lines[first[count == 1], :, :2])
