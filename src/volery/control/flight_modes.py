"""Flight modes: autonomous behaviour between two commands.

Modes run at guidance ticks inside the compiled step and count in steps, so that results do not
depend on the slicing of a run. ROS services and MAVLink request the same modes.

    LANDED --take_off--> TAKE_OFF --arrived--> HOLD
    any flying mode --command--> GO_TO --arrived--> HOLD
                                 VELOCITY --no command for a while--> HOLD
                                 TRAJECTORY --flown, or no setpoint for a while--> HOLD
                                 RETURN --climbed, over home, low--> LAND --on the ground--> LANDED
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

from volery.control.heading import heading_of, turn_heading
from volery.control.outer_loop import track
from volery.control.reference import (
    brake_height,
    brake_level,
    lead_height,
    lead_level,
    move_on,
    steer_height,
    steer_level,
)
from volery.control.setpoints import ControlLevel
from volery.control.trajectory_kernels import follow_path, follow_setpoint, path_is_flown
from volery.vehicle.compiled import apart_kernel, inner_kernel
from volery.vehicle.rotation_math import three


class FlightMode(IntEnum):
    """Flight mode of a UAV."""

    LANDED = 0
    """On the ground with its rotors stopped; waits for a take-off."""
    TAKE_OFF = 1
    """Climbs vertically to a height above its start position."""
    HOLD = 2
    """Stops and holds its position."""
    GO_TO = 3
    """Flies to a position and holds there."""
    VELOCITY = 4
    """Follows velocity commands; holds after a timeout."""
    LAND = 5
    """Descends until the ground supports it, then stops its rotors."""
    RETURN = 6
    """Climbs, flies to its home and lands there."""
    LOW_LEVEL = 7
    """Follows external rotor speeds, body rates or attitudes; has no timeout."""
    CRASHED = 8
    """Hit something; rotors stopped for good."""
    TRAJECTORY = 9
    """Follows a trajectory or trajectory setpoints; holds at the end or after a timeout."""

    def __str__(self) -> str:
        return self.name

    def __format__(self, spec: str) -> str:
        """Formats the name; a spec for integers, such as `d`, formats the number."""
        return (
            format(int(self), spec) if spec.endswith(tuple("bcdoxXn")) else format(self.name, spec)
        )


DOWN_MODES = (FlightMode.LANDED, FlightMode.CRASHED)
"""Modes of a UAV that has come down, or not yet taken off."""


LANDED = int(FlightMode.LANDED)
TAKE_OFF = int(FlightMode.TAKE_OFF)
HOLD = int(FlightMode.HOLD)
GO_TO = int(FlightMode.GO_TO)
VELOCITY = int(FlightMode.VELOCITY)
LAND = int(FlightMode.LAND)
RETURN = int(FlightMode.RETURN)
LOW_LEVEL = int(FlightMode.LOW_LEVEL)
CRASHED = int(FlightMode.CRASHED)
TRAJECTORY = int(FlightMode.TRAJECTORY)

_STOPPED = int(ControlLevel.STOPPED)
_GUIDED = int(ControlLevel.GUIDED)

_ARRIVED_M = 0.25
_ARRIVED_M_S = 0.4
_STOPPED_M_S = 0.3
"""Speed below which braking ends and the position is locked."""
_RETURN_LOW_M = 3.0
"""Height above home at which a return becomes a landing."""
_CARRIED_THRUST, _FALLING_THRUST = 0.7, 0.5
"""Fractions of the weight: with less thrust than the first, the ground supports a landing UAV; with
less than the second it would fall in the air."""
_GROUND_THRUST = 0.8
"""Fraction of the weight: less thrust than this without descent means that the ground supports ...
"""
_GROUND_M_S = 0.15
_GROUND_S, _SURE, _LIKELY = 0.3, 10, 3
"""... the UAV if it lasts this long. Thrust with which it would fall counts three tenths of that,
whatever the estimate of its speed."""

CLIMBING, CROSSING, DESCENDING = 0, 1, 2


@apart_kernel
def guide(control_state: Any, estimate: Any, gains: Any, paths: Any, step: int, dt: float) -> None:
    """Runs one guidance tick: mode changes, the reference, attitude and thrust setpoints.

    estimate: a record with `position_map`, `velocity_map`, `attitude`. paths: the segments of all
    trajectories. step: the physics step that begins now, for times.
    """
    if control_state.level != _GUIDED:
        return
    move_on(control_state, gains)
    fx, fy, fz = plan(control_state, estimate, gains, paths, step, dt)
    by_velocity = control_state.mode == VELOCITY or control_state.braking
    track(
        control_state,
        estimate,
        gains,
        not by_velocity,
        not (by_velocity or control_state.mode == LAND),
        fx,
        fy,
        fz,
    )
    if control_state.mode == LAND:
        _settle(control_state, gains)
        _feel_ground(control_state, gains, estimate.velocity_map[2])


@inner_kernel
def plan(
    control_state: Any, estimate: Any, gains: Any, paths: Any, step: int, dt: float
) -> tuple[float, float, float]:
    """Changes modes and chooses the motion of the reference; returns the feedforward acceleration.

    The reference already belongs to this tick.
    """
    _end_what_ended(control_state, estimate, gains, paths, step, dt)
    if control_state.mode == TRAJECTORY:
        if control_state.path_last >= 0:
            rate, fx, fy, fz = follow_path(control_state, gains, paths, step, dt)
        else:
            rate, fx, fy, fz = follow_setpoint(control_state, gains, step, dt)
        turn_heading(control_state, estimate, gains, rate)
        return fx, fy, fz
    turn_heading(control_state, estimate, gains, 0.0)
    if control_state.mode == VELOCITY:
        tx, ty, tz = wanted_velocity(control_state, estimate, gains)
        steer_level(control_state, estimate, gains, tx, ty)
        steer_height(control_state, estimate, gains, tz)
    else:
        if control_state.braking:
            brake_level(control_state, estimate, gains)
        else:
            lead_level(control_state, estimate, gains, gains.speed)
        if control_state.mode == LAND:
            sink = control_state.sink if control_state.sink > 0.0 else gains.landing
            # a descent near the ground ends at once, not gently
            steer_height(control_state, estimate, gains, 0.0 if control_state.braking else -sink)
        elif control_state.braking:
            brake_height(control_state, estimate, gains)
        else:
            climb = gains.take_off if control_state.mode == TAKE_OFF else gains.climb
            lead_height(control_state, estimate, gains, climb, gains.descent)
    drag = gains.drag
    return (
        control_state.acceleration[0] + drag * control_state.velocity[0],
        control_state.acceleration[1] + drag * control_state.velocity[1],
        control_state.acceleration[2],
    )


@inner_kernel
def _end_what_ended(
    control_state: Any, estimate: Any, gains: Any, paths: Any, step: int, dt: float
) -> None:
    """Ends modes by timeouts, completed trajectories and reached positions."""
    following = control_state.mode == TRAJECTORY and control_state.path_last >= 0
    if following:
        if path_is_flown(control_state, paths, step, dt):
            control_state.mode = HOLD
    elif control_state.mode in (VELOCITY, TRAJECTORY) and step >= control_state.deadline_step:
        control_state.mode = HOLD
        control_state.braking = True
    if control_state.mode in (VELOCITY, TRAJECTORY):
        return
    if control_state.turning:  # stop at the present heading
        control_state.turning = False
        control_state.heading_target[0], control_state.heading_target[1] = (
            control_state.heading[0],
            control_state.heading[1],
        )
    vx, vy, vz = three(estimate.velocity_map)
    landing = control_state.mode == LAND
    slow = vx * vx + vy * vy + (0.0 if landing else vz * vz)
    overdue = landing and step >= control_state.deadline_step
    if control_state.braking and (slow < _STOPPED_M_S**2 or overdue):
        _lock_position(control_state, estimate, gains)
    elif not control_state.braking:
        _change_mode(control_state, estimate)


@inner_kernel
def wanted_velocity(control_state: Any, estimate: Any, gains: Any) -> tuple[float, float, float]:
    """Returns the commanded velocity (m/s, map), within the airframe's limits."""
    tx, ty, tz = three(control_state.velocity_target)
    if control_state.velocity_in_heading:
        c, s = heading_of(estimate)
        tx, ty = c * tx - s * ty, s * tx + c * ty
    size = math.sqrt(tx * tx + ty * ty)
    if size > gains.speed:
        tx *= gains.speed / size
        ty *= gains.speed / size
    return tx, ty, min(max(tz, -gains.descent), gains.climb)


