"""Compiled scalar functions of rigid-body motion."""

from __future__ import annotations

from volery.core.arrays import Array
from volery.vehicle.compiled import inner_kernel


@inner_kernel
def three(vector: Array) -> tuple[float, float, float]:
    """Returns the elements of a (3,) vector."""
    return vector[0], vector[1], vector[2]


@inner_kernel
def four(quaternion: Array) -> tuple[float, float, float, float]:
    """Returns the elements of a (4,) quaternion."""
    return quaternion[0], quaternion[1], quaternion[2], quaternion[3]


@inner_kernel
def matrix_of(
    x: float, y: float, z: float, w: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Returns the rotation matrix, row by row, of the unit quaternion (x, y, z, w)."""
    xx, yy, zz = 2.0 * x * x, 2.0 * y * y, 2.0 * z * z
    xy, xz, yz = 2.0 * x * y, 2.0 * x * z, 2.0 * y * z
    xw, yw, zw = 2.0 * x * w, 2.0 * y * w, 2.0 * z * w
    return (
        1.0 - yy - zz,
        xy - zw,
        xz + yw,
        xy + zw,
        1.0 - xx - zz,
        yz - xw,
        xz - yw,
        yz + xw,
        1.0 - xx - yy,
    )


@inner_kernel
def product(
    px: float, py: float, pz: float, pw: float, qx: float, qy: float, qz: float, qw: float
) -> tuple[float, float, float, float]:
    """Returns the composition: first q, then p.

    `core.rotation_kernels` has it without fused multiply-add.
    """
    return (
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
        pw * qw - px * qx - py * qy - pz * qz,
    )


@inner_kernel
def nudged(
    qx: float, qy: float, qz: float, qw: float, hx: float, hy: float, hz: float
) -> tuple[float, float, float, float]:
    """Returns the attitude turned by about 2 h, body frame, with an error of 2 |h|^3 / 3.

    First order in h, sufficient for attitudes at mid-step: 8e-8 rad at 20 rad/s and 1 kHz.
    """
    x = qw * hx + qx + qy * hz - qz * hy
    y = qw * hy - qx * hz + qy + qz * hx
    z = qw * hz + qx * hy - qy * hx + qz
    w = qw - qx * hx - qy * hy - qz * hz
    n = 1.0 - 0.5 * (hx * hx + hy * hy + hz * hz)
    return x * n, y * n, z * n, w * n


@inner_kernel
def turned(
    qx: float, qy: float, qz: float, qw: float, hx: float, hy: float, hz: float
) -> tuple[float, float, float, float]:
    """Returns the attitude turned by the body-frame vector 2 h: q exp(h), by its series in |h|.

    The series errs by |h|^6/5040 (1e-12 at 100 rad/s and 1 kHz); one Newton step preserves the
    quaternion's unit length.
    """
    s = hx * hx + hy * hy + hz * hz
    c = 1.0 - s * (0.5 - s * (1.0 / 24.0))
    f = 1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0))
    hx *= f
    hy *= f
    hz *= f
    x = qw * hx + qx * c + qy * hz - qz * hy
    y = qw * hy - qx * hz + qy * c + qz * hx
    z = qw * hz + qx * hy - qy * hx + qz * c
    w = qw * c - qx * hx - qy * hy - qz * hz
    n = 1.5 - 0.5 * (x * x + y * y + z * z + w * w)
    return x * n, y * n, z * n, w * n
