"""Predefined sets of sensors for any type of UAV."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

from volery.core.data_tables import read_table

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


class _Sensor(Protocol):
    kind: Any


class _TypeWithSensors(Protocol):
    """What the sets need of a `UavType`."""

    @property
    def sensors(self) -> Sequence[_Sensor]: ...


def sets_of(kind: _TypeWithSensors) -> tuple[SensorSet, ...]:
    """Returns the sets that a type of UAV has sensors of."""
    return _sets_with({sensor.kind for sensor in kind.sensors})


def _sets_with(kinds: set[str]) -> tuple[SensorSet, ...]:
    return tuple(name for name in SENSOR_SETS if _SETS[name].kinds & kinds)


def fit(
    sensors: Collection[Mapping[str, Any]], chosen: Collection[SensorSet]
) -> list[dict[str, Any]]:
    """Returns the sensors of a type, as plain data, with the `chosen` sets.

    Sensors of chosen sets remain, and missing chosen sets are added; sensors of other sets are
    removed. Sensors outside all sets remain, and so do those that the type's estimator needs.
    """
    kinds = {sensor["kind"] for sensor in sensors}
    present = set(_sets_with(kinds))
    wanted = set(chosen)
    if "estimate" in kinds:
        wanted |= present & {"navigation"}
    gone = {sensor for name in SENSOR_SETS if name not in wanted for sensor in _SETS[name].kinds}
    remaining = [dict(sensor) for sensor in sensors if sensor["kind"] not in gone]
    new = [
        sensor for name in SENSOR_SETS if name in wanted - present for sensor in _SETS[name].sensors
    ]
    return [*remaining, *new]
