"""Grows branches, many at once, and turns them into tubes.

A `Branches` batch holds B shoots of P points each. All randomness comes from a generator argument,
so the same seed grows the same tree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array
from volery.world.mesh import Mesh

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Branches:
    """Shoots of one order: centre lines (B, P, 3) and radii (B, P), m."""

    points: Array
    radii: Array

    @property
    def lengths(self) -> Array:
        """Length of each shoot (B,), m."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=1), axis=2).sum(axis=1))

    def at(self, fraction: Array) -> tuple[Array, Array, Array]:
        """Returns points, unit tangents (B, N, 3) and radii (B, N) at `fraction` (B, N)."""
        last = self.points.shape[1] - 1
        position = np.clip(fraction, 0.0, 1.0) * last
        k = np.minimum(position.astype(np.int64), last - 1)
        part = (position - k)[..., None]
        row = np.arange(len(self.points))[:, None]
        start, end = self.points[row, k], self.points[row, k + 1]
        radius = self.radii[row, k] * (1.0 - part[..., 0]) + self.radii[row, k + 1] * part[..., 0]
        return start + part * (end - start), unit(end - start), radius

    def decimated(self, segments: int) -> Branches:
        """Returns the shoots with at most `segments` segments, including their ends."""
        last = self.points.shape[1] - 1
        keep = np.unique(np.linspace(0, last, min(segments, last) + 1).round().astype(np.int64))
        return Branches(self.points[:, keep], self.radii[:, keep])

    def scaled_z(self, factor: float) -> Branches:
        """Returns the shoots stretched along z."""
        return Branches(self.points * np.array([1.0, 1.0, factor]), self.radii)


def unit(v: ArrayLike) -> Array:
    """Returns vectors (..., 3) with unit length (zero remains zero)."""
    v = np.asarray(v, dtype=np.float64)
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))


def across(direction: Array) -> tuple[Array, Array]:
    """Returns two unit vectors normal to `direction` (..., 3) and each other, the first level."""
    level = np.cross(UP, direction)
    steep = np.linalg.norm(level, axis=-1, keepdims=True) < 1e-6
    first = unit(np.where(steep, np.array([1.0, 0.0, 0.0]), level))
    return first, np.cross(direction, first)


def turned(direction: Array, angle: Array, roll: Array) -> Array:
    """Returns `direction` (..., 3) tilted by `angle` towards the azimuth `roll`, rad (...)."""
    level, other = across(direction)
    side = np.cos(roll)[..., None] * level + np.sin(roll)[..., None] * other
    return np.asarray(np.cos(angle)[..., None] * direction + np.sin(angle)[..., None] * side)


def grow(
    rng: np.random.Generator,
    base: Array,
    direction: Array,
    length: Array,
    radius: Array,
    *,
    segments: int,
    lift: float | Array = 0.0,
    wobble: float = 0.1,
    tip: float = 0.3,
) -> Branches:
    """Grows shoots from `base` (B, 3) along `direction` (B, 3), `length` and foot `radius` (B,), m.

    lift: approximate upward bend of a shoot (negative: downward) over its length, rad. wobble:
    random bend at each joint, rad. tip: radius at the end as a fraction of the foot's.
    """
    count = len(base)
    points = np.empty((count, segments + 1, 3))
    points[:, 0] = base
    heading = unit(direction)
    step = (np.asarray(length) / segments)[:, None]
    bend = np.broadcast_to(np.asarray(lift, dtype=np.float64), (count,))[:, None] / segments
    noise = rng.normal(0.0, wobble, (segments, count, 3))
    for k in range(segments):
        heading = unit(heading + bend * UP + noise[k])
        points[:, k + 1] = points[:, k] + step * heading
    fraction = np.linspace(1.0, tip, segments + 1)
    return Branches(points, np.asarray(radius)[:, None] * fraction)


def concatenated(batches: list[Branches]) -> Branches:
    """Returns one batch of several with the same number of points."""
    return Branches(
        np.concatenate([b.points for b in batches]), np.concatenate([b.radii for b in batches])
    )


def tubes(branches: Branches, sides: int, *, capped: bool = False) -> Mesh:
    """Returns tubes around the shoots with `sides` facets; `capped` closes the far ends.

    The facets' cross-section has the area of the circle that they approximate.
    """
    points, radii = branches.points, branches.radii
    count, rings, _ = points.shape
    tangent = np.empty_like(points)
    tangent[:, 1:-1] = points[:, 2:] - points[:, :-2]
    tangent[:, 0] = points[:, 1] - points[:, 0]
    tangent[:, -1] = points[:, -1] - points[:, -2]
    # one reference for a whole shoot keeps the rings from twisting
    first, second = across(unit(points[:, -1] - points[:, 0]))
    tangent = unit(tangent)
    first = unit(first[:, None] - tangent * (tangent * first[:, None]).sum(-1, keepdims=True))
    second = np.cross(tangent, first)
    turn = 2.0 * np.pi * np.arange(sides) / sides
    swell = np.sqrt(2.0 * np.pi / sides / np.sin(2.0 * np.pi / sides))
    ring = np.cos(turn)[:, None] * first[:, :, None] + np.sin(turn)[:, None] * second[:, :, None]
    vertices = points[:, :, None] + swell * radii[:, :, None, None] * ring
    k = np.arange(sides)
    a = (np.arange(rings - 1)[:, None] * sides + k).ravel()
    b = (np.arange(rings - 1)[:, None] * sides + (k + 1) % sides).ravel()
    one = np.concatenate([np.stack([a, b, b + sides], -1), np.stack([a, b + sides, a + sides], -1)])
    if capped:
        end = (rings - 1) * sides
        one = np.concatenate([one, [[end, end + j, end + j + 1] for j in range(1, sides - 1)]])
    triangles = one[None] + (np.arange(count) * rings * sides)[:, None, None]
    return Mesh(vertices.reshape(-1, 3).astype(np.float32), triangles.reshape(-1, 3))
