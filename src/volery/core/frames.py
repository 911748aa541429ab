"""Converts between axis conventions (inside, REP-103: ENU world, FLU body); no other module does.

- NED world / FRD body: MAVLink's.
- Optical: z forward, x right, y down; a camera's frames ending in `_optical`.
- glTF: right-handed, y up: ENU (x, y, z) is glTF (x, z, -y), so that north lies at -z.
- Unity: left-handed, x right, y up, z forward. ROS (x, y, z) = Unity (z, -x, y), so Unity
  (x, y, z) = ROS (-y, z, x). (The 2025 ROS + Unity3D article prints this equation with its two
  sides exchanged; this is the form of Unity's own ROS-TCP-Connector.)

Vectors are (..., 3), quaternions (..., 4) in x y z w.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core import rotations

Array = NDArray[np.float64]

Q_NED_ENU = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
"""Half a turn about the north-east diagonal; its own inverse."""
Q_FRD_FLU = np.array([1.0, 0.0, 0.0, 0.0])
"""Half a turn about the forward axis; its own inverse."""
Q_BODY_OPTICAL = np.array([-0.5, 0.5, -0.5, 0.5])
"""Rotates optical-frame vectors into a FLU body frame."""

for _constant in (Q_NED_ENU, Q_FRD_FLU, Q_BODY_OPTICAL):
    _constant.flags.writeable = False


def ned_from_enu(v: ArrayLike) -> Array:
    """Converts east-north-up vectors (..., 3) to north-east-down."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([v[..., 1], v[..., 0], -v[..., 2]], axis=-1)


enu_from_ned = ned_from_enu


def frd_from_flu(v: ArrayLike) -> Array:
    """Converts forward-left-up vectors (..., 3) to forward-right-down."""
    return np.asarray(np.asarray(v, dtype=np.float64) * np.array([1.0, -1.0, -1.0]))


flu_from_frd = frd_from_flu


def q_ned_frd_from_enu_flu(q_enu_flu: ArrayLike) -> Array:
    """Converts attitudes (..., 4) from FLU-in-ENU to FRD-in-NED."""
    return rotations.multiply(Q_NED_ENU, rotations.multiply(q_enu_flu, Q_FRD_FLU))


def q_enu_flu_from_ned_frd(q_ned_frd: ArrayLike) -> Array:
    """Converts attitudes (..., 4) from FRD-in-NED to FLU-in-ENU."""
    return rotations.multiply(Q_NED_ENU, rotations.multiply(q_ned_frd, Q_FRD_FLU))


def optical_from_flu(v: ArrayLike) -> Array:
    """Converts forward-left-up vectors to an optical frame (x right, y down, z forward)."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([-v[..., 1], -v[..., 2], v[..., 0]], axis=-1)


def flu_from_optical(v: ArrayLike) -> Array:
    """Converts optical-frame vectors (..., 3) to forward-left-up."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([v[..., 2], -v[..., 0], -v[..., 1]], axis=-1)


def gltf_from_enu(v: ArrayLike) -> Array:
    """Converts east-north-up vectors to glTF's axes (x, z, -y): y up."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([v[..., 0], v[..., 2], -v[..., 1]], axis=-1)


def enu_from_gltf(v: ArrayLike) -> Array:
    """Converts vectors in glTF's axes to east-north-up (x, -z, y)."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([v[..., 0], -v[..., 2], v[..., 1]], axis=-1)


def q_gltf_from_enu(q: ArrayLike) -> Array:
    """Converts ENU rotations to glTF's axes: both right-handed, so the axis maps as a vector."""
    q = np.asarray(q, dtype=np.float64)
    return np.concatenate([gltf_from_enu(q[..., :3]), q[..., 3:]], axis=-1)


def unity_from_ros(v: ArrayLike) -> Array:
    """Converts ROS vectors (x, y, z) to Unity (-y, z, x)."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([-v[..., 1], v[..., 2], v[..., 0]], axis=-1)


def ros_from_unity(v: ArrayLike) -> Array:
    """Converts Unity vectors (x, y, z) to ROS (z, -x, y)."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([v[..., 2], -v[..., 0], v[..., 1]], axis=-1)


def q_unity_from_ros(q: ArrayLike) -> Array:
    """Converts ROS rotations to Unity: the axis maps as a vector, the sense is inverted."""
    q = np.asarray(q, dtype=np.float64)
    return np.concatenate([-unity_from_ros(q[..., :3]), q[..., 3:]], axis=-1)


def q_ros_from_unity(q: ArrayLike) -> Array:
    """Converts Unity rotations to ROS."""
    q = np.asarray(q, dtype=np.float64)
    return np.concatenate([-ros_from_unity(q[..., :3]), q[..., 3:]], axis=-1)


# ---------------------------------------------------------------------- one vehicle, without arrays


def ned_of_enu(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """Computes `ned_from_enu` of one vector; its own inverse."""
    return v[1], v[0], -v[2]


enu_of_ned = ned_of_enu


def frd_of_flu(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """Computes `frd_from_flu` of one vector; its own inverse."""
    return v[0], -v[1], -v[2]


flu_of_frd = frd_of_flu


def q_ned_frd_of_enu_flu(
    q: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    """Computes `q_ned_frd_from_enu_flu` of one quaternion; its own inverse (up to sign)."""
    x, y, z, w = q
    s = 0.7071067811865476
    return s * (x + y), s * (x - y), s * (w - z), s * (w + z)


q_enu_flu_of_ned_frd = q_ned_frd_of_enu_flu
