"""Executes commands: each COMMAND_LONG and COMMAND_INT gets one COMMAND_ACK."""

from __future__ import annotations

import math
from collections.abc import Callable

from volery.core.errors import CommandError
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.messages import dialect_extensions
from volery.mavlink.autopilot.modes import gripper, mode_transitions, orbit
from volery.mavlink.autopilot.modes.modes import Mode, mode_of, mode_of_flags
from volery.mavlink.autopilot.protocols import (
    calibration,
    failure_injection,
    mission_protocol,
    plans,
    requests,
)
from volery.mavlink.autopilot.protocols.command_protocol import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    UNSUPPORTED_FRAME,
    Command,
    acknowledge,
)
from volery.mavlink.autopilot.safety import arming, feasibility, home
from volery.mavlink.autopilot.safety.geofence import breach
from volery.mavlink.autopilot.state import Source

DO_SET_MODE = 176
_UNRESTRICTED_FENCES = (0, 1)
"""GF_ACTION values of fences that do not restrict flight."""
_CHANGE_MODE = 1
"""Flag of MAV_DO_REPOSITION_FLAGS."""
_ABOVE_HOME = (3, 6)
_GLOBAL_FRAMES = (0, 5, *_ABOVE_HOME)
_LEVEL_SPEEDS = (0, 1)
"""SPEED_TYPE: air and ground speed, one as the other, as in PX4."""
_MAX_TAKE_OFF_DISTANCE_M = 10_000.0
"""Distance to which a take-off leads at most (modelling choice)."""


def take(context: AutopilotContext, source: Source, command: Command) -> None:
    """Executes a command and acknowledges it to its sender."""
    acknowledge(context.links, source, command.number, do(context, source, command))


def do(context: AutopilotContext, source: Source, command: Command) -> int:
    """Executes a command; returns its MAV_RESULT."""
    handler = _HANDLERS.get(command.number)
    if handler is None:
        return UNSUPPORTED
    if context.memory.state is None:
        return TEMPORARILY_REJECTED
    if command.number in _PLACED and not _frame_is_known(command):
        context.report(4, f"Command {command.number}: frame {command.frame} is not supported")
        return UNSUPPORTED_FRAME
    try:
        return handler(context, source, command)
    except CommandError as error:
        context.report(4, str(error))
        return TEMPORARILY_REJECTED


def _frame_is_known(command: Command) -> bool:
    """Returns whether a position of a COMMAND_INT is in a frame that is known, if there is one."""
    somewhere = any(math.isfinite(part) for part in command.params[4:7])
    return command.frame is None or command.frame in _GLOBAL_FRAMES or not somewhere


def _arm(context: AutopilotContext, _source: Source, command: Command) -> int:
    forced = _whole(command.params[1]) == 21196  # PX4's magic number
    wanted = _whole(command.params[0])
    if wanted not in (0, 1):
        context.report(2, f"Unsupported ARM_DISARM param: {command.params[0]:.3f}")
        return DENIED
    why = arming.arm(context) if wanted else arming.disarm(context, forced=forced)
    if why:
        context.report(2, f"{'Arming' if wanted else 'Disarming'} denied: {why}")
    return TEMPORARILY_REJECTED if why else ACCEPTED


def _take_off(context: AutopilotContext, _source: Source, command: Command) -> int:
    *_, latitude, longitude, altitude = command.params
    if math.isinf(altitude):
        return DENIED
    height, position = math.nan, None
    if math.isfinite(altitude):
        height = _height_in_map(context, altitude, command.frame) - context.state.position[2]
        if height <= 0.0:
            context.report(4, "Take-off altitude is below the vehicle")
            return DENIED
    if math.isfinite(latitude) and math.isfinite(longitude):
        position = _position_in_map(context, latitude, longitude)
        if (
            position is None
            or math.dist(position, context.state.position[:2]) > _MAX_TAKE_OFF_DISTANCE_M
        ):
            context.report(4, "Take-off position is too far away; nan: above the vehicle")
            return DENIED
    context.memory.take_off_height, context.memory.take_off_position = height, position
    return _switch(context, Mode.TAKE_OFF)


def _land(context: AutopilotContext, _source: Source, _command: Command) -> int:
    result = _switch(context, Mode.LAND)
    if result == ACCEPTED:
        context.report(6, "Landing at current position")
    return result


def _return(context: AutopilotContext, _source: Source, _command: Command) -> int:
    result = _switch(context, Mode.RETURN)
    if result == ACCEPTED:
        context.report(6, "Returning to launch")
    return result


