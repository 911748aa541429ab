"""Provides the contents of the stand-in for `tf_transformations`.

Quaternions are x y z w, matrices 4 x 4, angles rad. Axes are those of the package: `sxyz` turns
about fixed axes, `rzyx` about the turning ones.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from volery.core import rotations
from volery.core.arrays import Array

_DEGENERATE = 1e-12
"""Sine or cosine below which two axes of a turn coincide."""


def euler_from_quaternion(quaternion: ArrayLike, axes: str = "sxyz") -> tuple[float, float, float]:
    """Returns the three angles of x y z w; by default roll, pitch and yaw."""
    return euler_from_matrix(quaternion_matrix(quaternion), axes)


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = "sxyz") -> Array:
    """Returns x y z w of three angles; by default of roll, pitch and yaw."""
    turns = [
        rotations.exponential(angle * np.eye(3)[axis])
        for angle, axis in zip((ai, aj, ak), _sequence(axes), strict=True)
    ]
    first, second, third = turns if axes[0] == "r" else turns[::-1]
    return rotations.multiply(rotations.multiply(first, second), third)


def euler_from_matrix(matrix: ArrayLike, axes: str = "sxyz") -> tuple[float, float, float]:
    """Returns the three angles of a matrix.

    By Shoemake's method (Graphics Gems IV, 1994): turns about moving axes are those about fixed
    ones in the reverse order. Where two axes coincide the first angle is zero.
    """
    a, b, c = _sequence(axes) if axes[0] == "s" else _sequence(axes)[::-1]
    is_repeated = a == c
    c = 3 - a - b  # the axis that is neither of the first two
    sign = 1.0 if (b - a) % 3 == 1 else -1.0
    m = np.asarray(matrix, dtype=np.float64)
    if is_repeated:
        sine = math.hypot(m[a, b], m[a, c])
        middle = math.atan2(sine, m[a, a])
        first, last = math.atan2(m[a, b], sign * m[a, c]), math.atan2(m[b, a], -sign * m[c, a])
    else:
        sine = math.hypot(m[a, a], m[b, a])
        middle = math.atan2(-sign * m[c, a], sine)
        first, last = math.atan2(sign * m[c, b], m[c, c]), math.atan2(sign * m[b, a], m[a, a])
    if sine < _DEGENERATE:
        first, last = 0.0, math.atan2(sign * (m[c, b] if is_repeated else -m[a, b]), m[b, b])
    return (first, middle, last) if axes[0] == "s" else (last, middle, first)


def euler_matrix(ai: float, aj: float, ak: float, axes: str = "sxyz") -> Array:
    """Returns the matrix of three angles."""
    return quaternion_matrix(quaternion_from_euler(ai, aj, ak, axes))


def quaternion_matrix(quaternion: ArrayLike) -> Array:
    """Returns the matrix of x y z w."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotations.matrix(rotations.normalize(quaternion))
    return matrix


def quaternion_from_matrix(matrix: ArrayLike) -> Array:
    """Returns x y z w of a matrix."""
    m = np.asarray(matrix, dtype=np.float64)[:3, :3]
    candidates = [m[0, 0], m[1, 1], m[2, 2], m.trace()]
    k = int(np.argmax(candidates))  # the largest part, by which the others are divided
    if k == 3:
        parts = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1.0 + m.trace()]
        return rotations.normalize(parts)
    i, j = (k + 1) % 3, (k + 2) % 3
    quaternion = np.zeros(4)
    quaternion[k] = 1.0 + 2.0 * m[k, k] - m.trace()
    quaternion[i], quaternion[j] = m[i, k] + m[k, i], m[j, k] + m[k, j]
    quaternion[3] = m[j, i] - m[i, j]
    return rotations.normalize(quaternion)


def quaternion_about_axis(angle: float, axis: ArrayLike) -> Array:
    """Returns x y z w of a turn about an axis."""
    direction = np.asarray(axis, dtype=np.float64)[:3]
    return rotations.exponential(angle * direction / np.linalg.norm(direction))


def quaternion_slerp(quat0: ArrayLike, quat1: ArrayLike, fraction: float) -> Array:
    """Returns the quaternion between two others, along the shorter arc."""
    start = rotations.normalize(quat0)
    turn = rotations.logarithm(rotations.multiply(rotations.conjugate(start), quat1))
    return rotations.multiply(start, rotations.exponential(fraction * turn))


def rotation_matrix(angle: float, direction: ArrayLike) -> Array:
    """Returns the matrix of a turn about an axis through the origin."""
    return quaternion_matrix(quaternion_about_axis(angle, direction))


def translation_matrix(direction: ArrayLike) -> Array:
    """Returns the matrix of a translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = np.asarray(direction)[:3]
    return matrix


def translation_from_matrix(matrix: ArrayLike) -> Array:
    """Returns the translation of a matrix."""
    return np.array(np.asarray(matrix)[:3, 3])


def inverse_matrix(matrix: ArrayLike) -> Array:
    """Returns the inverse."""
    return np.linalg.inv(np.asarray(matrix))


def concatenate_matrices(*matrices: ArrayLike) -> Array:
    """Returns the product."""
    return np.asarray(reduce(np.dot, matrices, np.eye(4)))


def identity_matrix() -> Array:
    """Returns the unit matrix."""
    return np.eye(4)


def _sequence(axes: str) -> list[int]:
    """Returns the axes of the three turns, 0 to 2. Raises `ValueError` for others."""
    kind, turns = axes[:1], axes[1:]
    known = kind in ("s", "r") and len(turns) == 3 and set(turns) <= set("xyz")
    if not known or turns[1] in (turns[0], turns[2]):
        raise ValueError(f"axes are such as 'sxyz' or 'rzyx', not '{axes}'")
    return ["xyz".index(axis) for axis in turns]


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    functions = (
        *(euler_from_quaternion, quaternion_from_euler, euler_from_matrix, euler_matrix),
        *(quaternion_matrix, quaternion_from_matrix, quaternion_about_axis, quaternion_slerp),
        *(rotation_matrix, translation_matrix, translation_from_matrix, inverse_matrix),
        *(concatenate_matrices, identity_matrix),
    )
    return {
        "tf_transformations": {
            **{each.__name__: each for each in functions},
            "quaternion_multiply": rotations.multiply,
            "quaternion_conjugate": rotations.conjugate,
            "quaternion_inverse": rotations.conjugate,
        }
    }
