"""Flies orbits: circles around a position. A positive radius turns clockwise."""

from __future__ import annotations

import math
from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.messages.motion import degrees_e7, us
from volery.mavlink.autopilot.modes import manual_control, mode_requirements, mode_transitions
from volery.mavlink.autopilot.modes.legs import approach_speed, fly_leg
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.modes.setpoints import OffboardSetpoint
from volery.mavlink.autopilot.protocols.command_protocol import (
    ACCEPTED,
    DENIED,
    TEMPORARILY_REJECTED,
    Command,
)
from volery.mavlink.autopilot.state import MissionLeg, Orbit, Source
from volery.mavlink.autopilot.vehicle import FlightState, Vector
from volery.mavlink.codec import dialect

DO_ORBIT = 34
_MIN_RADIUS_M, _MAX_RADIUS_M = 1.0, 1000.0
_MAX_SPEED_M_S, _MAX_ACCELERATION = 10.0, 2.0
"""PX4's limits; a speed that the acceleration does not allow is reduced."""
_TO_CENTRE, _INITIAL_HEADING, _UNCONTROLLED, _TANGENT, _BY_STICKS, _UNCHANGED = range(6)
"""Values of ORBIT_YAW_BEHAVIOUR."""
_GAIN = 1.0
"""Gain of the approach to the circle, 1/s, PX4's."""
_ON_CIRCLE_M = 0.5
_PERIOD_NS = 20_000_000


def prepare(context: AutopilotContext, _source: Source, command: Command, height: float) -> int:
    """Returns the result of DO_ORBIT, whose altitude is `height` in the map (nan: unchanged)."""
    if any(math.isinf(param) for param in command.params):
        return DENIED
    behaviour = command.params[2]
    if math.isfinite(behaviour) and round(behaviour) not in range(6):
        return DENIED
    latitude, longitude = command.params[4:6]
    placed = math.isfinite(latitude) and math.isfinite(longitude)
    if placed and not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        return DENIED
    if not (context.memory.armed and mode_transitions.flies(context)):
        return TEMPORARILY_REJECTED
    before = context.memory.orbit if context.memory.mode is Mode.ORBIT else None
    x, y, z = before.center if before else context.state.position
    if placed:
        x, y, _ = context.earth.map_position(latitude, longitude, context.build.origin[2])
    context.memory.orbit = _orbit(
        command.params, before, (x, y, height if math.isfinite(height) else z), context.yaw
    )
    return ACCEPTED


def _orbit(params: tuple[float, ...], before: Orbit | None, center: Vector, yaw: float) -> Orbit:
    radius, speed, behaviour = params[:3]
    if not math.isfinite(radius):
        radius = before.radius if before else _MIN_RADIUS_M
    if not math.isfinite(speed):
        speed = before.speed if before else 1.0
    clockwise = radius > 0.0
    radius = min(max(abs(radius), _MIN_RADIUS_M), _MAX_RADIUS_M)
    limit = min(_MAX_SPEED_M_S, math.sqrt(_MAX_ACCELERATION * radius))
    speed = min(max(speed, -limit), limit)
    facing = round(behaviour) if math.isfinite(behaviour) else _UNCHANGED
    if facing == _UNCHANGED:
        facing = before.facing if before else _TO_CENTRE
    return Orbit(center, radius if clockwise else -radius, speed, facing, yaw)


def fly(context: AutopilotContext, state: FlightState) -> None:
    """Flies to the nearest point of the circle, then along it."""
    memory, orbit = context.memory, context.memory.orbit
    if orbit is None or state.mode == "LANDED":
        return
    x, y, z = (here - there for here, there in zip(state.position, orbit.center, strict=True))
    away = math.hypot(x, y)
    if away < 1e-3:
        x, y, away = math.cos(context.yaw), math.sin(context.yaw), 1.0
        radial_error = -abs(orbit.radius)
    else:
        radial_error = away - abs(orbit.radius)
    outward = x / away, y / away
    if orbit.approaches:
        orbit.approaches = not _approach(context, orbit, outward, abs(radial_error) + abs(z))
        return
    if memory.now_ns - memory.ordered_ns < _PERIOD_NS and memory.order == "steer":
        return
    turning = math.copysign(1.0, orbit.radius) * orbit.speed
    along = outward[1] * turning, -outward[0] * turning
    back = _GAIN * radial_error
    climb = math.copysign(_climb(context, z), -z)
    yaw, rate = _facing(orbit, outward, turning)
    if orbit.facing == _BY_STICKS and mode_requirements.sticks_are_there(memory):
        rate = manual_control.yaw_rate(context)
    velocity = along[0] - back * outward[0], along[1] - back * outward[1], climb
    memory.target = OffboardSetpoint(velocity=velocity, yaw=math.nan if yaw is None else yaw)
    context.vehicle.steer(velocity, yaw, rate)
    mode_transitions.order(context, "steer")


def status(context: AutopilotContext) -> Any:
    """Returns ORBIT_EXECUTION_STATUS; None if the UAV is not orbiting."""
    orbit = context.memory.orbit
    if orbit is None or context.memory.mode is not Mode.ORBIT:
        return None
    latitude, longitude, _ = degrees_e7(context.earth.geodetic(orbit.center))
    altitude = orbit.center[2] + context.build.origin[2]
    built = dialect().MAVLink_orbit_execution_status_message
    return built(us(context), orbit.radius, 0, latitude, longitude, altitude)


def _approach(
    context: AutopilotContext, orbit: Orbit, outward: tuple[float, float], off_m: float
) -> bool:
    """Returns whether the circle is reached."""
    if context.memory.leg is None:
        x, y, z = orbit.center
        size = abs(orbit.radius)
        target = x + size * outward[0], y + size * outward[1], z
        yaw, _ = _facing(orbit, outward, 0.0)
        context.memory.leg = MissionLeg(target, yaw, mode_transitions.cruise(context))
    if off_m > _ON_CIRCLE_M and not fly_leg(context, context.memory.leg):
        return False
    context.memory.leg = None
    return True


def _facing(
    orbit: Orbit, outward: tuple[float, float], turning: float
) -> tuple[float | None, float]:
    """Returns the yaw in the map (None: free) and the yaw rate."""
    if orbit.facing == _INITIAL_HEADING:
        return orbit.initial_yaw, 0.0
    if orbit.facing in (_UNCONTROLLED, _BY_STICKS):
        return None, 0.0
    rate = -turning / abs(orbit.radius)
    if orbit.facing == _TANGENT:
        return math.atan2(-outward[0] * turning, outward[1] * turning), rate
    return math.atan2(-outward[1], -outward[0]), rate


def _climb(context: AutopilotContext, above: float) -> float:
    """Returns the speed of the approach to the orbit's height, m/s."""
    direction = "DN" if above > 0.0 else "UP"
    limit = float(context.parameter(f"MPC_Z_V_AUTO_{direction}"))
    return min(limit, approach_speed(abs(above), 0.5 * float(context.parameter("MPC_ACC_HOR"))))
