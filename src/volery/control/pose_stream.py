"""The motion that a stream of poses implies: velocity and rates of an externally moved UAV.

A game engine or a motion capture system sends poses without velocities. Sensors of the UAV measure
the motion between two poses: their displacement over the time between them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.vehicle.airframe import Limits

NO_STAMP = -1
"""Stamp of a pose that has none, ns."""
_COARSE_STAMP = -2
"""Stamp of a stream whose poses share stamps: a clock that ticks more slowly than they come."""
NO_DEADLINE = 2**62
"""Step until which a motion that was commanded with its velocity lasts."""
_MAX_GAP_S = 3.0
"""Poses farther apart begin a new stream."""
_CLOCK_TOLERANCE_NS = NS_PER_S
"""Stamps within it of the simulated time are taken as simulated time."""
_SMOOTHING_S = 0.05
"""Time constant against the jitter of poses whose time is that of their arrival."""
_MIN_PERIOD_S = 0.02
"""Shortest period that is assumed of poses whose time is that of their arrival."""
_TELEPORT_FACTOR = 3.0
"""Multiple of the airframe's speed and rate limits beyond which a change of pose is a teleport."""
_MIN_TELEPORT_M_S = 20.0
_MIN_TELEPORT_RAD_S = math.radians(1000.0)
_MISSED_POSES = 3.0
_MIN_TIMEOUT_S = 0.1
"""The UAV stands still when no new pose came for this time and for `_MISSED_POSES` periods."""
_SAME_POSE = 1e-9
"""Change, m and rad, below which a pose repeats the last one."""
STOP_S = 0.1
"""Time in which the measured motion ends after the last pose of a stream."""


def follow_pose(
    control_state: Any,
    position: Array,
    attitude: Array,
    stamp_ns: int,
    *,
    in_stream: bool,
    step: int,
    dt: float,
    limits: Limits,
) -> bool:
    """Sets velocity and rates of a `CONTROL_STATE` from its last pose and the next one.

    position: (3,) m, map; attitude: (4,), map from body. stamp_ns: time of the pose; it counts if
    it is simulated time, else the time of arrival does, and the jitter of arrival is smoothed.
    in_stream: whether the last command was a pose, too. step: of arrival; dt: physics step, s.
    Returns whether the pose is the present one: a pose that is older than the last one is not. A
    change that no airframe can fly is a teleport: the motion of before goes on beyond it. A pose
    that repeats a moving UAV's last one, as engines send it that draw faster than they move, ends
    the motion only if no other one follows.
    """
    last_ns = int(control_state["pose_stamp"]) if in_stream else NO_STAMP
    stamp_ns = _trusted(stamp_ns, last_ns, round(step * dt * NS_PER_S))
    is_timed = min(stamp_ns, last_ns) > 0
    if is_timed and stamp_ns < last_ns:
        return False
    offset = position - control_state["position_target"]
    turn = rotations.logarithm(
        rotations.multiply(rotations.conjugate(control_state["attitude"]), attitude)
    )
    deadline = int(control_state["deadline_step"])
    is_repeated = max(np.linalg.norm(offset), np.linalg.norm(turn)) < _SAME_POSE
    if in_stream and is_repeated and deadline != NO_DEADLINE:
        return True
    if is_timed and stamp_ns == last_ns:
        stamp_ns, is_timed = _COARSE_STAMP, False
    arrival_s = (step - int(control_state["start_step"])) * dt
    gap_s = (stamp_ns - last_ns) / NS_PER_S if is_timed else arrival_s
    period_s = max(gap_s, dt if is_timed else _MIN_PERIOD_S)
    control_state["start_step"] = step
    control_state["pose_stamp"] = stamp_ns
    if not in_stream or gap_s > _MAX_GAP_S:
        control_state["velocity_target"] = control_state["rates"] = 0.0
        control_state["pose_steps"] = 0
        control_state["deadline_step"] = NO_DEADLINE
        return True
    is_measured = not _is_teleport(offset, turn, period_s, limits)
    if is_measured and is_timed:
        control_state["velocity_target"] = offset / gap_s
        control_state["rates"] = turn / gap_s
    elif is_measured:
        # A first-order filter. Poses that arrive together share the time since those before.
        fraction = 1.0 - math.exp(-gap_s / _SMOOTHING_S)
        if gap_s > 0.0:
            a_second = fraction / gap_s
        else:
            period_s = max(period_s, int(control_state["pose_steps"]) * dt)
            a_second = (1.0 - math.exp(-period_s / _SMOOTHING_S)) / period_s
        for name, change in (("velocity_target", offset), ("rates", turn)):
            control_state[name] = (1.0 - fraction) * control_state[name] + a_second * change
    control_state["pose_steps"] = max(1, round(period_s / dt))
    timeout_s = max(_MISSED_POSES * max(period_s, arrival_s), _MIN_TIMEOUT_S)
    end = step + max(1, round(timeout_s / dt))
    is_burst = arrival_s < _MIN_PERIOD_S and deadline != NO_DEADLINE
    control_state["deadline_step"] = max(end, deadline) if is_burst else end
    return True


def _trusted(stamp_ns: int, last_ns: int, now_ns: int) -> int:
    """Returns the stamp of a pose if it is simulated time, else `NO_STAMP` or `_COARSE_STAMP`."""
    if last_ns == _COARSE_STAMP:
        return _COARSE_STAMP
    is_simulated = stamp_ns > 0 and abs(stamp_ns - now_ns) <= _CLOCK_TOLERANCE_NS
    return stamp_ns if is_simulated else NO_STAMP


def _is_teleport(offset: Array, turn: Array, period_s: float, limits: Limits) -> bool:
    fastest = max(limits.speed_m_s, limits.climb_m_s, limits.descent_m_s)
    speed = max(_TELEPORT_FACTOR * fastest, _MIN_TELEPORT_M_S)
    rate = max(_TELEPORT_FACTOR * math.radians(limits.rate_deg_s), _MIN_TELEPORT_RAD_S)
    moved, turned = float(np.linalg.norm(offset)), float(np.linalg.norm(turn))
    return moved > speed * period_s or turned > rate * period_s
