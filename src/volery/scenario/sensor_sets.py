"""Predefined sets of sensors for any type of UAV."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal, get_args

from volery.core.data_tables import read_table
from volery.scenario.schema import UavType

SensorSet = Literal["lidar", "camera", "sonar", "navigation"]
SENSOR_SETS: tuple[SensorSet, ...] = get_args(SensorSet)


@dataclass(frozen=True)
class _Set:
    """Sensors as plain data, with a description."""

    description: str
    sensors: tuple[dict[str, Any], ...]

    @property
    def kinds(self) -> set[str]:
        """Kinds of the sensors."""
        return {sensor["kind"] for sensor in self.sensors}


_SETS = {
    name: _Set(row["description"], tuple(row["sensors"]))
    for name, row in read_table(__file__, "sensor_sets.toml").items()
}


def describe(name: SensorSet) -> str:
    """Returns the description of a set."""
    return _SETS[name].description


def sets_of(kind: UavType) -> tuple[SensorSet, ...]:
    """Returns the sets that a type of UAV has sensors of."""
    present = {sensor.kind for sensor in kind.sensors}
    return tuple(name for name in SENSOR_SETS if _SETS[name].kinds & present)


def fit(kind: UavType, data: dict[str, Any], chosen: Collection[SensorSet]) -> list[dict[str, Any]]:
    """Returns the sensors of a type, as plain data, with the `chosen` sets.

    The type is given as `kind` and as `data`. Sensors of chosen sets remain, and missing chosen
    sets are added; sensors of other sets are removed. Sensors outside all sets remain, and so do
    those that the type's estimator needs.
    """
    present = set(sets_of(kind))
    wanted = set(chosen)
    if any(sensor.kind == "estimate" for sensor in kind.sensors):
        wanted |= present & {"navigation"}
    gone = {sensor for name in SENSOR_SETS if name not in wanted for sensor in _SETS[name].kinds}
    kept = [dict(sensor) for sensor in data.get("sensors", ()) if sensor["kind"] not in gone]
    new = [
        sensor for name in SENSOR_SETS if name in wanted - present for sensor in _SETS[name].sensors
    ]
    return [*kept, *new]
