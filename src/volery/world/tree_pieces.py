"""Splits trees into foot and crown, so that rays below the crowns do not enter their boxes.

Embree traverses a tree when a ray hits its bounding box. Most of a whole tree's box is air around
its trunk: the space in which UAVs fly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.world.mesh import EMPTY, Mesh
from volery.world.trees.model import TreeMesh


def foot_and_crown(tree: TreeMesh) -> tuple[TreeMesh, TreeMesh]:
    """Returns the triangles of a tree that end below some height, and all others.

    The height minimises the total surface of the two boxes, and so the probability of a hit by rays
    from anywhere; if one box has less, all is foot.
    """
    corners = np.concatenate([tree.wood.corners, tree.leaves.corners])
    if not len(corners):
        return tree, TreeMesh(EMPTY, EMPTY)
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(high[:, 2], kind="stable")
    low, high = low[order], high[order]
    below = _surface(np.minimum.accumulate(low), np.maximum.accumulate(high))
    above = _surface(np.minimum.accumulate(low[::-1]), np.maximum.accumulate(high[::-1]))[::-1]
    together = below + np.append(above[1:], 0.0)  # with so many triangles and one more below
    is_foot = np.zeros(len(corners), dtype=bool)
    is_foot[order[: int(np.argmin(together)) + 1]] = True
    wood, leaves = np.split(is_foot, [len(tree.wood)])
    return (
        TreeMesh(_part(tree.wood, wood), _part(tree.leaves, leaves)),
        TreeMesh(_part(tree.wood, ~wood), _part(tree.leaves, ~leaves)),
    )


def _surface(low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.float64]:
    """Returns half the surface of boxes (N, 3), (N, 3), m^2."""
    x, y, z = (high - low).astype(np.float64).T
    return np.asarray(x * y + y * z + z * x)


def _part(mesh: Mesh, rows: NDArray[np.bool_]) -> Mesh:
    """Returns some of a mesh's triangles, with the vertices that they use."""
    used, triangles = np.unique(mesh.triangles[rows], return_inverse=True)
    return Mesh(mesh.vertices[used], triangles.reshape(-1, 3).astype(np.uint32))
