"""Ready-made sets of sensors that any type of UAV can be given."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal, get_args

from volery.scenario.schema import UavType

SensorSet = Literal["lidar", "camera", "sonar", "navigation"]
SENSOR_SETS: tuple[SensorSet, ...] = get_args(SensorSet)


@dataclass(frozen=True)
class _Set:
    """Sensors as plain data, and what they are."""

    description: str
    sensors: tuple[dict[str, Any], ...]

    @property
    def kinds(self) -> set[str]:
        """Kinds of its sensors."""
        return {sensor["kind"] for sensor in self.sensors}


# Places are those of the shipped scenarios on an F450: a level scanner on top, the others below.
_SETS: dict[SensorSet, _Set] = {
    "lidar": _Set(
        "a horizontal and a nodding UTM-30LX LIDAR",
        (
            {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
            {
                "kind": "lidar",
                "name": "nodding",
                "position_m": [0.10, 0.0, -0.08],
                "nodding": {"amplitude_deg": 45.0, "period_s": 1.0},
            },
        ),
    ),
    "camera": _Set(
        "a camera that looks ahead, colour and depth, 320 x 240 at 10 Hz",
        (
            {
                "kind": "camera",
                "name": "camera",
                "position_m": [0.12, 0.0, 0.06],
                "width": 320,
                "height": 240,
            },
        ),
    ),
    "sonar": _Set(
        "a sonar that looks down",
        ({"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]},),
    ),
    "navigation": _Set(
        "satellite navigation, barometer and magnetometer",
        ({"kind": "gnss"}, {"kind": "barometer"}, {"kind": "magnetometer"}),
    ),
}


def describe(name: SensorSet) -> str:
    """What is in a set."""
    return _SETS[name].description


def sets_of(kind: UavType) -> tuple[SensorSet, ...]:
    """The sets of which a type of UAV has something."""
    present = {sensor.kind for sensor in kind.sensors}
    return tuple(name for name in SENSOR_SETS if _SETS[name].kinds & present)


def fit(kind: UavType, data: dict[str, Any], chosen: Collection[SensorSet]) -> list[dict[str, Any]]:
    """The sensors, as plain data, of a type given as `kind` and as `data`, with the `chosen` sets.

    Of a chosen set it keeps what it has and gets what it lacks altogether; of the others it loses
    everything. What belongs to no set stays, and so does what its estimator lives on.
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