@inner_kernel
def _lock_position(control_state: Any, estimate: Any, gains: Any) -> None:
    """Sets the position target to the point at which the UAV will come to rest."""
    control_state.braking = False
    for k in range(3):
        offset = estimate.velocity_map[k] / gains.ease
        control_state.position_target[k] = estimate.position_map[k] + offset
    if control_state.mode == RETURN:
        control_state.position_target[2] = control_state.return_height


@inner_kernel
def _change_mode(control_state: Any, estimate: Any) -> None:
    """Ends completed modes: TAKE_OFF and GO_TO hold, RETURN enters its next phase."""
    dx = control_state.position_target[0] - estimate.position_map[0]
    dy = control_state.position_target[1] - estimate.position_map[1]
    dz = control_state.position_target[2] - estimate.position_map[2]
    vx, vy, vz = three(estimate.velocity_map)
    near = dx * dx + dy * dy + dz * dz < _ARRIVED_M**2
    slow = vx * vx + vy * vy + vz * vz < _ARRIVED_M_S**2
    if not (near and slow):
        return
    if control_state.mode in (TAKE_OFF, GO_TO):
        control_state.mode = HOLD
    elif control_state.mode == RETURN:
        if control_state.phase == CLIMBING:
            control_state.phase = CROSSING
            control_state.position_target[0] = control_state.home[0]
            control_state.position_target[1] = control_state.home[1]
        elif control_state.phase == CROSSING:
            control_state.phase = DESCENDING
            control_state.position_target[2] = min(
                control_state.position_target[2], control_state.home[2] + _RETURN_LOW_M
            )
        else:
            control_state.mode = LAND
            control_state.calm_ticks = 0


