"""Manual control: flies by MANUAL_CONTROL in position and altitude mode."""

from __future__ import annotations

import math
from typing import Any

from volery.core.rotations import from_rpy
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_requirements, mode_transitions
from volery.mavlink.autopilot.state import ManualInput, Source
from volery.mavlink.autopilot.vehicle import FlightState

_DEAD = 0.1
"""Dead zone around the centre, as a fraction of full deflection, PX4's MPC_HOLD_DZ."""
_HEIGHT_GAIN, _CLIMB_GAIN, _CLIMB_INTEGRAL = 1.0, 4.0, 2.0
"""Gains of the altitude mode, 1/s, 1/s, 1/s^2, as PX4's MPC_Z_P, MPC_Z_VEL_P_ACC, MPC_Z_VEL_I_ACC.
"""
_GRAVITY = 9.80665
_TICK_S = 0.01
_MAX_CLIMB_THRUST = 3.0
"""Limit of the integral, m/s^2 (modelling choice)."""
_LIFT_M = 1.0
"""Height of a take-off by manual control (modelling choice)."""


def take(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles MANUAL_CONTROL of the first sender, and of another one when that is silent.

    An axis out of range is unused, as INT16_MAX by MAVLink's definition, and centred, as in PX4.
    """
    if message.target not in (0, context.system):
        return
    memory = context.memory
    if memory.sticks.source not in (None, source) and mode_requirements.sticks_are_there(memory):
        refused = f"MANUAL_CONTROL of {source}"
        if refused not in memory.refused_messages:
            memory.refused_messages.add(refused)
            context.report(4, f"Manual control of system {source[1]} ignored: another one controls")
        return
    forward, right, turn = (
        part / 1000.0 if -1000 <= part <= 1000 else 0.0
        for part in (message.x, message.y, message.r)
    )
    up = message.z / 500.0 - 1.0 if 0 <= message.z <= 1000 else 0.0
    memory.sticks = ManualInput(forward, right, up, turn, memory.now_ns, source)


def fly_position(context: AutopilotContext, state: FlightState) -> None:
    """Commands velocities by the sticks; with centred sticks the UAV holds its position."""
    if not _is_up(context, state):
        return
    forward, right, up, turn = _alive(context.memory.sticks)
    memory = context.memory
    if forward == right == up == turn == 0.0:
        if memory.order != "hold":
            mode_transitions.order(context, "hold", context.vehicle.hold())
        return
    if memory.now_ns - memory.ordered_ns < 20_000_000 and memory.order == "steer":
        return
    speed = min(
        float(context.parameter("MPC_VEL_MANUAL")), float(context.parameter("MPC_XY_VEL_MAX"))
    )
    c, s = math.cos(context.yaw), math.sin(context.yaw)
    x, y = speed * (c * forward + s * right), speed * (s * forward - c * right)
    rate = yaw_rate(context)
    context.vehicle.steer((x, y, _climb(context, up)), None, rate)
    mode_transitions.order(context, "steer")


def fly_altitude(context: AutopilotContext, state: FlightState) -> None:
    """Commands tilts by the sticks; only the height is held."""
    if not _is_up(context, state):
        return
    memory = context.memory
    forward, right, up, _ = _alive(memory.sticks)
    if memory.order != "tilt":
        memory.climb_thrust, memory.altitude_target = 0.0, state.position[2]
    if up != 0.0:
        memory.altitude_target = math.nan
        wanted = _climb(context, up)
    else:
        if math.isnan(memory.altitude_target):
            memory.altitude_target = state.position[2]
        wanted = _HEIGHT_GAIN * (memory.altitude_target - state.position[2])
    error = wanted - state.velocity[2]
    memory.climb_thrust += _CLIMB_INTEGRAL * error * _TICK_S
    memory.climb_thrust = min(max(memory.climb_thrust, -_MAX_CLIMB_THRUST), _MAX_CLIMB_THRUST)
    push = _CLIMB_GAIN * error + memory.climb_thrust
    max_tilt = math.radians(float(context.parameter("MPC_MAN_TILT_MAX")))
    roll, pitch = right * max_tilt, forward * max_tilt
    lean = math.cos(roll) * math.cos(pitch)
    thrust = context.build.hover_thrust * (1.0 + push / _GRAVITY) / max(lean, 0.3)
    rate = yaw_rate(context)
    x, y, z, w = from_rpy(roll, pitch, context.yaw + 0.2 * rate).tolist()
    context.vehicle.tilt((x, y, z, w), min(max(thrust, 0.05), 1.0))
    mode_transitions.order(context, "tilt")


def yaw_rate(context: AutopilotContext) -> float:
    """Returns the yaw rate that the sticks command, rad/s, map."""
    turn = _alive(context.memory.sticks)[3]
    return -turn * math.radians(float(context.parameter("MPC_MAN_Y_MAX")))


def _is_up(context: AutopilotContext, state: FlightState) -> bool:
    """Returns whether the UAV flies; on the ground, raising the stick starts a take-off."""
    if state.mode == "LANDED":
        if context.memory.sticks.up > _DEAD and context.memory.order != "take_off":
            mode_transitions.order(context, "take_off", context.vehicle.take_off(_LIFT_M))
        return False
    return not (context.memory.order == "take_off" and state.mode == "TAKE_OFF")


def _climb(context: AutopilotContext, up: float) -> float:
    return up * float(context.parameter("MPC_Z_VEL_MAX_UP" if up > 0.0 else "MPC_Z_VEL_MAX_DN"))


def _alive(sticks: ManualInput) -> tuple[float, float, float, float]:
    """Returns deflections beyond the dead zone, from 0 there to 1."""
    forward, right, up, turn = (
        math.copysign(max(0.0, abs(part) - _DEAD) / (1.0 - _DEAD), part)
        for part in (sticks.forward, sticks.right, sticks.up, sticks.turn)
    )
    return forward, right, up, turn
