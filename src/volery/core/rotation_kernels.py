"""Computes rotations in compiled kernels, for single vectors and the points of a scan.

`core.rotations` provides the same for arrays of any shape.
"""

from __future__ import annotations

import numpy as np

from volery.core.arrays import Array
from volery.core.compiled import brief_kernel, inner_kernel

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@inner_kernel
def rotate_vector(
    qx: float, qy: float, qz: float, qw: float, vx: float, vy: float, vz: float
) -> Vector:
    """Rotates the vector by the unit quaternion."""
    tx = 2.0 * (qy * vz - qz * vy)
    ty = 2.0 * (qz * vx - qx * vz)
    tz = 2.0 * (qx * vy - qy * vx)
    return (
        vx + qw * tx + qy * tz - qz * ty,
        vy + qw * ty + qz * tx - qx * tz,
        vz + qw * tz + qx * ty - qy * tx,
    )


@inner_kernel
def quaternion_product(
    px: float, py: float, pz: float, pw: float, qx: float, qy: float, qz: float, qw: float
) -> Quaternion:
    """Returns the composition: first q, then p."""
    return (
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
        pw * qw - px * qx - py * qy - pz * qz,
    )


@inner_kernel
def matrix_rows(x: float, y: float, z: float, w: float) -> tuple[Vector, Vector, Vector]:
    """Returns the rows of the unit quaternion's rotation matrix."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@inner_kernel
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Vector:
    """Returns the cross product a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@brief_kernel
def rotate_rows(q: Array, v: Array, out: Array) -> None:
    """Rotates rows of `v` by rows of `q` into `out` (K, 3); one row of `q` or `v` serves all."""
    for k in range(len(out)):
        i, j = k if len(q) > 1 else 0, k if len(v) > 1 else 0
        out[k, 0], out[k, 1], out[k, 2] = rotate_vector(
            q[i, 0], q[i, 1], q[i, 2], q[i, 3], v[j, 0], v[j, 1], v[j, 2]
        )


@brief_kernel
def multiply_rows(p: Array, q: Array, out: Array) -> None:
    """Composes rows of `p` and `q` into `out` (K, 4); one row of either serves all."""
    for k in range(len(out)):
        i, j = k if len(p) > 1 else 0, k if len(q) > 1 else 0
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = quaternion_product(
            p[i, 0], p[i, 1], p[i, 2], p[i, 3], q[j, 0], q[j, 1], q[j, 2], q[j, 3]
        )


@brief_kernel
def matrices(q: Array, out: Array) -> None:
    """Writes the rotation matrices of rows of `q` (K, 4) into `out` (K, 3, 3)."""
    for k in range(len(out)):
        rows = matrix_rows(q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        for i in range(3):
            out[k, i, 0], out[k, i, 1], out[k, i, 2] = rows[i]


@brief_kernel
def moved_points(points: Array, attitude: Array, position: Array) -> Array:
    """Rotates points (K, 3) by `attitude` (4,) and shifts them by `position` (3,)."""
    x, y, z, w = attitude[0], attitude[1], attitude[2], attitude[3]
    out = np.empty((len(points), 3))
    for k in range(len(points)):
        px, py, pz = rotate_vector(x, y, z, w, points[k, 0], points[k, 1], points[k, 2])
        out[k, 0], out[k, 1], out[k, 2] = px + position[0], py + position[1], pz + position[2]
    return out