def _set_mode(context: AutopilotContext, _source: Source, command: Command) -> int:
    base, main, sub = (_whole(part) for part in command.params[:3])
    mode = mode_of(main, sub) if base & 1 else mode_of_flags(base)
    if mode is None:
        context.report(4, "This flight mode is not offered")
        return UNSUPPORTED
    return _switch(context, mode)


def _set_standard_mode(context: AutopilotContext, _source: Source, command: Command) -> int:
    mode = dialect_extensions.standard_mode(_whole(command.params[0]))
    if mode is None:
        context.report(4, "This standard mode is not offered")
        return FAILED
    return _switch(context, mode)


def _switch(context: AutopilotContext, mode: Mode) -> int:
    why = mode_transitions.request_mode(context, mode)
    if why:
        context.report(2, f"Switching to mode '{mode.mavros}' not possible: {why}")
    return TEMPORARILY_REJECTED if why else ACCEPTED


def _reposition(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_REPOSITION: flies to a position and holds there; nan parameters keep their value.

    Only the command's flag to change the mode leaves a mode other than hold, as in PX4.
    """
    speed, flags, _, yaw, latitude, longitude, altitude = command.params
    if any(math.isinf(param) for param in command.params):
        return DENIED
    if _whole(flags) & ~_CHANGE_MODE:
        context.report(4, "Reposition with a relative yaw is not supported")
        return UNSUPPORTED
    changes_mode = bool(_whole(flags) & _CHANGE_MODE)
    if not mode_transitions.flies(context) or not (
        changes_mode or context.memory.mode is Mode.HOLD
    ):
        return DENIED
    x, y, z = context.state.position
    if math.isfinite(latitude) and math.isfinite(longitude):
        position = _position_in_map(context, latitude, longitude)
        if position is None:
            return DENIED
        x, y = position
    if math.isfinite(altitude):
        z = _height_in_map(context, altitude, command.frame)
    if int(context.parameter("GF_ACTION")) not in _UNRESTRICTED_FENCES and breach(
        context, (x, y, z)
    ):
        context.report(2, "Reposition is outside geofence")
        return DENIED
    result = _switch(context, Mode.HOLD)
    if result == ACCEPTED:
        if math.isfinite(speed) and speed > 0.0:
            context.memory.cruise = speed
        facing = 0.5 * math.pi - yaw if math.isfinite(yaw) else None
        mode_transitions.go_to(context, (x, y, z), facing)
    return result


def _orbit(context: AutopilotContext, source: Source, command: Command) -> int:
    # Above sea level in any frame, as in PX4: MAVSDK sends it as relative.
    height = _height_in_map(context, command.params[6], None)
    if math.isfinite(command.params[3]) and command.params[3] != 0.0:
        context.report(
            4, "An orbit lasts until the mode changes: a number of turns is not supported"
        )
        return DENIED
    result = orbit.prepare(context, source, command, height)
    return _switch(context, Mode.ORBIT) if result == ACCEPTED else result


def _change_speed(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_CHANGE_SPEED: without a positive speed the default one, as in PX4."""
    kind, speed, throttle = command.params[:3]
    if math.isinf(speed):
        return DENIED
    if _whole(kind) not in _LEVEL_SPEEDS:
        context.report(4, "Speeds of climb and descent are set by MPC_Z_V_AUTO_UP and _DN")
        return DENIED
    if not speed > 0.0:
        if throttle > 0.0:
            context.report(4, "A multicopter has no cruise throttle")
            return DENIED
        speed = math.nan
    if context.memory.mode is Mode.MISSION:
        context.memory.mission.speed = speed
    context.memory.cruise = speed
    if context.memory.leg is not None:
        context.memory.leg.speed = mode_transitions.cruise(context)
    return ACCEPTED


def _set_home(context: AutopilotContext, _source: Source, command: Command) -> int:
    yaw, latitude, longitude, altitude = command.params[3:7]
    if command.params[0] > 0.5:
        home.set_here(context)
        return ACCEPTED
    if not all(map(math.isfinite, (latitude, longitude, altitude))):
        return DENIED
    height = _height_in_map(context, altitude, command.frame)
    facing = 0.5 * math.pi - math.radians(yaw) if math.isfinite(yaw) else math.nan
    why = home.choose(context, latitude, longitude, height, facing)
    if why:
        context.report(4, why)
    return DENIED if why else ACCEPTED


def _start_mission(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles MISSION_START: arms, and flies the mission from an item on; -1: current item."""
    why = feasibility.obstacle(context)
    if why:
        context.report(2, f"Mission start denied: {why}")
        return DENIED
    first, mission = command.params[0], context.memory.mission
    if not -1.0 <= first < len(context.memory.plans[plans.MISSION]):
        return DENIED
    if first < 0.0:
        first = 0.0 if mission.complete else mission.current
    if mission.complete or int(first) != mission.current:
        mission_protocol.jump_to(context, int(first))
    last = command.params[1]
    if math.isfinite(last) and 0.0 < last < len(context.memory.plans[plans.MISSION]) - 1:
        context.report(4, f"The mission flies to its end, not to item {last:.0f}")
    result = _switch(context, Mode.MISSION)
    if result == ACCEPTED and not context.memory.armed:
        why = arming.arm(context)
        if why:
            context.report(2, f"Arming denied: {why}")
            return TEMPORARILY_REJECTED
    return result


def _jump(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_SET_MISSION_CURRENT; -1: the current item, with param2 to reset the mission."""
    number, resets = command.params[:2]
    if not (math.isfinite(number) and number >= -1.0 and (math.isnan(resets) or resets in (0, 1))):
        return DENIED
    sequence = int(number) if number >= 0.0 else context.memory.mission.current
    there = mission_protocol.jump_to(context, sequence, resets=resets == 1.0)
    return ACCEPTED if there else FAILED


def _pause(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_PAUSE_CONTINUE: 0 holds, 1 continues the mission."""
    mode = {0.0: Mode.HOLD, 1.0: Mode.MISSION}.get(command.params[0])
    return DENIED if mode is None else _switch(context, mode)


def _check(context: AutopilotContext, _source: Source, _command: Command) -> int:
    """Handles RUN_PREARM_CHECKS: reports all problems that prevent arming."""
    for why in arming.problems(context):
        context.report(2, f"Preflight Fail: {why}")
    return ACCEPTED


def _terminate(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_FLIGHTTERMINATION: stops the rotors permanently."""
    if not (command.params[0] > 0.5 and context.memory.armed):
        return DENIED
    why = arming.disarm(context, forced=True)
    return FAILED if why else ACCEPTED


def _reboot(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles a reboot, which is not supported; `/reset_uav` resets the UAV. 0: do nothing."""
    if _whole(command.params[0]) == 0:
        return ACCEPTED
    return DENIED if context.memory.armed else UNSUPPORTED


def _whole(param: float) -> int:
    """Returns a parameter that holds a whole number; 0 if it is not given."""
    return round(param) if math.isfinite(param) else 0


def _position_in_map(
    context: AutopilotContext, latitude: float, longitude: float
) -> tuple[float, float] | None:
    """Returns x and y in the map, m; None for degrees that are not on the earth."""
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        return None
    x, y, _ = context.earth.map_position(latitude, longitude, context.build.origin[2])
    return x, y


def _height_in_map(context: AutopilotContext, altitude: float, frame: int | None) -> float:
    """Returns z in the map of an altitude: above home in relative frames, else above sea level."""
    if frame is not None and frame in _ABOVE_HOME:
        return context.memory.home_or_origin[2] + altitude
    return altitude - context.build.origin[2]


_HANDLERS: dict[int, Callable[[AutopilotContext, Source, Command], int]] = {
    plans.RETURN_TO_LAUNCH: _return,
    plans.LAND: _land,
    plans.TAKE_OFF: _take_off,
    orbit.DO_ORBIT: _orbit,
    DO_SET_MODE: _set_mode,
    plans.CHANGE_SPEED: _change_speed,
    plans.SET_HOME: _set_home,
    185: _terminate,
    192: _reposition,
    193: _pause,
    gripper.DO_GRIPPER: gripper.act,
    224: _jump,
    calibration.CALIBRATE: calibration.start,
    246: _reboot,
    262: _set_standard_mode,
    300: _start_mission,
    400: _arm,
    401: _check,
    failure_injection.INJECT_FAILURE: failure_injection.inject,
    510: requests.get_interval,
    511: requests.set_interval,
    512: requests.send,
    **dict.fromkeys(requests.RETIRED, requests.send_as_of_old),
}
"""Handlers by MAV_CMD."""
_PLACED = (plans.TAKE_OFF, orbit.DO_ORBIT, plans.SET_HOME, 192)
"""Commands with a position."""
