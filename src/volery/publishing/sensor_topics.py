"""Defines the topics of a sensor, `/UAV/SENSOR` and a suffix, and their messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from volery.sensors.samples import SensorId


class SensorTopic(NamedTuple):
    """A topic of a sensor."""

    suffix: str
    message_class: type[Any]
    message: Callable[[Any, int], Any]
    """Returns the message of (samples, row), or None if the sensor has no value to publish."""

    def name_of(self, sensor: SensorId) -> str:
        """Returns the topic's name for one sensor."""
        return f"/{sensor.uav_name}/{sensor.name}{self.suffix}"
