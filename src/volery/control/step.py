"""The fused step: control and plant of all UAVs, for many steps in one call."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.flight_modes import CRASHED, guide, stop
from volery.control.gains import GAINS
from volery.control.rates_attitude import hold_attitude, hold_rates
from volery.control.setpoints import PILOT
from volery.vehicle.battery import GUIDANCE_TICKS as BATTERY_TICKS
from volery.vehicle.battery import drain
from volery.vehicle.compiled import fused_kernel, inner_kernel
from volery.vehicle.contact import IMPACT, NO_TOUCH, SCRATCH_SHAPE
from volery.vehicle.downwash import find_downwash
from volery.vehicle.fleet import BODY
from volery.vehicle.ground_effect import feel_ground, feels_ground
from volery.vehicle.kernels import accelerate, carry, meet_ground, near_ground
from volery.vehicle.plant import PLANT
from volery.world.terrain import TerrainGrid

Array = NDArray[np.float64]

UAV = np.dtype([("body", BODY), ("pilot", PILOT), ("model", "i8"), ("copy", "i8")], align=True)
"""One UAV: its plant, its control, the row of its airframe, and the copy of the scenario that it
flies in; UAVs of different copies never meet."""
MODEL = np.dtype([("plant", PLANT), ("gains", GAINS)], align=True)
"""One airframe."""

EVENT = np.dtype(
    [
        ("step", "i8"),
        ("uav", "i8"),
        ("kind", "i8"),
        ("mode", "i8"),
        ("level", "i8"),
        ("speed", "f8"),
        ("position", "f8", 3),
    ],
    align=True,
)
"""One happening; `kind` is `TOUCH_DOWN`, `IMPACT`, `MODE_CHANGE` or `BATTERY_FELL`."""
MODE_CHANGE = 3
BATTERY_FELL = 4
EVENTS_A_STEP = 4
"""At most, of one UAV."""


@fused_kernel
def advance_fleet(  # noqa: PLR0912, PLR0915
    uavs: NDArray[np.void],
    models: NDArray[np.void],
    jets: NDArray[np.void],
    heights: Array,
    origin_x: float,
    origin_y: float,
    spacing: float,
    steepest: float,
    history_position: Array,
    history_attitude: Array,
    wind_x: float,
    wind_y: float,
    wind_z: float,
    events: NDArray[np.void],
    step: int,
    steps: int,
    guidance_steps: int,
    attitude_steps: int,
    dt: float,
    bounce: bool,
    event_ends: bool,
) -> tuple[int, int, bool]:
    """Move all UAVs on by up to `steps` steps of `dt` s, from step number `step`.

    jets: room of `new_jets` for the search of neighbours. Ends early after a step in which a budget
    ran out, the events' buffer grew full or, with `event_ends`, anything was noted. Returns the
    steps done, the events written, and whether a budget ran out.
    """
    grid = TerrainGrid(heights, origin_x, origin_y, spacing)
    scratch = np.empty(SCRATCH_SHAPE)
    count = uavs.shape[0]
    rows = history_position.shape[0]
    written = 0
    spent = False
    look = True  # whether someone may meet the jet of another since the last look
    done = 0
    room = events.shape[0] - EVENTS_A_STEP * count
    while done < steps and not spent and written <= (0 if event_ends else room):
        guiding = step % guidance_steps == 0
        draining = step % (guidance_steps * BATTERY_TICKS) == 0
        turning = step % attitude_steps == 0
        row = (step + 1) % rows
        if guiding and look:
            find_downwash(uavs, models, jets)
            look = False
        for i in range(count):
            body = uavs[i].body
            pilot = uavs[i].pilot
            plant = models[uavs[i].model].plant
            if guiding:
                air = body.air_velocity_map
                air[0], air[1], air[2] = wind_x, wind_y, wind_z - jets[i].downwash
            if draining and plant.battery.capacity > 0.0 and drain(body, plant, pilot):
                _note(events[written], step + 1, i, BATTERY_FELL, pilot.mode, 0.0, body)
                written += 1
            if body.asleep:
                for k in range(3):
                    body.acceleration_map[k] = body.angular_acceleration_body[k] = 0.0
            else:
                gains = models[uavs[i].model].gains
                estimate = body  # what control knows of the motion: for now, the truth
                mode = pilot.mode
                if guiding:
                    guide(pilot, estimate, gains, step)
                if turning:
                    hold_attitude(pilot, estimate, gains)
                hold_rates(pilot, estimate, gains, dt)
                if feels_ground(body, plant):
                    feel_ground(body, plant, grid, steepest, dt)
                accelerate(body, plant, pilot, dt)
                touch = NO_TOUCH
                if near_ground(body, dt):
                    touch = meet_ground(
                        body, plant, pilot, grid, steepest, bounce, scratch, step + 1, dt
                    )
                carry(body, dt)
                if touch != NO_TOUCH:
                    _note(events[written], step + 1, i, touch, mode, body.touch_speed, body)
                    written += 1
                    if touch == IMPACT and not bounce:
                        body.crashed = True
                        pilot.mode = CRASHED
                        stop(pilot)
                if pilot.mode != mode:
                    _note(events[written], step + 1, i, MODE_CHANGE, pilot.mode, 0.0, body)
                    written += 1
                spent = spent or body.contact_budget <= 0.0 or body.separation_budget <= 0.0
            look = look or body.downwash_budget <= 0.0
            for k in range(3):
                history_position[row, i, k] = body.position_map[k]
            for k in range(4):
                history_attitude[row, i, k] = body.attitude[k]
        step += 1
        done += 1
    return done, written, spent


@inner_kernel
def _note(event: Any, step: int, uav: int, kind: int, mode: int, speed: float, body: Any) -> None:
    event.step = step
    event.uav = uav
    event.kind = kind
    event.mode = mode
    event.level = body.battery_level
    event.speed = speed
    for k in range(3):
        event.position[k] = body.position_map[k]
