"""Compiled inertial quantities in sensor and body frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import brief_kernel
from volery.core.rotation_kernels import cross, quaternion_product, rotate_vector

GRAVITY = 9.80665
"""Standard gravity, m/s^2 (ISO 80000-3)."""


@brief_kernel
def feel_motion(
    rows: NDArray[np.int64],
    attitude: Array,
    omega_body: Array,
    acceleration_map: Array,
    angular_acceleration_body: Array,
    lever_body: Array,
    body_from_sensor: Array,
    out: Array,
) -> None:
    """Fills `out` (S, 6) with rates (rad/s) and specific force (m/s^2) in each sensor's frame.

    State arrays are (N, 3) or (N, 4), read at `rows` (S,); `lever_body` (S, 3) m and
    `body_from_sensor` (S, 4) are the poses of the sensors in the body.
    """
    for s in range(len(rows)):
        i = rows[s]
        q, w, d = attitude[i], omega_body[i], lever_body[s]
        fx, fy, fz = rotate_vector(
            -q[0],
            -q[1],
            -q[2],
            q[3],
            acceleration_map[i, 0],
            acceleration_map[i, 1],
            acceleration_map[i, 2] + GRAVITY,
        )
        b = angular_acceleration_body[i]
        ex, ey, ez = cross(b[0], b[1], b[2], d[0], d[1], d[2])
        ux, uy, uz = cross(w[0], w[1], w[2], d[0], d[1], d[2])
        cx, cy, cz = cross(w[0], w[1], w[2], ux, uy, uz)
        m = body_from_sensor[s]
        out[s, 0], out[s, 1], out[s, 2] = rotate_vector(-m[0], -m[1], -m[2], m[3], w[0], w[1], w[2])
        out[s, 3], out[s, 4], out[s, 5] = rotate_vector(
            -m[0], -m[1], -m[2], m[3], fx + ex + cx, fy + ey + cy, fz + ez + cz
        )


@brief_kernel
def body_twists(
    rows: NDArray[np.int64], attitude: Array, velocity_map: Array, omega_body: Array, out: Array
) -> None:
    """Fills `out` (S, 6) with velocity (m/s) and rates (rad/s) in the body frame."""
    for s in range(len(rows)):
        i = rows[s]
        q, v = attitude[i], velocity_map[i]
        out[s, 0], out[s, 1], out[s, 2] = rotate_vector(-q[0], -q[1], -q[2], q[3], v[0], v[1], v[2])
        for k in range(3):
            out[s, 3 + k] = omega_body[i, k]


@brief_kernel
def feel_vector(
    rows: NDArray[np.int64], attitude: Array, body_from_sensor: Array, vector_map: Array, out: Array
) -> None:
    """Fills `out` (S, 3) with the map-frame vector `vector_map` (3,) in each sensor's frame."""
    for s in range(len(rows)):
        p, q = attitude[rows[s]], body_from_sensor[s]
        x, y, z, w = quaternion_product(p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3])
        out[s, 0], out[s, 1], out[s, 2] = rotate_vector(
            -x, -y, -z, w, vector_map[0], vector_map[1], vector_map[2]
        )
