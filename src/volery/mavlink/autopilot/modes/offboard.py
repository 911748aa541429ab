"""Offboard mode: flies external setpoints, by PX4's rules of start and loss.

Setpoints are received in every mode, so that offboard can be entered while they arrive. The
autopilot follows one sender at a time: another sender's setpoints count once the first has been
silent for COM_OF_LOSS_T.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from volery.core.errors import CommandError
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_transitions
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.modes.setpoints import (
    OffboardSetpoint,
    attitude_setpoint,
    global_setpoint,
    local_setpoint,
)
from volery.mavlink.autopilot.safety import failsafes
from volery.mavlink.autopilot.state import MissionLeg, Source
from volery.mavlink.autopilot.vehicle import FlightState, Vector

_GAIN = 0.95
"""Gain, 1/s: PX4's MPC_XY_P and, within a twentieth, MPC_Z_P."""
_TRACKED_M = 2.0
"""Distance below which a moving position is tracked; the UAV first flies towards a farther one."""
_REFRESH_NS, _FEEDBACK_NS = 100_000_000, 20_000_000
"""Periods at which velocities are repeated, and at which they are computed from the position."""
_LIFTED_M = 0.3
"""Height from which setpoints are flown after a take-off from the ground."""
_ABOVE_HOME = (3, 6)


