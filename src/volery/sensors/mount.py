"""Sensor mounts: pose on the UAV and nodding motion."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.compiled import brief_kernel, inner_kernel

_NS = 1e-9
_TWO_PI = 2.0 * math.pi


class Mount(NamedTuple):
    """Pose of a sensor in the body frame (FLU), optionally nodding about the sensor's y axis.

    The nodding angle at time t is offset + amplitude sin(2 pi t / period + phase); a positive angle
    turns the sensor's x axis down. Without nodding `period_s` is 0.
    """

    position_body: NDArray[np.float64]
    """(3,) m."""
    attitude_body: NDArray[np.float64]
    """(4,) unit quaternion x y z w, body from sensor base."""
    amplitude_rad: float
    period_s: float
    offset_rad: float
    phase_rad: float

    @property
    def nods(self) -> bool:
        """Whether the sensor moves relative to the body."""
        return self.period_s > 0.0


def make_mount(
    position_body: ArrayLike = (0.0, 0.0, 0.0),
    attitude_body: ArrayLike = (0.0, 0.0, 0.0, 1.0),
    *,
    amplitude_rad: float = 0.0,
    period_s: float = 0.0,
    offset_rad: float = 0.0,
    phase_rad: float = 0.0,
) -> Mount:
    """Returns a mount with a normalised quaternion.

    `position_body` (3,) m and `attitude_body` (4,) x y z w in FLU. Raises `ValueError` for numbers
    that are not finite, wrong shapes, a zero quaternion or a negative period.
    """
    position = np.ascontiguousarray(position_body, dtype=np.float64)
    attitude = np.ascontiguousarray(attitude_body, dtype=np.float64)
    numbers = np.array([amplitude_rad, period_s, offset_rad, phase_rad], dtype=np.float64)
    if position.shape != (3,) or attitude.shape != (4,):
        raise ValueError("a mount needs a position (3,) and an attitude quaternion (4,)")
    length = float(np.linalg.norm(attitude))
    if not (np.isfinite(position).all() and np.isfinite(numbers).all() and length > 0.0):
        raise ValueError("a mount's numbers must be finite and its quaternion not zero")
    if period_s < 0.0:
        raise ValueError(f"period_s must not be negative, not {period_s}")
    return Mount(
        position,
        attitude / length,
        float(amplitude_rad),
        float(period_s),
        float(offset_rad),
        float(phase_rad),
    )


@inner_kernel
def nodding_angle(
    amplitude_rad: float, period_s: float, offset_rad: float, phase_rad: float, time_ns: int
) -> float:
    """Returns the angle of a `Mount` about the sensor's y axis at a time, rad."""
    if period_s <= 0.0:
        return offset_rad
    # Reducing the phase in integers first preserves precision in long runs.
    period_ns = round(period_s / _NS)
    turn = (time_ns % period_ns) / period_ns
    angle: float = offset_rad + amplitude_rad * np.sin(_TWO_PI * turn + phase_rad)
    return angle


@inner_kernel
def nodded(
    x: float, y: float, z: float, w: float, angle: float
) -> tuple[float, float, float, float]:
    """Returns the quaternion (x, y, z, w) of a mount, body from sensor, at a nodding angle, rad."""
    if angle == 0.0:
        return x, y, z, w
    half = 0.5 * angle
    s, c = np.sin(half), np.cos(half)
    return x * c - z * s, y * c + w * s, z * c + x * s, w * c - y * s


@brief_kernel
def nodding_angle_at(mount: Mount, time_ns: int) -> float:
    """Returns the `nodding_angle` of a mount, rad; for callers in Python."""
    return nodding_angle(
        mount.amplitude_rad, mount.period_s, mount.offset_rad, mount.phase_rad, time_ns
    )
