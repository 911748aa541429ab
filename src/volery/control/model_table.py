"""The table of the distinct models of a fleet, as the compiled step reads it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.control.gains import gains_of
from volery.control.step import MODEL
from volery.vehicle.aerodynamics import plant_of
from volery.vehicle.airframe import Airframe
from volery.vehicle.identified import REFERENCE_COLUMNS, IdentifiedModel, identified_row
from volery.vehicle.kinematic import Kinematic, kinematic_row
from volery.vehicle.plants import IDENTIFIED_LOOPS, Plant, kind_of

Array = NDArray[np.float64]


def model_table(
    airframes: Sequence[Airframe], plants: Sequence[Plant], dt: float
) -> tuple[NDArray[np.void], list[int]]:
    """Distinct pairs of airframe and plant as `MODEL` rows, and each UAV's row."""
    numbers: dict[tuple[str, Plant], int] = {}
    distinct: list[tuple[Airframe, Plant]] = []
    rows = []
    for airframe, plant in zip(airframes, plants, strict=True):
        key = (airframe.model_dump_json(), plant)
        if key not in numbers:
            numbers[key] = len(distinct)
            distinct.append((airframe, plant))
        rows.append(numbers[key])
    models = np.zeros(len(distinct), MODEL)
    for row, (airframe, plant) in enumerate(distinct):
        models["plant"][row] = plant_of(airframe, dt)[0]
        models["gains"][row] = gains_of(airframe, dt)[0]
        models["kind"][row] = kind_of(plant)
        if isinstance(plant, IdentifiedModel):
            models["identified"][row] = identified_row(plant, airframe, dt)[0]
        elif isinstance(plant, Kinematic):
            models["kinematic"][row] = kinematic_row(plant, airframe, dt)[0]
    return models, rows


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
