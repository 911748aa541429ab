"""Triangle meshes: the common form of surfaces for the ray caster, the page and files.

A mesh is two read-only arrays. Helpers return new meshes; none changes its argument.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles over shared vertices, counter-clockwise when seen from outside.

    vertices: (V, 3) float32, m, in the owner's frame. triangles: (T, 3) uint32, rows of `vertices`.
    Raises `ValueError` if a triangle has a vertex that does not exist.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.uint32]

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float32).reshape(-1, 3)
        triangles = np.ascontiguousarray(self.triangles, dtype=np.uint32).reshape(-1, 3)
        if len(triangles) and int(triangles.max()) >= len(vertices):
            raise ValueError(
                f"a triangle has vertex {int(triangles.max())}; the mesh has {len(vertices)}"
            )
        vertices, triangles = vertices.view(), triangles.view()
        vertices.flags.writeable = False
        triangles.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)

    def __len__(self) -> int:
        """Number of triangles."""
        return len(self.triangles)

    @property
    def corners(self) -> NDArray[np.float32]:
        """Corner points of each triangle, (T, 3 corners, 3), m."""
        return np.asarray(self.vertices[self.triangles])

    @property
    def face_normals(self) -> NDArray[np.float64]:
        """Unit normals (T, 3); zero for a triangle without area."""
        cross = _crosses(self)
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return np.asarray(np.divide(cross, length, out=np.zeros_like(cross), where=length > 0))

    @property
    def vertex_normals(self) -> NDArray[np.float64]:
        """Unit normals (V, 3): of the triangles around each vertex, weighted by their areas.

        Up where no triangle has an area.
        """
        cross = np.repeat(_crosses(self), 3, axis=0)
        rows, count = self.triangles.ravel(), len(self.vertices)
        sums = np.stack([np.bincount(rows, c, count) for c in cross.T], axis=1)
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        up = np.broadcast_to([0.0, 0.0, 1.0], sums.shape)
        return np.asarray(np.divide(sums, length, out=up.copy(), where=length > 0.0))

    @property
    def areas(self) -> NDArray[np.float64]:
        """Areas of the triangles (T,), one side each, m^2."""
        return np.asarray(0.5 * np.linalg.norm(_crosses(self), axis=1))

    @property
    def area(self) -> float:
        """Sum of the triangles' areas, m^2."""
        return float(self.areas.sum())

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner, (2, 3) m; zeros for an empty mesh."""
        if not len(self.vertices):
            return np.zeros((2, 3))
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)]).astype(np.float64)

    @property
    def is_closed(self) -> bool:
        """Whether every edge belongs to two triangles in opposite directions.

        Vertices at the same position count as one.
        """
        _, same = np.unique(self.vertices, axis=0, return_inverse=True)
        a, b, c = same.reshape(-1)[self.triangles].T
        edges = np.concatenate([np.stack(pair, axis=1) for pair in ((a, b), (b, c), (c, a))])
        edges = edges[edges[:, 0] != edges[:, 1]]
        directed, counts = np.unique(edges, axis=0, return_counts=True)
        back, others = np.unique(edges[:, ::-1], axis=0, return_counts=True)
        return bool(np.array_equal(directed, back) and np.array_equal(counts, others))

    def transformed(self, transform: ArrayLike) -> Mesh:
        """Returns the mesh in another frame; `transform` is (3, 4) or (4, 4): new point = M p + t.

        A mirroring transform reverses the triangles so that outsides remain outside.
        """
        matrix = np.asarray(transform, dtype=np.float64)[:3, :4]
        points = self.vertices @ matrix[:, :3].T + matrix[:, 3]
        mirrored = float(np.linalg.det(matrix[:, :3])) < 0.0
        return Mesh(
            points.astype(np.float32), self.triangles[:, ::-1] if mirrored else self.triangles
        )


EMPTY = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
"""The mesh without triangles."""


def concatenate(meshes: Sequence[Mesh]) -> Mesh:
    """Returns one mesh with all triangles of `meshes`, in order."""
    if not meshes:
        return EMPTY
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.triangles + np.uint32(o) for m, o in zip(meshes, offsets, strict=True)]),
    )


def _crosses(mesh: Mesh) -> NDArray[np.float64]:
    a, b, c = np.moveaxis(mesh.corners.astype(np.float64), 1, 0)
    return np.asarray(np.cross(b - a, c - a))
