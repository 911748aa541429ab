"""The table of the distinct models of a fleet, as the compiled step reads it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.control.gains import gains_of
from volery.control.step import MODEL
from volery.vehicle.aerodynamics import plant_of
from volery.vehicle.airframe import Airframe


def model_table(airframes: Sequence[Airframe], dt: float) -> tuple[NDArray[np.void], list[int]]:
    """Distinct airframes as `MODEL` rows, and each UAV's row."""
    kinds: dict[str, int] = {}
    distinct: list[Airframe] = []
    rows = []
    for airframe in airframes:
        key = airframe.model_dump_json()
        if key not in kinds:
            kinds[key] = len(distinct)
            distinct.append(airframe)
        rows.append(kinds[key])
    models = np.zeros(len(distinct), MODEL)
    for row, airframe in enumerate(distinct):
        models["plant"][row] = plant_of(airframe, dt)[0]
        models["gains"][row] = gains_of(airframe, dt)[0]
    return models, rows
