"""Flight modes: what a UAV does on its own between two commands.

They run at guidance ticks inside the compiled step and count in steps, so that what happens does
not depend on how a run is sliced. ROS services and MAVLink ask for the same modes.

    LANDED --take_off--> TAKE_OFF --arrived--> HOLD
    any flying mode --command--> GO_TO --arrived--> HOLD
                                 VELOCITY --no command for a while--> HOLD
                                 RETURN --climbed, over home, low--> LAND --on the ground--> LANDED
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

from volery.control.setpoints import ControlLevel
from volery.control.velocity_position import (
    heading_of,
    track_velocity,
    turn_heading,
    velocity_towards,
)
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rigid import three


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


LANDED = int(FlightMode.LANDED)
TAKE_OFF = int(FlightMode.TAKE_OFF)
HOLD = int(FlightMode.HOLD)
GO_TO = int(FlightMode.GO_TO)
VELOCITY = int(FlightMode.VELOCITY)
LAND = int(FlightMode.LAND)
RETURN = int(FlightMode.RETURN)
LOW_LEVEL = int(FlightMode.LOW_LEVEL)
CRASHED = int(FlightMode.CRASHED)

_STOPPED = int(ControlLevel.STOPPED)
_GUIDED = int(ControlLevel.GUIDED)

_ARRIVED_M = 0.25
_ARRIVED_M_S = 0.4
_STOPPED_M_S = 0.3
"""Speed below which braking ends and the place is locked."""
_RETURN_LOW_M = 3.0
"""Height above home at which a return becomes a landing."""
_GROUND_THRUST = 0.8
"""Share of the weight: less thrust than this without sinking means that the ground carries ..."""
_GROUND_M_S = 0.15
_GROUND_S = 0.3
"""... when it lasts so long."""

CLIMBING, CROSSING, DESCENDING = 0, 1, 2


@inner_kernel
def guide(pilot: Any, estimate: Any, gains: Any, step: int) -> None:
    """One guidance tick of a `PILOT`: mode changes, then velocity, attitude and thrust setpoints.

    estimate: a record with `position_map`, `velocity_map`, `attitude`. step: the physics step that
    begins now, for time-outs.
    """
    if pilot.level != _GUIDED:
        return
    if pilot.mode == VELOCITY and step >= pilot.deadline_step:
        pilot.mode = HOLD
        pilot.braking = True
    vx, vy, vz = three(estimate.velocity_map)
    if pilot.mode != VELOCITY:
        pilot.turning = False
        slow = vx * vx + vy * vy + (0.0 if pilot.mode == LAND else vz * vz)
        if pilot.braking and slow < _STOPPED_M_S**2:
            _lock_place(pilot, estimate)
        elif not pilot.braking:
            _change_mode(pilot, estimate)
    turn_heading(pilot, estimate, gains)

    tx = ty = tz = 0.0
    if pilot.mode == VELOCITY:
        tx, ty, tz = three(pilot.velocity_target)
        if pilot.velocity_in_heading:
            c, s = heading_of(estimate)
            tx, ty = c * tx - s * ty, s * tx + c * ty
        size = math.sqrt(tx * tx + ty * ty)
        if size > gains.speed:
            tx *= gains.speed / size
            ty *= gains.speed / size
        tz = min(max(tz, -gains.descent), gains.climb)
    elif not pilot.braking:
        climb = gains.take_off if pilot.mode == TAKE_OFF else gains.climb
        tx, ty, tz = velocity_towards(pilot, estimate, gains, gains.speed, climb, gains.descent)
    if pilot.mode == LAND:
        tz = -gains.landing
    track_velocity(pilot, estimate, gains, tx, ty, tz)
    if pilot.mode == LAND:
        _feel_ground(pilot, gains, vz)


@inner_kernel
def _lock_place(pilot: Any, estimate: Any) -> None:
    pilot.braking = False
    for k in range(3):
        pilot.position_target[k] = estimate.position_map[k]
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
def _feel_ground(pilot: Any, gains: Any, vz: float) -> None:
    """Stop the rotors once the ground has carried part of the weight for a while."""
    carried = pilot.thrust < _GROUND_THRUST * gains.weight and abs(vz) < _GROUND_M_S
    pilot.calm_ticks = pilot.calm_ticks + 1 if carried else 0
    if pilot.calm_ticks * gains.tick >= _GROUND_S:
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
        pilot.velocity_integral[k] = 0.0
        pilot.rates[k] = 0.0
        pilot.rate_integral[k] = 0.0