@inner_kernel
def _settle(control_state: Any, gains: Any) -> None:
    """Levels the UAV while the ground supports it.

    The shock of the touch-down causes errors of a metre per second in the estimated velocity, and a
    UAV that tilts against them tips over.
    """
    if control_state.thrust < _CARRIED_THRUST * gains.weight:
        half = 0.5 * math.atan2(control_state.heading[1], control_state.heading[0])
        control_state.attitude[0] = control_state.attitude[1] = 0.0
        control_state.attitude[2], control_state.attitude[3] = math.sin(half), math.cos(half)


@inner_kernel
def _feel_ground(control_state: Any, gains: Any, vz: float) -> None:
    """Stops the rotors once the ground has supported part of the weight for a while."""
    carried = control_state.thrust < _GROUND_THRUST * gains.weight and abs(vz) < _GROUND_M_S
    if carried:
        control_state.calm_ticks += _SURE
    elif control_state.thrust < _FALLING_THRUST * gains.weight:
        control_state.calm_ticks += _LIKELY
    else:
        control_state.calm_ticks = 0
    if control_state.calm_ticks * gains.tick >= _SURE * _GROUND_S:
        stop(control_state)
        control_state.mode = LANDED


@inner_kernel
def stop(control_state: Any) -> None:
    """Stops the rotors and resets the controllers."""
    control_state.level = _STOPPED
    control_state.thrust = 0.0
    control_state.yaw_rate = 0.0
    control_state.calm_ticks = 0
    control_state.braking = False
    for k in range(3):
        control_state.velocity[k] = 0.0
        control_state.acceleration[k] = 0.0
        control_state.velocity_integral[k] = 0.0
        control_state.rates[k] = 0.0
        control_state.rate_integral[k] = 0.0
