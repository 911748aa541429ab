"""Rotations of single vectors inside compiled kernels; `core.rotations` is the same for arrays."""

from __future__ import annotations

from volery.core.compiled import inner_kernel

Vector = tuple[float, float, float]


@inner_kernel
def rotate_vector(
    qx: float, qy: float, qz: float, qw: float, vx: float, vy: float, vz: float
) -> Vector:
    """The vector turned by the unit quaternion."""
    tx = 2.0 * (qy * vz - qz * vy)
    ty = 2.0 * (qz * vx - qx * vz)
    tz = 2.0 * (qx * vy - qy * vx)
    return (
        vx + qw * tx + qy * tz - qz * ty,
        vy + qw * ty + qz * tx - qx * tz,
        vz + qw * tz + qx * ty - qy * tx,
    )


@inner_kernel
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Vector:
    """Cross product a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
