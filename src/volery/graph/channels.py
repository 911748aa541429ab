"""The topics of a sensor: `/UAV/SENSOR` and a suffix, and how their messages are made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from volery.sensors.samples import SensorId


class Channel(NamedTuple):
    """One of the topics of a sensor."""

    suffix: str
    message_class: type[Any]
    message: Callable[[Any, int], Any]
    """(samples, row) -> message, or None where there is nothing to tell."""

    def topic(self, sensor: SensorId) -> str:
        """Name of the topic."""
        return f"/{sensor.uav_name}/{sensor.name}{self.suffix}"
