"""Follow-me: flies next to a target, as PX4's AutoFollowTarget.

FOLLOW_TARGET messages report the target's position. Position and velocity of the target are
filtered like in PX4's `TargetEstimator.cpp` (without its acceleration). The UAV's position relative
to the target depends on the target's course and on the parameters of height and angle.
"""

from __future__ import annotations

import math
from typing import Any

from volery.core.frames import enu_of_ned
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_transitions
from volery.mavlink.autopilot.modes.legs import approach_speed
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.modes.setpoints import OffboardSetpoint
from volery.mavlink.autopilot.state import FollowTarget, Source
from volery.mavlink.autopilot.vehicle import FlightState, Vector

_STALE_NS = 3_000_000_000
"""Time after which a silent target is assumed to stand still."""
_MOVES_M_S = 0.1
"""Speed above which a velocity defines a course."""
_HEIGHT_FIRST_M = 3.0
"""Height difference below which the UAV moves along the ground."""
_MIN_HEIGHT_M, _ASCENT_M_S = 1.0, 0.5
"""Height above home below which the UAV climbs, whatever the target's altitude, and its speed."""
_MAX_DISTANCE_M = 1e6
_PERIOD_NS = 20_000_000
_FACED_M = 1.0
"""Distance along the ground below which the UAV does not face the target."""


def take(context: AutopilotContext, _source: Source, message: Any) -> None:
    """Filters position and velocity of a FOLLOW_TARGET message in follow mode."""
    if context.memory.mode is not Mode.FOLLOW_TARGET:
        return
    latitude, longitude = message.lat * 1e-7, message.lon * 1e-7
    numbers = (latitude, longitude, message.alt)
    if not all(map(math.isfinite, numbers)) or abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return
    x, y, _ = context.earth.map_position(latitude, longitude, 0.0)
    measured = x, y, message.alt - context.build.origin[2]
    if any(abs(part) > _MAX_DISTANCE_M for part in measured):
        return
    vx, vy, vz = message.vel
    velocity = enu_of_ned((vx, vy, vz))
    known = all(math.isfinite(part) and abs(part) < 1e3 for part in velocity)
    memory, before = context.memory, context.memory.followed
    if before is None:
        start = velocity if known else (0.0, 0.0, 0.0)
        memory.followed = FollowTarget(measured, start, memory.now_ns)
    else:
        _fuse(context, before, measured, velocity if known else None)
    target = memory.followed
    if target is not None and math.hypot(*target.velocity[:2]) > _MOVES_M_S:
        target.course = math.atan2(target.velocity[1], target.velocity[0])


def _fuse(
    context: AutopilotContext, target: FollowTarget, measured: Vector, velocity: Vector | None
) -> None:
    """Corrects an estimate by a measurement: PX4's filter with FLW_TGT_RS."""
    responsiveness = min(max(float(context.parameter("FLW_TGT_RS")), 0.1), 1.0)
    beta = responsiveness ** (1.0 / 3.0)
    gain, rate_gain = 1.0 - responsiveness, 1.5 * (1.0 - beta) ** 2 * (1.0 + beta)
    velocity_gain = 1.0 - (0.9 * beta) ** 2
    elapsed_s = min(max((context.memory.now_ns - target.time_ns) * 1e-9, 1e-3), 20.0)
    predicted = _position_now(context, target)
    off = tuple(here - there for here, there in zip(measured, predicted, strict=True))
    x, y, z = (p + gain * o for p, o in zip(predicted, off, strict=True))
    vx, vy, vz = (v + rate_gain / elapsed_s * o for v, o in zip(target.velocity, off, strict=True))
    if velocity is not None:
        vx, vy, vz = (
            v + velocity_gain * (measured_v - v)
            for v, measured_v in zip((vx, vy, vz), velocity, strict=True)
        )
    target.position, target.velocity = (x, y, z), (vx, vy, vz)
    target.time_ns = context.memory.now_ns


def fly(context: AutopilotContext, state: FlightState) -> None:
    """Flies to the position next to the target and along with it; holds until there is a target."""
    memory, target = context.memory, context.memory.followed
    if target is None or state.mode == "LANDED":
        return
    if memory.now_ns - memory.ordered_ns < _PERIOD_NS and memory.order == "steer":
        return
    there = _position_now(context, target)
    moves = memory.now_ns - target.time_ns < _STALE_NS
    vx, vy, _ = target.velocity if moves else (0.0, 0.0, 0.0)
    goal = _position_next_to(context, target, there)
    x, y, z = (wanted - here for wanted, here in zip(goal, state.position, strict=True))
    away = math.hypot(x, y)
    speed = min(
        approach_speed(away, float(context.parameter("MPC_ACC_HOR"))),
        float(context.parameter("FLW_TGT_MAX_VEL")),
    )
    gain = speed / away if away > 1e-6 else 0.0
    level = (vx + gain * x, vy + gain * y) if abs(z) < _HEIGHT_FIRST_M else (0.0, 0.0)
    max_speed = float(context.parameter("MPC_XY_VEL_MAX"))
    reduced = min(1.0, max_speed / max(math.hypot(*level), 1e-6))
    limit = float(context.parameter(f"MPC_Z_V_AUTO_{'UP' if z > 0.0 else 'DN'}"))
    brake = 0.5 * float(context.parameter("MPC_ACC_HOR"))
    climb = math.copysign(min(limit, approach_speed(abs(z), brake)), z)
    if state.position[2] - memory.home_or_origin[2] < _MIN_HEIGHT_M:
        level, climb = (0.0, 0.0), _ASCENT_M_S
    dx, dy = there[0] - state.position[0], there[1] - state.position[1]
    yaw = math.atan2(dy, dx) if math.hypot(dx, dy) > _FACED_M else None
    memory.target = OffboardSetpoint(position=goal, yaw=math.nan if yaw is None else yaw)
    context.vehicle.steer((reduced * level[0], reduced * level[1], climb), yaw, 0.0)
    mode_transitions.order(context, "steer")


def _position_now(context: AutopilotContext, target: FollowTarget) -> Vector:
    """Returns the target's position, extrapolated by its velocity."""
    since_s = min(context.memory.now_ns - target.time_ns, _STALE_NS) * 1e-9
    x, y, z = (p + since_s * v for p, v in zip(target.position, target.velocity, strict=True))
    return x, y, z


def _position_next_to(context: AutopilotContext, target: FollowTarget, there: Vector) -> Vector:
    """Returns the UAV's goal; next to a target without a course, on the UAV's own side."""
    if target.course is None:
        here = context.state.position
        angle = math.atan2(here[1] - there[1], here[0] - there[0])
    else:
        angle = target.course - math.radians(float(context.parameter("FLW_TGT_FA")))
    distance, height = (float(context.parameter(f"FLW_TGT_{name}")) for name in ("DST", "HT"))
    follows_height = context.parameter("FLW_TGT_ALT_M") == 2
    base = there[2] if follows_height else context.memory.home_or_origin[2]
    return (
        there[0] + distance * math.cos(angle),
        there[1] + distance * math.sin(angle),
        base + height,
    )
