"""Types of airframe files: a frozen table and the ranges of its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from volery.core.quantities import Quantity
from volery.scenario.base import Bounded

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Vector = tuple[float, float, float]
PositiveVector = tuple[Positive, Positive, Positive]


_BANDWIDTH = Quantity("rad/s", 1e4, 1e-4)


class Table(Bounded):
    """A table of a vehicle's data file."""

    quantities: ClassVar[Mapping[str, Quantity]] = {
        **dict.fromkeys(("m", "radius_m"), Quantity("m", 100.0, 1e-6, {"mm": 1e-3})),
        "rise_time_s": Quantity("s", 10.0, 1e-6, {"ms": 1e-3}),
        "fall_time_s": Quantity("s", 10.0, 1e-6, {"ms": 1e-3}),
        "torque_m": Quantity("m", 10.0, 1e-7, {"mm": 1e-3}),
        "axis": Quantity("", 1e6),
        "zeta": Quantity("", 100.0, 1e-3),
        "epsilon": Quantity("", 1000.0, 1e-3),
        **dict.fromkeys(
            ("rate", "attitude", "yaw", "velocity", "vertical", "position", "wn", "ki"), _BANDWIDTH
        ),
    }
