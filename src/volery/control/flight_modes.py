"""Flight modes: what a UAV does on its own between two commands.

They run at guidance ticks inside the compiled step and count in steps, so that what happens does
not depend on how a run is sliced. ROS services and MAVLink ask for the same modes.

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
    """What a UAV is doing."""

    LANDED = 0
    """Stands with its rotors stopped, waits for a take-off."""
    TAKE_OFF = 1
    """Climbs straight up to a height over its starting place."""
    HOLD = 2
    """Stops and stays where it is."""
    GO_TO = 3
    """Flies to a position and holds there."""
    VELOCITY = 4
    """Follows velocity commands; holds when they cease."""
    LAND = 5
    """Descends until the ground carries it, then stops its rotors."""
    RETURN = 6
    """Climbs, flies to where it took off, lands there."""
    LOW_LEVEL = 7
    """Follows rotor speeds, body rates or attitudes given from outside; has no time-out."""
    CRASHED = 8
    """Hit something; rotors stopped for good."""
    TRAJECTORY = 9
    """Follows a trajectory, or trajectory setpoints; holds when it is flown or when they cease."""


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
"""Speed below which braking ends and the place is locked."""
_RETURN_LOW_M = 3.0
"""Height above home at which a return becomes a landing."""
_CARRIED_THRUST, _FALLING_THRUST = 0.7, 0.5
"""Shares of the weight: with less thrust than the first a UAV that lands is carried by the ground,
with less than the second it would fall."""
_GROUND_THRUST = 0.8
"""Share of the weight: less thrust than this without sinking means that the ground carries ..."""
_GROUND_M_S = 0.15
_GROUND_S, _SURE, _LIKELY = 0.3, 10, 3
"""... when it lasts so long. Thrust with which it would fall counts three tenths of that, whatever
the estimate of its speed."""

CLIMBING, CROSSING, DESCENDING = 0, 1, 2


@apart_kernel
def guide(pilot: Any, estimate: Any, gains: Any, paths: Any, step: int, dt: float) -> None:
    """One guidance tick of a `PILOT`: mode changes, the reference, attitude and thrust setpoints.

    estimate: a record with `position_map`, `velocity_map`, `attitude`. paths: the segments of all
    trajectories. step: the physics step that begins now, for times.
    """
    if pilot.level != _GUIDED:
        return
    move_on(pilot, gains)
    fx, fy, fz = plan(pilot, estimate, gains, paths, step, dt)
    by_velocity = pilot.mode == VELOCITY or pilot.braking
    track(
        pilot, estimate, gains, not by_velocity, not (by_velocity or pilot.mode == LAND), fx, fy, fz
    )
    if pilot.mode == LAND:
        _settle(pilot, gains)
        _feel_ground(pilot, gains, estimate.velocity_map[2])


@inner_kernel
def plan(
    pilot: Any, estimate: Any, gains: Any, paths: Any, step: int, dt: float
) -> tuple[float, float, float]:
    """Change modes and choose how the reference moves; the acceleration to feed forward.

    The reference is that of this tick already.
    """
    _end_what_ended(pilot, estimate, gains, paths, step, dt)
    if pilot.mode == TRAJECTORY:
        if pilot.path_last >= 0:
            rate, fx, fy, fz = follow_path(pilot, gains, paths, step, dt)
        else:
            rate, fx, fy, fz = follow_setpoint(pilot, gains, step, dt)
        turn_heading(pilot, estimate, gains, rate)
        return fx, fy, fz
    turn_heading(pilot, estimate, gains, 0.0)
    if pilot.mode == VELOCITY:
        tx, ty, tz = wanted_velocity(pilot, estimate, gains)
        steer_level(pilot, estimate, gains, tx, ty)
        steer_height(pilot, estimate, gains, tz)
    else:
        if pilot.braking:
            brake_level(pilot, estimate, gains)
        else:
            lead_level(pilot, estimate, gains, gains.speed)
        if pilot.mode == LAND:
            sink = pilot.sink if pilot.sink > 0.0 else gains.landing
            steer_height(pilot, estimate, gains, -sink)
        elif pilot.braking:
            brake_height(pilot, estimate, gains)
        else:
            climb = gains.take_off if pilot.mode == TAKE_OFF else gains.climb
            lead_height(pilot, estimate, gains, climb, gains.descent)
    drag = gains.drag
    return (
        pilot.acceleration[0] + drag * pilot.velocity[0],
        pilot.acceleration[1] + drag * pilot.velocity[1],
        pilot.acceleration[2],
    )


@inner_kernel
def _end_what_ended(
    pilot: Any, estimate: Any, gains: Any, paths: Any, step: int, dt: float
) -> None:
    """Time-outs, trajectories that are flown, places that are reached."""
    following = pilot.mode == TRAJECTORY and pilot.path_last >= 0
    if following:
        if path_is_flown(pilot, paths, step, dt):
            pilot.mode = HOLD
    elif pilot.mode in (VELOCITY, TRAJECTORY) and step >= pilot.deadline_step:
        pilot.mode = HOLD
        pilot.braking = True
    if pilot.mode in (VELOCITY, TRAJECTORY):
        return
    if pilot.turning:  # stop where it looks
        pilot.turning = False
        pilot.heading_target[0], pilot.heading_target[1] = pilot.heading[0], pilot.heading[1]
    vx, vy, vz = three(estimate.velocity_map)
    slow = vx * vx + vy * vy + (0.0 if pilot.mode == LAND else vz * vz)
    if pilot.braking and slow < _STOPPED_M_S**2:
        _lock_place(pilot, estimate, gains)
    elif not pilot.braking:
        _change_mode(pilot, estimate)


@inner_kernel
def wanted_velocity(pilot: Any, estimate: Any, gains: Any) -> tuple[float, float, float]:
    """The velocity commanded (m/s, map), within the airframe's limits."""
    tx, ty, tz = three(pilot.velocity_target)
    if pilot.velocity_in_heading:
        c, s = heading_of(estimate)
        tx, ty = c * tx - s * ty, s * tx + c * ty
    size = math.sqrt(tx * tx + ty * ty)
    if size > gains.speed:
        tx *= gains.speed / size
        ty *= gains.speed / size
    return tx, ty, min(max(tz, -gains.descent), gains.climb)


