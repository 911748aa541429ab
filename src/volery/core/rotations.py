"""Computes with unit quaternions (x, y, z, w), Hamilton, active: body to map for `q_map_body`.

Functions take arrays whose last axis is the quaternion or vector and broadcast over the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
IDENTITY.flags.writeable = False


def _components(array: ArrayLike) -> Sequence[Any]:
    """Returns components along the last axis; plain numbers for one vector, which are faster."""
    array = np.asarray(array, dtype=np.float64)
    if array.ndim == 1:
        numbers: list[float] = array.tolist()
        return numbers
    return [array[..., k] for k in range(array.shape[-1])]


def _by_rows(
    compute: Callable[[Array, Array, Array], None], a: Array, b: Array, width: int
) -> Array:
    """Returns what a kernel computes of rows of `a` (..., 4) and `b` (..., width): (..., width).

    Raises `ValueError` for other shapes: kernels do not check them.
    """
    if a.shape[-1:] != (4,) or b.shape[-1:] != (width,):
        raise ValueError(f"shapes (..., 4) and (..., {width}) are needed, not {a.shape}, {b.shape}")
    shape = a.shape[:-1] or b.shape[:-1]
    if b.ndim > 1 and b.shape[:-1] != shape:
        shape = np.broadcast_shapes(shape, b.shape[:-1])
        a, b = (_spread(a, shape), _spread(b, shape))
    out = np.empty((*shape, width))
    compute(_rows(a), _rows(b), out.reshape(-1, width))
    return out


def _spread(array: Array, shape: tuple[int, ...]) -> Array:
    """Broadcasts the leading axes of an array to `shape`, unless one row serves all."""
    if array.ndim == 1 or array.shape[:-1] == shape:
        return array
    return np.broadcast_to(array, (*shape, array.shape[-1]))


def _rows(array: Array) -> Array:
    """Returns an array as rows in one layout, for which the kernels are compiled once."""
    rows = array.reshape(-1, array.shape[-1])
    flags = rows.flags
    return rows if flags.c_contiguous and flags.writeable else rows.copy()


def multiply(p: ArrayLike, q: ArrayLike) -> Array:
    """Returns p q (..., 4): `rotate(multiply(p, q), v) == rotate(p, rotate(q, v))`."""
    p, q = np.asarray(p, np.float64), np.asarray(q, np.float64)
    if p.ndim > 1 or q.ndim > 1:
        from volery.core.rotation_kernels import multiply_rows  # numba, which starts slowly

        return _by_rows(multiply_rows, p, q, 4)
    px, py, pz, pw = p.tolist()
    qx, qy, qz, qw = q.tolist()
    return np.array(
        [
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
            pw * qw - px * qx - py * qy - pz * qz,
        ]
    )


def conjugate(q: ArrayLike) -> Array:
    """Returns the inverse rotation, shape (..., 4)."""
    return np.asarray(np.asarray(q, dtype=np.float64) * np.array([-1.0, -1.0, -1.0, 1.0]))


def normalize(q: ArrayLike) -> Array:
    """Returns the unit quaternion of the same direction, shape (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def rotate(q: ArrayLike, v: ArrayLike) -> Array:
    """Rotates vectors `v` (..., 3) by `q` (..., 4)."""
    q, v = np.asarray(q, np.float64), np.asarray(v, np.float64)
    if q.ndim > 1 or v.ndim > 1:
        from volery.core.rotation_kernels import rotate_rows  # numba, which starts slowly

        return _by_rows(rotate_rows, q, v, 3)
    x, y, z, w = q.tolist()
    vx, vy, vz = v.tolist()
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return np.array(
        [
            vx + w * tx + y * tz - z * ty,
            vy + w * ty + z * tx - x * tz,
            vz + w * tz + x * ty - y * tx,
        ]
    )


def matrix(q: ArrayLike) -> Array:
    """Returns the rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    q = np.asarray(q, np.float64)
    if q.ndim > 1:
        from volery.core.rotation_kernels import matrices  # numba, which starts slowly

        out = np.empty((*q.shape[:-1], 3, 3))
        matrices(_rows(q), out.reshape(-1, 3, 3))
        return out
    x, y, z, w = q.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def from_rpy(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Array:
    """Returns quaternions (..., 4) of fixed-axis roll, pitch, yaw (REP-103), rad."""
    roll, pitch, yaw = np.broadcast_arrays(
        *(np.asarray(a, dtype=np.float64) / 2.0 for a in (roll, pitch, yaw))
    )
    cr, sr = np.cos(roll), np.sin(roll)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def from_yaw(yaw: ArrayLike) -> Array:
    """Returns quaternions (..., 4) of rotations about z, rad."""
    half = np.asarray(yaw, dtype=np.float64) / 2.0
    q = np.zeros((*half.shape, 4))
    q[..., 2], q[..., 3] = np.sin(half), np.cos(half)
    return q


def to_rpy(q: ArrayLike) -> Array:
    """Returns roll, pitch, yaw (..., 3), rad; pitch in [-pi/2, pi/2]."""
    x, y, z, w = _components(q)
    return np.stack(
        [
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ],
        axis=-1,
    )


def yaw_of(q: ArrayLike) -> Array:
    """Returns the heading about the map's z axis, rad, shape (...)."""
    x, y, z, w = _components(q)
    return np.asarray(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def heading_of(q: Iterable[float]) -> float | None:
    """Returns the heading, rad, of a quaternion (4,) of any length, as `tf2::getYaw` does.

    None for a quaternion of length 0, which messages without an orientation have.
    """
    x, y, z, w = map(float, q)
    if not (x or y or z or w):
        return None
    largest = max(abs(x), abs(y), abs(z), abs(w))
    x, y, z, w = x / largest, y / largest, z / largest, w / largest
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def exponential(rotation_vector: ArrayLike) -> Array:
    """Returns the quaternion (..., 4) of a rotation vector (..., 3), rad."""
    v = np.asarray(rotation_vector, dtype=np.float64)
    if v.ndim == 1:
        x, y, z = v.tolist()
        half = 0.5 * math.sqrt(x * x + y * y + z * z)
        factor = 0.5 * float(np.sinc(half / np.pi))
        return np.array([x * factor, y * factor, z * factor, float(np.cos(half))])
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    half = angle / 2.0
    # sin(a/2)/a without a division by zero: numpy's sinc is sin(pi x)/(pi x)
    return np.concatenate([v * (0.5 * np.sinc(half / np.pi)), np.cos(half)], axis=-1)


def logarithm(q: ArrayLike) -> Array:
    """Returns the rotation vector (..., 3), rad, of a unit quaternion; angle in [0, pi]."""
    q = np.asarray(q, dtype=np.float64)
    q = np.where(q[..., 3:] < 0.0, -q, q)
    length = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(length, q[..., 3:])
    factor = np.where(length > 1e-12, angle / np.where(length > 1e-12, length, 1.0), 2.0)
    return np.asarray(q[..., :3] * factor)
