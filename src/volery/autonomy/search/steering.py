"""Computes velocity commands that bring a UAV to a position and stop it there."""

from __future__ import annotations

import math

from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.core.vectors import norm
from volery.graph.messages import Twist, Vector3

_GAIN_PER_S = 0.8
_BRAKE_M_S2 = 1.0
_CLIMB_GAIN_PER_S, _CLIMB_M_S = 1.2, 1.0
"""All modelling choices: gentle enough for every shipped airframe."""


def towards(pose: OdometrySample, position: Array, speed_m_s: float) -> Twist:
    """Returns the command that flies to `position` (3,) m, at constant heading, and can brake."""
    offset = position - pose.position
    away = math.hypot(offset[0], offset[1])
    speed = min(speed_m_s, _GAIN_PER_S * away, math.sqrt(2.0 * _BRAKE_M_S2 * away))
    ahead = offset[:2] / max(away, 1e-9) * speed
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    climb = max(-_CLIMB_M_S, min(_CLIMB_M_S, _CLIMB_GAIN_PER_S * float(offset[2])))
    linear = Vector3(
        float(c * ahead[0] + s * ahead[1]), float(c * ahead[1] - s * ahead[0]), float(climb)
    )
    return Twist(linear, Vector3(0.0, 0.0, 0.0))


def is_at(pose: OdometrySample, position: Array, within_m: float, still_m_s: float) -> bool:
    """Returns whether a UAV is within `within_m` of a position and slower than `still_m_s`."""
    away = norm(position - pose.position)
    return away <= within_m and norm(pose.velocity) <= still_m_s