@inner_kernel
def _lock_place(pilot: Any, estimate: Any, gains: Any) -> None:
    """Hold the place at which it will come to rest."""
    pilot.braking = False
    for k in range(3):
        way = estimate.velocity_map[k] / gains.ease
        pilot.position_target[k] = estimate.position_map[k] + way
    if pilot.mode == RETURN:
        pilot.position_target[2] = pilot.return_height


@inner_kernel
def _change_mode(pilot: Any, estimate: Any) -> None:
    """End what has arrived: TAKE_OFF and GO_TO hold, RETURN goes on to its next phase."""
    dx = pilot.position_target[0] - estimate.position_map[0]
    dy = pilot.position_target[1] - estimate.position_map[1]
    dz = pilot.position_target[2] - estimate.position_map[2]
    vx, vy, vz = three(estimate.velocity_map)
    near = dx * dx + dy * dy + dz * dz < _ARRIVED_M**2
    slow = vx * vx + vy * vy + vz * vz < _ARRIVED_M_S**2
    if not (near and slow):
        return
    if pilot.mode in (TAKE_OFF, GO_TO):
        pilot.mode = HOLD
    elif pilot.mode == RETURN:
        if pilot.phase == CLIMBING:
            pilot.phase = CROSSING
            pilot.position_target[0] = pilot.home[0]
            pilot.position_target[1] = pilot.home[1]
        elif pilot.phase == CROSSING:
            pilot.phase = DESCENDING
            pilot.position_target[2] = min(pilot.position_target[2], pilot.home[2] + _RETURN_LOW_M)
        else:
            pilot.mode = LAND
            pilot.calm_ticks = 0


@inner_kernel
def _settle(pilot: Any, gains: Any) -> None:
    """Stay level while the ground carries it.

    The shock of the touch-down leaves estimates of the speed off by a metre a second, and who leans
    against that tips over.
    """
    if pilot.thrust < _CARRIED_THRUST * gains.weight:
        half = 0.5 * math.atan2(pilot.heading[1], pilot.heading[0])
        pilot.attitude[0] = pilot.attitude[1] = 0.0
        pilot.attitude[2], pilot.attitude[3] = math.sin(half), math.cos(half)


@inner_kernel
def _feel_ground(pilot: Any, gains: Any, vz: float) -> None:
    """Stop the rotors once the ground has carried part of the weight for a while."""
    carried = pilot.thrust < _GROUND_THRUST * gains.weight and abs(vz) < _GROUND_M_S
    if carried:
        pilot.calm_ticks += _SURE
    elif pilot.thrust < _FALLING_THRUST * gains.weight:
        pilot.calm_ticks += _LIKELY
    else:
        pilot.calm_ticks = 0
    if pilot.calm_ticks * gains.tick >= _SURE * _GROUND_S:
        stop(pilot)
        pilot.mode = LANDED


@inner_kernel
def stop(pilot: Any) -> None:
    """Rotors off, controllers at rest."""
    pilot.level = _STOPPED
    pilot.thrust = 0.0
    pilot.yaw_rate = 0.0
    pilot.calm_ticks = 0
    pilot.braking = False
    for k in range(3):
        pilot.velocity[k] = 0.0
        pilot.acceleration[k] = 0.0
        pilot.velocity_integral[k] = 0.0
        pilot.rates[k] = 0.0
        pilot.rate_integral[k] = 0.0
