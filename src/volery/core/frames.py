"""Converts between axis conventions (inside, REP-103: ENU world, FLU body); no other module does.

- NED world / FRD body: MAVLink's.
- glTF: right-handed, y up: ENU (x, y, z) is glTF (x, z, -y), so that north lies at -z.

Quaternions are x y z w.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array


def gltf_from_enu(v: ArrayLike) -> Array:
    """Converts east-north-up vectors (..., 3) to glTF's axes (x, z, -y): y up."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([v[..., 0], v[..., 2], -v[..., 1]], axis=-1)


def enu_from_gltf(v: ArrayLike) -> Array:
    """Converts vectors (..., 3) in glTF's axes to east-north-up (x, -z, y)."""
    v = np.asarray(v, dtype=np.float64)
    return np.stack([v[..., 0], -v[..., 2], v[..., 1]], axis=-1)


def q_gltf_from_enu(q: ArrayLike) -> Array:
    """Converts ENU rotations (..., 4) to glTF's axes, which are right-handed as well."""
    q = np.asarray(q, dtype=np.float64)
    return np.concatenate([gltf_from_enu(q[..., :3]), q[..., 3:]], axis=-1)


def ned_of_enu(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """Converts an east-north-up vector to north-east-down; its own inverse."""
    return v[1], v[0], -v[2]


enu_of_ned = ned_of_enu


def frd_of_flu(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """Converts a forward-left-up vector to forward-right-down; its own inverse."""
    return v[0], -v[1], -v[2]


flu_of_frd = frd_of_flu


def q_ned_frd_of_enu_flu(
    q: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    """Converts an attitude from FLU-in-ENU to FRD-in-NED; its own inverse (up to sign).

    Half a turn about the north-east diagonal times `q` times half a turn about the forward axis.
    """
    x, y, z, w = q
    s = 0.7071067811865476
    return s * (x + y), s * (x - y), s * (w - z), s * (w + z)


q_enu_flu_of_ned_frd = q_ned_frd_of_enu_flu
