"""Which closed meshes hold a point: those whose surface winds around it.

The winding number of a surface about a point is the solid angle it covers there, over 4 pi: 1
inside a closed surface that faces outwards, 0 outside, wherever its triangles are cut. The angle of
a triangle: A. Van Oosterom and J. Strackee, The solid angle of a plane triangle, IEEE Transactions
on Biomedical Engineering 30 (1983) 125-126.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.world.mesh import Mesh


def winding_number(mesh: Mesh, point: NDArray[np.float64]) -> float:
    """How often the surface goes around `point` (3,) m."""
    a, b, c = np.moveaxis(mesh.corners.astype(np.float64) - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = (
        la * lb * lc
        + np.einsum("ij,ij->i", a, b) * lc
        + np.einsum("ij,ij->i", b, c) * la
        + np.einsum("ij,ij->i", c, a) * lb
    )
    return float(np.arctan2(volume, below).sum() / (2.0 * np.pi))


def enclosing(
    meshes: Sequence[Mesh], boxes: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.int64]:
    """First of the meshes that holds each of the points (P, 3), -1 where none does.

    boxes: (meshes, 6) lowest and highest corners.
    """
    found = np.full(len(points), -1, dtype=np.int64)
    for k, point in enumerate(points):
        near = ((boxes[:, :3] <= point) & (point <= boxes[:, 3:])).all(axis=1)
        for number in np.flatnonzero(near).tolist():
            if abs(winding_number(meshes[number], point)) > 0.5:
                found[k] = number
                break
    return found
