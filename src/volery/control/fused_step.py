"""The fused step: control and plant of all UAVs, for many steps in one call."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.air import feel_rain, refresh_air
from volery.control.estimated_state import (
    BELIEF,
    believe_attitude,
    believe_position,
    believed_rates,
)
from volery.control.flight_modes import CRASHED, guide, stop
from volery.control.gains import GAINS
from volery.control.plant_dispatch import fly_otherwise
from volery.control.rates_attitude import hold_attitude, hold_rates
from volery.control.setpoints import CONTROL_STATE
from volery.core.arrays import Array
from volery.core.compiled import brief_kernel
from volery.vehicle.battery import GUIDANCE_TICKS as BATTERY_TICKS
from volery.vehicle.battery import drain
from volery.vehicle.compiled import fused_kernel, inner_kernel
from volery.vehicle.contact import IMPACT, NO_TOUCH, SCRATCH_SHAPE
from volery.vehicle.downwash import find_downwash
from volery.vehicle.fleet import BODY
from volery.vehicle.ground_effect import feel_ground, feels_ground
from volery.vehicle.identified import IDENTIFIED
from volery.vehicle.kinematic import KINEMATIC
from volery.vehicle.plant import PLANT
from volery.vehicle.plant_types import KINEMATIC_MOTION, RIGID_BODY
from volery.vehicle.rigid_body_kernels import (
    accelerate,
    carry,
    meet_ground,
    near_ground,
    turn_rotors,
)
from volery.vehicle.rotation_math import three
from volery.world.terrain import TerrainGrid
from volery.world.weather.dryden import TURBULENCE

UAV = np.dtype(
    [
        ("body", BODY),
        ("model", "i8"),
        ("copy", "i8"),
        ("control_state", CONTROL_STATE),
        ("belief", BELIEF),
        ("turbulence", TURBULENCE),
    ],
    align=True,
)
"""One UAV: its plant, the row of its model, the copy of the scenario (UAVs of different copies
never meet), its control, its estimated state, the turbulence around it. Fields of every step are
adjacent in the middle: the order matters to the cache."""
MODEL = np.dtype(
    [
        ("plant", PLANT),
        ("gains", GAINS),
        ("identified", IDENTIFIED),
        ("kinematic", KINEMATIC),
        ("kind", "i8"),  # vehicle.plant_types: RIGID_BODY, IDENTIFIED_LOOPS, KINEMATIC_MOTION
    ],
    align=True,
)
"""One airframe with one plant."""

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
"""One event; `kind` is `TOUCH_DOWN`, `IMPACT`, `MODE_CHANGE` or `BATTERY_FELL`."""
MODE_CHANGE = 3
BATTERY_FELL = 4
EVENTS_A_STEP = 4
"""Maximum number of events of one UAV in a step."""
_ACCELERATION_M_S2 = 1000.0


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
    paths: Array,
    references: Array | None,
    air: NDArray[np.void],
    air_nodes: Array,
    events: NDArray[np.void],
    step: int,
    steps: int,
    guidance_steps: int,
    attitude_steps: int,
    air_steps: int,
    dt: float,
    bounce: bool,
    event_ends: bool,
    first: int,
    last: int,
    calm: bool,
    look: bool,
) -> tuple[int, int, bool, bool, bool]:
    """Advances the UAVs first..last-1 by up to `steps` steps of `dt` s, from step number `step`.

    paths: segments of trajectories, see `control.trajectory_kernels`. references: None if all
    plants are rigid bodies: the other plants are then not compiled at all. Otherwise (N, L, 6),
    commands of the last L steps where identified plants have dead times, or of any size. jets:
    memory for the search of neighbours (`new_jets`). air: the weather, one row for all or one for
    each.

    A UAV with a new stop command is guided in the first step, without waiting for a tick. The call
    ends early after a step in which a budget ran out, the event buffer grew full or, with
    `event_ends`, an event occurred, and at a guidance tick if a budget may run out before the next
    one. The air around the UAVs is updated every `air_steps`, a multiple of `guidance_steps`.

    calm: whether nothing can happen to a UAV before the next guidance tick. look: whether a UAV may
    have met another's jet since the last search, which is then repeated for all UAVs. At first, and
    whenever it is not known: False, True. Returns the steps done, the events written, whether a
    budget ran out, calm and look.
    """
    grid = TerrainGrid(heights, origin_x, origin_y, spacing)
    scratch = np.empty(SCRATCH_SHAPE)
    rows = history_position.shape[0]
    written = 0
    spent = False
    done = 0
    room = events.shape[0] - EVENTS_A_STEP * (last - first)
    while done < steps and not spent and written <= (0 if event_ends else room):
        guiding = step % guidance_steps == 0
        draining = step % (guidance_steps * BATTERY_TICKS) == 0
        to_tick = guidance_steps - step % guidance_steps
        # One step for all, or, where UAVs are independent, all steps to the tick for each in turn,
        # while its data are in the nearest cache.
        together = min(to_tick, steps - done) if calm and not guiding else 1
        airing = step % air_steps == 0
        if airing and look:
            find_downwash(uavs, models, jets)
            look = False
        first_row, first_phase = (step + 1) % rows, step % attitude_steps
        calm, near = True, False
        for i in range(first, last):
            row, phase = (
                first_row,
                first_phase,
            )  # counted on: divisions would cost as much as a rotor
            body = uavs[i].body
            control_state = uavs[i].control_state
            belief = uavs[i].belief
            model = models[uavs[i].model]
            plant = model.plant
            if draining and plant.battery.capacity > 0.0 and drain(body, plant, control_state):
                _note(events[written], step + 1, i, BATTERY_FELL, control_state.mode, 0.0, body)
                written += 1
            if guiding:
                turn_rotors(body, plant, guidance_steps * dt)
            if airing and not body.asleep:
                tick, period = step // air_steps, air_steps * dt
                own = air[i if air.shape[0] > 1 else 0]
                refresh_air(uavs[i], jets[i].downwash, own, air_nodes, grid, tick, period)
                if own.rain_water > 0.0 and model.kind != KINEMATIC_MOTION:
                    feel_rain(body, plant, own, period)
            for now in range(step, step + together):
                guided = guiding or control_state.hurried
                control_state.hurried = False
                if body.asleep:
                    for k in range(3):
                        body.acceleration_map[k] = body.angular_acceleration_body[k] = 0.0
                else:
                    mode = control_state.mode
                    if references is None or model.kind == RIGID_BODY:
                        turning = phase == 0 or guided
                        if guided:
                            believe_position(belief, body)
                        if turning:
                            believe_attitude(belief, body, control_state.errs)
                        if guided:
                            guide(control_state, belief, model.gains, paths, now, dt)
                        if turning:
                            hold_attitude(control_state, belief, model.gains)
                        ox, oy, oz = believed_rates(belief, body, control_state.errs)
                        hold_rates(control_state, ox, oy, oz, model.gains, dt)
                        if feels_ground(body, plant):
                            feel_ground(body, plant, grid, steepest, dt)
                        accelerate(body, plant, control_state, dt)
                        touch = NO_TOUCH
                        if near_ground(body, dt):
                            touch = meet_ground(
                                body,
                                plant,
                                control_state,
                                grid,
                                steepest,
                                bounce,
                                scratch,
                                now + 1,
                                dt,
                            )
                        carry(body, dt)
                    else:
                        touch = fly_otherwise(
                            body,
                            control_state,
                            belief,
                            model,
                            references,
                            i,
                            now % references.shape[1],
                            paths,
                            grid,
                            steepest,
                            bounce,
                            scratch,
                            now,
                            guided,
                            dt,
                        )
                    if touch != NO_TOUCH:
                        _note(events[written], now + 1, i, touch, mode, body.touch_speed, body)
                        written += 1
                        if touch == IMPACT and not bounce and model.kind != KINEMATIC_MOTION:
                            body.crashed = True
                            control_state.mode = CRASHED
                            stop(control_state)
                    if control_state.mode != mode:
                        _note(
                            events[written], now + 1, i, MODE_CHANGE, control_state.mode, 0.0, body
                        )
                        written += 1
                for k in range(3):
                    history_position[row, i, k] = body.position_map[k]
                for k in range(4):
                    history_attitude[row, i, k] = body.attitude[k]
                row = row + 1 if row + 1 < rows else 0
                phase = phase + 1 if phase + 1 < attitude_steps else 0
            spent = spent or body.contact_budget <= 0.0 or body.separation_budget <= 0.0
            look = look or body.in_jet or body.downwash_budget <= 0.0
            if not body.asleep:
                distance = travel_m(body.velocity_map, guidance_steps * dt)
                to_others = min(body.contact_budget, body.separation_budget)
                near = near or to_others <= distance
                calm = (
                    calm
                    and model.kind == RIGID_BODY
                    and min(to_others, body.ground_budget) > distance
                )
        step += together
        done += together
        # A look at the gaps of those that are near may spare all others single steps.
        spent = spent or (near and step % guidance_steps == 0)
    return done, written, spent, calm, look


@brief_kernel
def travel_m(velocity: Any, seconds: float) -> float:
    """Returns a safe bound of a UAV's travel in the time between two guidance ticks, m.

    velocity: (3,) m/s now. Twice the distance at this speed, plus that of an acceleration beyond
    any UAV's.
    """
    vx, vy, vz = three(velocity)
    speed = abs(vx) + abs(vy) + abs(vz)
    return 2.0 * speed * seconds + 0.5 * _ACCELERATION_M_S2 * seconds * seconds


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
