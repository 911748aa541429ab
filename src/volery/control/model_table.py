"""The table of a fleet's distinct models, for the compiled step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.control.fused_step import MODEL
from volery.control.gains import ControlRates, gains_of
from volery.control.stability import check_stability
from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.scenario.schema import RotorWear
from volery.vehicle.airframe import Airframe
from volery.vehicle.battery import GUIDANCE_TICKS as BATTERY_TICKS
from volery.vehicle.identified import REFERENCE_COLUMNS, IdentifiedModel, identified_row
from volery.vehicle.kinematic import Kinematic, kinematic_row
from volery.vehicle.plant import plant_of
from volery.vehicle.plant_types import IDENTIFIED_LOOPS, Plant, kind_of


def model_table(
    airframes: Sequence[Airframe],
    plants: Sequence[Plant],
    worn: Sequence[tuple[RotorWear, ...]],
    dt: float,
    control: ControlRates,
) -> tuple[NDArray[np.void], list[int]]:
    """Returns distinct airframes, plants and wears as `MODEL` rows, and each UAV's row.

    Gains are those of the new vehicle: controllers do not know the wear. Raises `DataFileError` if
    a vehicle's motion cannot be computed with steps of `dt` s.
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
    """Returns the wear of each UAV's rotors, empty if all are new.

    Raises `CommandError` if the numbers of UAVs or rotors do not match.
    """
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
    """Returns past commands (N, L, 6) of UAVs at rest.

    They have held `attitude` (N, 4), map from body, with `thrust` (N,) N. L follows from the
    longest dead time; (1, 1, 6) if no plant has any.
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
    """Writes commands (K, L, 6) of UAVs up to `step` to `rows` (K,) of another ring (N, M, 6).

    Commands older than those in `past` repeat the oldest known one.
    """
    length, room = past.shape[1], references.shape[1]
    for ago in range(room):
        known = (step - min(ago, length - 1)) % length
        references[rows, (step - ago) % room] = past[:, known]
