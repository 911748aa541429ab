"""The table of the distinct models of a fleet, as the compiled step reads it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.control.fused_step import MODEL
from volery.control.gains import ControlRates, gains_of
from volery.control.stability import check_stability
from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.scenario.schema import RotorWear
from volery.vehicle.airframe import Airframe
from volery.vehicle.battery import GUIDANCE_TICKS as BATTERY_TICKS
from volery.vehicle.identified import REFERENCE_COLUMNS, IdentifiedModel, identified_row
from volery.vehicle.kinematic import Kinematic, kinematic_row
from volery.vehicle.plant import plant_of
from volery.vehicle.plant_types import IDENTIFIED_LOOPS, Plant, kind_of

Array = NDArray[np.float64]


def model_table(
    airframes: Sequence[Airframe],
    plants: Sequence[Plant],
    worn: Sequence[tuple[RotorWear, ...]],
    dt: float,
    control: ControlRates,
) -> tuple[NDArray[np.void], list[int]]:
    """Distinct airframes, plants and wears as `MODEL` rows, and each UAV's row.

    Gains are those of the new vehicle: controllers know nothing of wear. Raises `DataFileError`
    where a vehicle's motion cannot be computed with steps of `dt` s.
    """
    numbers: dict[tuple[str, Plant, tuple[RotorWear, ...]], int] = {}
    distinct: list[tuple[Airframe, Plant, tuple[RotorWear, ...]]] = []
    rows = []
    for airframe, plant, wear in zip(airframes, plants, worn, strict=True):
        key = (airframe.model_dump_json(), plant, wear)
        if key not in numbers:
            numbers[key] = len(distinct)
            distinct.append((airframe, plant, wear))
        rows.append(numbers[key])
    models = np.zeros(len(distinct), MODEL)
    period = BATTERY_TICKS * control.guidance_steps(dt) * dt
    for row, (airframe, plant, wear) in enumerate(distinct):
        check_stability(airframe, plant, dt)
        models["plant"][row] = plant_of(airframe, dt, period, wear)[0]
        models["gains"][row] = gains_of(airframe, dt, control)[0]
        models["kind"][row] = kind_of(plant)
        if isinstance(plant, IdentifiedModel):
            models["identified"][row] = identified_row(plant, airframe, dt)[0]
        elif isinstance(plant, Kinematic):
            models["kinematic"][row] = kinematic_row(plant, airframe, dt)[0]
    return models, rows


def checked_wear(
    names: Sequence[str],
    airframes: Sequence[Airframe],
    wear: Sequence[Sequence[RotorWear]] | None,
) -> list[tuple[RotorWear, ...]]:
    """Wear of each UAV's rotors, an empty one where all are new. CommandError if it fits none."""
    worn = [tuple(one) for one in wear or [()] * len(airframes)]
    if len(worn) != len(airframes):
        raise CommandError(f"wear is given for {counted(len(worn), 'UAV')}, not {len(airframes)}")
    for name, airframe, rotors in zip(names, airframes, worn, strict=True):
        if len(rotors) not in (0, len(airframe.rotors.places)):
            raise CommandError(
                f"wear of {name} names {counted(len(rotors), 'rotor')}; {airframe.name} has "
                f"{len(airframe.rotors.places)}"
            )
    return worn


def new_references(models: NDArray[np.void], attitude: Array, thrust: Array) -> Array:
    """Past commands (N, L, 6) of UAVs that have held `attitude` (N, 4) with `thrust` (N,) N.

    As long as the longest dead time needs; of no UAV where no plant has any.
    """
    identified = models["kind"] == IDENTIFIED_LOOPS
    if not identified.any():
        return np.zeros((1, 1, REFERENCE_COLUMNS))
    delays = [models["identified"][name].max() for name in ("attitude_delay", "heave_delay")]
    references = np.zeros((len(attitude), 1 + int(max(delays)), REFERENCE_COLUMNS))
    references[:, :, :4] = attitude[:, None]
    references[:, :, 4] = thrust[:, None]
    return references


def copy_references(past: Array, references: Array, rows: NDArray[np.int64], step: int) -> None:
    """Write commands (K, L, 6) of UAVs up to `step` into `rows` (K,) of another ring's (N, M, 6).

    What the other ring could hold but `past` did not is the oldest that is known.
    """
    length, room = past.shape[1], references.shape[1]
    for ago in range(room):
        known = (step - min(ago, length - 1)) % length
        references[rows, (step - ago) % room] = past[:, known]