def take_local(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles SET_POSITION_TARGET_LOCAL_NED."""
    attitude = context.state.attitude
    _read(
        context, source, message, lambda: local_setpoint(message, context.memory.origin, attitude)
    )


def take_global(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles SET_POSITION_TARGET_GLOBAL_INT."""
    x, y, _ = context.earth.map_position(message.lat_int * 1e-7, message.lon_int * 1e-7, 0.0)
    above = message.coordinate_frame in _ABOVE_HOME
    home = context.memory.home_or_origin
    z = message.alt + (home[2] if above else -context.build.origin[2])
    _read(context, source, message, lambda: global_setpoint(message, (x, y, z)))


def take_attitude(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles SET_ATTITUDE_TARGET."""
    rates = context.state.rates
    _read(context, source, message, lambda: attitude_setpoint(message, rates))


def _read(
    context: AutopilotContext,
    source: Source,
    message: Any,
    convert: Callable[[], OffboardSetpoint],
) -> None:
    """Takes a message's setpoint, or says why it is refused."""
    try:
        setpoint = convert()
    except CommandError as error:
        context.report_refusal(f"{message.get_type()} {error}")
        return
    take(context, source, setpoint)


def take(context: AutopilotContext, source: Source, setpoint: OffboardSetpoint) -> None:
    """Stores a setpoint; in offboard mode it is flown at once."""
    memory = context.memory
    offboard, now_ns = memory.offboard, memory.now_ns
    if source != offboard.source:
        if offboard.source is not None and not _is_stale(context):
            if source not in offboard.refused:
                offboard.refused.add(source)
                context.report(
                    4, f"Setpoints of {source[1]}/{source[2]} ignored: another one flies"
                )
            return
        offboard.source = source
        offboard.refused.clear()
    offboard.setpoint, offboard.time_ns = setpoint, now_ns
    if memory.mode is Mode.OFFBOARD and memory.armed and memory.state is not None:
        _fly(context, memory.state, setpoint, fresh=True)


def _is_stale(context: AutopilotContext) -> bool:
    limit_ns = float(context.parameter("COM_OF_LOSS_T")) * 1e9
    return context.memory.now_ns - context.memory.offboard.time_ns > limit_ns


def fly(context: AutopilotContext, state: FlightState) -> None:
    """Continues with the newest setpoint; handles the loss of setpoints."""
    setpoint = context.memory.offboard.setpoint
    if _is_stale(context) or setpoint is None:
        action = int(context.parameter("COM_OBL_RC_ACT"))
        context.report(2, "Failsafe: offboard control lost")
        failsafes.act(context, {3: Mode.RETURN, 4: Mode.LAND}.get(action, Mode.HOLD))
        return
    _fly(context, state, setpoint, fresh=False)


def _fly(
    context: AutopilotContext, state: FlightState, setpoint: OffboardSetpoint, *, fresh: bool
) -> None:
    memory = context.memory
    memory.target = setpoint
    if setpoint.attitude is not None or setpoint.rates is not None:
        _hold_attitude(context, setpoint, fresh=fresh)
        return
    if not _is_up(context, state, setpoint):
        return
    if _is_position_only(setpoint):
        _go(context, setpoint, fresh=fresh)
    elif _finite(setpoint.position) and _finite(setpoint.velocity):
        _track(context, state, setpoint, fresh=fresh)
    elif _finite(setpoint.acceleration) and not any(map(math.isfinite, setpoint.velocity)):
        _push(context, setpoint, fresh=fresh)
    else:
        _steer(context, state, setpoint, fresh=fresh)


def _hold_attitude(context: AutopilotContext, setpoint: OffboardSetpoint, *, fresh: bool) -> None:
    if not fresh and context.memory.order in ("tilt", "spin"):
        return
    if setpoint.attitude is not None:
        context.vehicle.tilt(setpoint.attitude, setpoint.thrust)
        mode_transitions.order(context, "tilt")
    elif setpoint.rates is not None:
        context.vehicle.spin(setpoint.rates, setpoint.thrust)
        mode_transitions.order(context, "spin")


def _is_up(context: AutopilotContext, state: FlightState, setpoint: OffboardSetpoint) -> bool:
    """Returns whether the UAV is high enough for setpoints; upward setpoints start a take-off.

    Attitudes need no take-off: their thrust decides.
    """
    memory = context.memory
    if state.mode == "LANDED":
        upwards = (
            setpoint.position[2] > state.position[2] + 0.2
            or setpoint.velocity[2] > 0.1
            or setpoint.acceleration[2] > 0.1
        )
        if upwards and memory.order != "take_off":
            mode_transitions.order(context, "take_off", context.vehicle.take_off(2.0 * _LIFTED_M))
        return False
    if memory.order == "take_off":
        ground = memory.home_or_origin[2]
        if state.mode == "TAKE_OFF" and state.position[2] < ground + _LIFTED_M:
            return False
        mode_transitions.order(context, "hold", context.vehicle.hold())
    return True


def _is_position_only(setpoint: OffboardSetpoint) -> bool:
    moves = any(map(math.isfinite, (*setpoint.velocity, *setpoint.acceleration)))
    return _finite(setpoint.position) and not moves and not math.isfinite(setpoint.yaw_rate)


def _go(context: AutopilotContext, setpoint: OffboardSetpoint, *, fresh: bool) -> None:
    leg = context.memory.leg
    yaw = setpoint.yaw if math.isfinite(setpoint.yaw) else None
    same = leg is not None and (leg.target, leg.yaw) == (setpoint.position, yaw)
    if same and context.memory.order == "go_to":
        return
    if fresh or not same:
        context.memory.leg = MissionLeg(setpoint.position, yaw, 0.0, locked=True)
        mode_transitions.order(context, "go_to", context.vehicle.go_to(setpoint.position, yaw))


def _track(
    context: AutopilotContext, state: FlightState, setpoint: OffboardSetpoint, *, fresh: bool
) -> None:
    if math.dist(setpoint.position, state.position) > _TRACKED_M:
        _steer(context, state, setpoint, fresh=fresh)
    elif fresh:
        push = setpoint.acceleration if _finite(setpoint.acceleration) else (0.0, 0.0, 0.0)
        context.vehicle.follow(setpoint.position, setpoint.velocity, push, *_turn(setpoint))
        mode_transitions.order(context, "follow")


def _push(context: AutopilotContext, setpoint: OffboardSetpoint, *, fresh: bool) -> None:
    if fresh or context.memory.order != "push":
        context.vehicle.push(setpoint.acceleration, *_turn(setpoint))
        mode_transitions.order(context, "push")


def _steer(
    context: AutopilotContext, state: FlightState, setpoint: OffboardSetpoint, *, fresh: bool
) -> None:
    """Commands velocities; axes with a position are controlled towards it."""
    age_ns = context.memory.now_ns - context.memory.ordered_ns
    placed = any(map(math.isfinite, setpoint.position))
    if not fresh and age_ns < (_FEEDBACK_NS if placed else _REFRESH_NS):
        return
    x, y, z = (v if math.isfinite(v) else 0.0 for v in setpoint.velocity)
    x, y, z = (
        v + (_GAIN * (goal - here) if math.isfinite(goal) else 0.0)
        for v, goal, here in zip((x, y, z), setpoint.position, state.position, strict=True)
    )
    size, max_speed = math.hypot(x, y), float(context.parameter("MPC_XY_VEL_MAX"))
    if size > max_speed:
        x, y = x * max_speed / size, y * max_speed / size
    up, down = (
        float(context.parameter(f"MPC_Z_VEL_MAX_{direction}")) for direction in ("UP", "DN")
    )
    context.vehicle.steer((x, y, min(max(z, -down), up)), *_turn(setpoint))
    mode_transitions.order(context, "steer")


def _turn(setpoint: OffboardSetpoint) -> tuple[float | None, float]:
    rate = setpoint.yaw_rate if math.isfinite(setpoint.yaw_rate) else 0.0
    return (setpoint.yaw if math.isfinite(setpoint.yaw) else None), rate


def _finite(vector: Vector) -> bool:
    return all(map(math.isfinite, vector))
