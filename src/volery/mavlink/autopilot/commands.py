"""Executes commands: each COMMAND_LONG and COMMAND_INT gets one COMMAND_ACK."""

from __future__ import annotations

import math
from collections.abc import Callable

from volery.core.errors import CommandError
from volery.mavlink.autopilot import (
    arming,
    calibration,
    failure_injection,
    feasibility,
    gripper,
    home,
    mission_protocol,
    mode_transitions,
    orbit,
    plans,
    requests,
)
from volery.mavlink.autopilot.command_protocol import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Command,
    acknowledge,
)
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.geofence import breach
from volery.mavlink.autopilot.modes import Mode, mode_of
from volery.mavlink.autopilot.state import Source

DO_SET_MODE = 176
_FENCE_TELLS = (0, 1)
"""GF_ACTION values of fences that do not restrict flight."""
_CHANGE_MODE = 1
"""Flag of MAV_DO_REPOSITION_FLAGS."""
_ABOVE_HOME = (3, 6, 10, 11)


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
    try:
        return handler(context, source, command)
    except CommandError as error:
        context.say(4, str(error))
        return TEMPORARILY_REJECTED


def _arm(context: AutopilotContext, _source: Source, command: Command) -> int:
    wanted, force = command.params[0], command.params[1]
    forced = round(force) == 21196 if math.isfinite(force) else False  # PX4's magic number
    if wanted not in (0.0, 1.0):
        return DENIED
    why = arming.arm(context) if wanted else arming.disarm(context, forced=forced)
    if why:
        context.say(2, f"{'Arming' if wanted else 'Disarming'} denied: {why}")
    return TEMPORARILY_REJECTED if why else ACCEPTED


def _take_off(context: AutopilotContext, _source: Source, command: Command) -> int:
    altitude = command.params[6]
    if math.isinf(altitude):
        return DENIED
    height = math.nan
    if math.isfinite(altitude):
        height = _height_in_map(context, altitude, command.frame) - context.state.position[2]
        if height <= 0.0:
            context.say(4, "Take-off altitude is below the vehicle")
            return DENIED
    context.memory.take_off_height = height
    return _switch(context, Mode.TAKE_OFF)


def _land(context: AutopilotContext, _source: Source, _command: Command) -> int:
    return _switch(context, Mode.LAND)


def _return(context: AutopilotContext, _source: Source, _command: Command) -> int:
    return _switch(context, Mode.RETURN)


def _set_mode(context: AutopilotContext, _source: Source, command: Command) -> int:
    base, main, sub = command.params[:3]
    if not (math.isfinite(base) and int(base) & 1 and math.isfinite(main)):
        return DENIED  # PX4's modes are custom modes
    mode = mode_of(int(main), int(sub) if math.isfinite(sub) else 0)
    if mode is None:
        context.say(4, "This flight mode is not offered")
        return UNSUPPORTED
    return _switch(context, mode)


def _switch(context: AutopilotContext, mode: Mode) -> int:
    why = mode_transitions.ask_for(context, mode)
    if why:
        context.say(2, f"Switching to mode '{mode.mavros}' not possible: {why}")
    return TEMPORARILY_REJECTED if why else ACCEPTED


def _reposition(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_REPOSITION: flies to a position and holds there; nan parameters keep their value.

    Only the command's flag to change the mode leaves a mode other than hold, as in PX4.
    """
    speed, flags, _, yaw, latitude, longitude, altitude = command.params
    if any(math.isinf(param) for param in command.params):
        return DENIED
    changes_mode = math.isfinite(flags) and bool(int(flags) & _CHANGE_MODE)
    if not mode_transitions.flies(context) or not (
        changes_mode or context.memory.mode is Mode.HOLD
    ):
        return DENIED
    x, y, z = context.state.position
    if math.isfinite(latitude) and math.isfinite(longitude):
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
            return DENIED
        x, y, _ = context.earth.place(latitude, longitude, context.build.origin[2])
    if math.isfinite(altitude):
        z = _height_in_map(context, altitude, command.frame)
    if int(context.parameter("GF_ACTION")) not in _FENCE_TELLS and breach(context, (x, y, z)):
        context.say(2, "Reposition is outside geofence")
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
    result = orbit.prepare(context, source, command, height)
    return _switch(context, Mode.ORBIT) if result == ACCEPTED else result


def _change_speed(context: AutopilotContext, _source: Source, command: Command) -> int:
    speed = command.params[1]
    if speed in (-1.0, -2.0):  # the default speed
        speed = math.nan
    elif not (math.isfinite(speed) and speed > 0.0):
        return DENIED
    if context.memory.mode is Mode.MISSION:
        context.memory.mission.speed = speed
    context.memory.cruise = speed
    if context.memory.leg is not None:
        context.memory.leg.speed = mode_transitions.cruise(context)
    return ACCEPTED


def _set_home(context: AutopilotContext, _source: Source, command: Command) -> int:
    latitude, longitude, altitude = command.params[4:7]
    if command.params[0] > 0.5:
        home.set_here(context)
        return ACCEPTED
    if not all(map(math.isfinite, (latitude, longitude, altitude))):
        return DENIED
    why = home.choose(
        context, latitude, longitude, _height_in_map(context, altitude, command.frame)
    )
    if why:
        context.say(4, why)
    return DENIED if why else ACCEPTED


def _start_mission(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles MISSION_START: arms, and flies the mission from an item on; -1: current item."""
    why = feasibility.obstacle(context)
    if why:
        context.say(2, f"Mission start denied: {why}")
        return DENIED
    first, mission = command.params[0], context.memory.mission
    if not -1.0 <= first < len(context.memory.plans[plans.MISSION]):
        return DENIED
    if first < 0.0:
        first = 0.0 if mission.complete else mission.current
    if mission.complete or int(first) != mission.current:
        mission_protocol.jump_to(context, int(first))
    result = _switch(context, Mode.MISSION)
    if result == ACCEPTED and not context.memory.armed:
        why = arming.arm(context)
        if why:
            context.say(2, f"Arming denied: {why}")
            return TEMPORARILY_REJECTED
    return result


def _jump(context: AutopilotContext, _source: Source, command: Command) -> int:
    number = command.params[0]
    there = math.isfinite(number) and mission_protocol.jump_to(context, int(number))
    return ACCEPTED if there else DENIED


def _pause(context: AutopilotContext, _source: Source, command: Command) -> int:
    return _switch(context, Mode.MISSION if command.params[0] == 1.0 else Mode.HOLD)


def _check(context: AutopilotContext, _source: Source, _command: Command) -> int:
    """Handles RUN_PREARM_CHECKS: reports all problems that prevent arming."""
    for why in arming.problems(context):
        context.say(2, f"Preflight Fail: {why}")
    return ACCEPTED


def _terminate(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_FLIGHTTERMINATION: stops the rotors permanently."""
    if not command.params[0] > 0.5:
        return ACCEPTED
    why = arming.disarm(context, forced=True)
    return FAILED if why else ACCEPTED


def _reboot(context: AutopilotContext, _source: Source, _command: Command) -> int:
    """Handles a reboot, which is not supported; `/reset_uav` resets the UAV."""
    return DENIED if context.memory.armed else UNSUPPORTED


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
