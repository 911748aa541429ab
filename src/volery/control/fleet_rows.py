"""The rows of a fleet: what it is told, checked, and its UAVs as they begin, or begin anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.estimated_state import new_beliefs
from volery.control.flight_modes import FlightMode
from volery.control.fused_step import UAV
from volery.control.setpoints import checked, new_control_states
from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.vehicle.fleet import NEVER, new_bodies
from volery.vehicle.plant_types import Plant
from volery.world.weather.dryden import new_turbulence

Array = NDArray[np.float64]


def one_each(value: ArrayLike, count: int) -> ArrayLike:
    """One value a UAV, where one stands for all."""
    return value if np.ndim(value) else np.full(count, value)


def checked_modes(mode: FlightMode | Sequence[FlightMode], count: int) -> list[FlightMode]:
    """One mode a UAV, HOLD or LANDED. CommandError for others."""
    modes = [mode] * count if isinstance(mode, FlightMode) else list(mode)
    if len(modes) != count or not set(modes) <= {FlightMode.HOLD, FlightMode.LANDED}:
        raise CommandError("a UAV starts in HOLD or LANDED, one mode for all or one for each")
    return modes


def checked_plants(plants: Plant | Sequence[Plant], count: int) -> tuple[Plant, ...]:
    """One plant a UAV. CommandError where there are more or fewer."""
    plants = tuple(plants) if isinstance(plants, Sequence) else (plants,) * count
    if len(plants) != count:
        raise CommandError(f"{counted(len(plants), 'plant')} for {counted(count, 'UAV')}")
    return plants


def new_uavs(
    position: Array,
    attitude: Array,
    model_rows: Sequence[int],
    copies: ArrayLike,
    seed: int,
    names: Sequence[str],
) -> NDArray[np.void]:
    """Rows (N,) of `step.UAV` that stand still at `position` (N, 3), `attitude` (N, 4).

    They know the truth. model_rows: of each in the table of models. copies: (N,) or one for all.
    seed and names: of the turbulence around them.
    """
    count = len(position)
    uavs = np.zeros(count, UAV)
    uavs["body"] = new_bodies(position, attitude)
    uavs["control_state"] = new_control_states(attitude)
    uavs["model"] = model_rows
    uavs["copy"] = checked("copies", one_each(copies, count), (count,), 2**31)
    uavs["belief"] = new_beliefs(count)
    uavs["turbulence"] = new_turbulence(seed, names)
    return uavs


def begun_anew(start: NDArray[np.void], step: int, air_tick: int) -> NDArray[np.void]:
    """Rows `start` (K,), which are of step 0, as if that had been `step`.

    air_tick: number of the look at the air from which their turbulence begins.
    """
    fresh = start.copy()
    fresh["turbulence"]["first_tick"] = air_tick
    for name in ("deadline_step", "start_step"):
        fresh["control_state"][name] += step
    touched = fresh["body"]["last_contact_step"] > NEVER
    fresh["body"]["last_contact_step"][touched] += step
    return fresh
