"""Triangles of polygons in space, concave ones included.

Faces of OBJ and STL files have any number of corners. A fan covers a convex polygon only: across a
notch it would lie outside. Others are triangulated by clipping ears (D. Eberly, "Triangulation by
Ear Clipping", 2002) in the plane of the polygon's area vector (Newell's method).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import inline_kernel, kernel

MAX_CORNERS = 10_000
"""Maximum corners of a polygon that is not convex; the effort grows with their square."""
_NOISE = 1e-12
"""Turns below this fraction of a polygon's extent squared are straight."""


def triangulated(
    points: Array, corners: NDArray[np.int64], sizes: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns triangles (T, 3), rows of `points`, and the polygon of each, in order.

    points: (V, 3). corners: (sum(sizes),) rows of `points`, polygon after polygon. sizes: (P,), at
    least 3. Triangles turn as their polygon does. A self-intersecting polygon gets triangles
    between its corners, not of any particular area. Raises `ValueError` if a polygon that is not
    convex has more than `MAX_CORNERS` corners.
    """
    counts = sizes - 2
    first_out = np.concatenate([[0], np.cumsum(counts)])
    first = np.cumsum(sizes) - sizes
    out = np.empty((int(first_out[-1]), 3), dtype=np.int64)
    for size in np.unique(sizes).tolist():
        chosen = np.flatnonzero(sizes == size)
        rings = corners[first[chosen, None] + np.arange(size)]
        rows = first_out[chosen, None] + np.arange(size - 2)
        out[rows] = _of_one_size(points, rings)
    return out, np.repeat(np.arange(len(sizes)), counts)


def _of_one_size(points: Array, rings: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns triangles (P, size - 2, 3) of polygons (P, size)."""
    size = rings.shape[1]
    if size == 3:
        return rings[:, None]
    steps = np.arange(1, size - 1)
    fan = np.stack([np.broadcast_to(rings[:, :1], (len(rings), size - 2)), rings[:, steps],
                    rings[:, steps + 1]], axis=2)  # fmt: skip
    flat = _in_their_planes(points, rings)
    turns = _turns(flat)
    hard = np.flatnonzero(~(turns > _tolerance(flat)[:, None]).all(axis=1))
    if not len(hard):
        return fan
    if size > MAX_CORNERS:
        raise ValueError(
            f"a face that is not convex has {size:,} corners; at most {MAX_CORNERS:,} are read"
        )
    local = np.empty((len(hard), size - 2, 3), dtype=np.int64)
    _clip_all(np.ascontiguousarray(flat[hard]), _tolerance(flat[hard]), local)
    fan[hard] = np.take_along_axis(rings[hard], local.reshape(len(hard), -1), axis=1).reshape(
        local.shape
    )
    return fan


def _in_their_planes(points: Array, rings: NDArray[np.int64]) -> Array:
    """Returns the corners (P, size, 2) in each polygon's plane; their areas are positive."""
    own = points[rings] - points[rings[:, :1]]  # from the first corner: keeps precision far away
    area = np.cross(own, np.roll(own, -1, axis=1)).sum(axis=1)
    length = np.linalg.norm(area, axis=1, keepdims=True)
    up = np.divide(area, length, out=np.tile([0.0, 0.0, 1.0], (len(area), 1)), where=length > 0.0)
    base_axis = np.eye(3)[np.argmin(np.abs(up), axis=1)]
    x = np.cross(base_axis, up)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(up, x)
    return np.stack([np.einsum("pki,pi->pk", own, axis) for axis in (x, y)], axis=2)


def _turns(flat: Array) -> Array:
    """Returns twice the area of each corner with its neighbours, (P, size); left is positive."""
    before, after = flat - np.roll(flat, 1, axis=1), np.roll(flat, -1, axis=1) - flat
    return np.asarray(before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0])


def _tolerance(flat: Array) -> Array:
    extent = np.ptp(flat, axis=1).max(axis=1)
    return np.asarray(_NOISE * extent**2)


@inline_kernel
def _area(p: Array, a: int, b: int, c: int) -> float:
    """Returns twice the area of a triangle of corners."""
    value: float = (p[b, 0] - p[a, 0]) * (p[c, 1] - p[a, 1]) - (p[b, 1] - p[a, 1]) * (
        p[c, 0] - p[a, 0]
    )
    return value


@inline_kernel
def _same(p: Array, a: int, b: int) -> bool:
    return bool(p[a, 0] == p[b, 0] and p[a, 1] == p[b, 1])


@kernel
def _clip_all(flat: Array, noise: Array, out: NDArray[np.int64]) -> None:
    """Writes the triangles (P, size - 2, 3) of polygons (P, size, 2), as corners 0 to size - 1."""
    size = flat.shape[1]
    before = np.empty(size, np.int64)
    after = np.empty(size, np.int64)
    for k in range(flat.shape[0]):
        p, small = flat[k], noise[k]
        for i in range(size):
            before[i] = i - 1 if i > 0 else size - 1
            after[i] = i + 1 if i < size - 1 else 0
        at = 0
        for row in range(size - 2):
            left = size - row
            at = _next_ear(p, small, before, after, at, left)
            a, b = before[at], after[at]
            out[k, row, 0], out[k, row, 1], out[k, row, 2] = a, at, b
            after[a], before[b] = b, a
            at = b


@inline_kernel
def _next_ear(
    p: Array,
    small: float,
    before: NDArray[np.int64],
    after: NDArray[np.int64],
    start: int,
    left: int,
) -> int:
    """Returns a corner that can be cut off; without an ear the best of the others."""
    at = start
    straight, outward = -1, -1
    for _ in range(left):
        a, b = before[at], after[at]
        turn = _area(p, a, at, b)
        if turn > small:
            if outward < 0:
                outward = at
            is_free = True
            other = after[b]
            while other != a:
                # only corners that are not convex can lie in an ear; ends of a bridge to a hole
                # are at the same position as a corner of it
                if (
                    _area(p, before[other], other, after[other]) <= small
                    and not (_same(p, other, a) or _same(p, other, at) or _same(p, other, b))
                    and _area(p, a, at, other) >= -small
                    and _area(p, at, b, other) >= -small
                    and _area(p, b, a, other) >= -small
                ):
                    is_free = False
                    break
                other = after[other]
            if is_free:
                return at
        elif straight < 0 and turn >= -small:
            straight = at
        at = after[at]
    if straight >= 0:
        return straight
    return outward if outward >= 0 else start
