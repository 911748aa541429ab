"""Lens distortion of the Brown-Conrady model as ROS and OpenCV name it: `plumb_bob`.

Normalised image coordinates x = X/Z to the right and y = Y/Z down become, with r^2 = x^2 + y^2,

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y

(Brown 1966; OpenCV's camera calibration). The inverse has no closed form; Newton's method finds it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array

_STEPS = 20
_CLOSE = 1e-12
"""Tolerance in normalised coordinates: far below a millionth of a pixel."""


def distort(points: ArrayLike, coefficients: Sequence[float]) -> Array:
    """Returns the distorted points (..., 2) of ideal `points` (..., 2), both normalised.

    `coefficients` are k1, k2, p1, p2, k3.
    """
    p = np.asarray(points, dtype=np.float64)
    x, y = p[..., 0], p[..., 1]
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )


def undistort(points: ArrayLike, coefficients: Sequence[float]) -> Array:
    """Returns the ideal points (..., 2) that the lens maps to `points` (..., 2), both normalised.

    NaN where none exist: beyond the ring at which a barrel distortion folds the image over.
    """
    wanted = np.asarray(points, dtype=np.float64)
    found = wanted.copy()
    if not any(coefficients):
        return found
    for _ in range(_STEPS):
        error = distort(found, coefficients) - wanted
        found = found - _solved(_jacobian(found, coefficients), error)
    off = np.abs(distort(found, coefficients) - wanted).max(axis=-1)
    folded = _determinant(_jacobian(found, coefficients)) <= 0.0
    found[~(off < 1e3 * _CLOSE) | folded] = np.nan
    return found


def _jacobian(points: Array, coefficients: Sequence[float]) -> tuple[Array, Array, Array, Array]:
    """Returns dx'/dx, dx'/dy, dy'/dx, dy'/dy, (...,) each."""
    x, y = points[..., 0], points[..., 1]
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))  # d radial / d(r^2), doubled
    mixed = slope * x * y + 2.0 * (p1 * x + p2 * y)
    return (
        radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        mixed,
        mixed,
        radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    )


def _determinant(j: tuple[Array, Array, Array, Array]) -> Array:
    return np.asarray(j[0] * j[3] - j[1] * j[2])


def _solved(j: tuple[Array, Array, Array, Array], right: Array) -> Array:
    """Returns the solutions of 2 x 2 systems; zero where the matrix is singular."""
    d = _determinant(j)
    inverse = np.divide(1.0, d, out=np.zeros_like(d), where=np.abs(d) > _CLOSE)
    u, v = right[..., 0], right[..., 1]
    with np.errstate(all="ignore"):
        return np.stack([(j[3] * u - j[1] * v) * inverse, (j[0] * v - j[2] * u) * inverse], axis=-1)
