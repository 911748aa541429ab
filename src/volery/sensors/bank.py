"""What every bank of sensors offers, and the little that banks share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.clock import Schedule
from volery.sensors.noise import NoiseStreams
from volery.sensors.samples import Samples, SensorId


class Bank(Protocol):
    """All sensors of one kind, model, rate and phase: sampled together.

    Measurements are numbered from k = 0 at the schedule's phase. A bank's result depends on k, time
    and the fleet alone: not on how a run is sliced, nor on which other UAVs fly.
    """

    @property
    def name(self) -> str:
        """Kind of the sensors."""

    @property
    def schedule(self) -> Schedule:
        """When they measure."""

    @property
    def lag_ns(self) -> int:
        """How long after its instant a measurement is known: a LIDAR's sweep, a GNSS's delay."""

    @property
    def sensors(self) -> tuple[SensorId, ...]:
        """Which they are, row by row."""

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> Samples:
        """Measurement number k."""

    def get_state(self) -> dict[str, Any]:
        """Everything that changes, as plain data: arrays and dicts of them, all of them copies."""

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state; the same measurements follow."""

    def reset(
        self,
        uavs: NDArray[np.int64] | None,
        keys: NDArray[np.uint64] | None,
        time_ns: int,
        k: int,
    ) -> None:
        """Put the sensors of some UAVs back to their start, after the fleet has been put back.

        `uavs` are rows of the fleet, None means all. `keys` hold one noise stream for each sensor
        put back, in the order of `sensors`; None keeps the streams, and a bank without noise
        ignores them. From `time_ns` on, with measurement number `k` as their first, the sensors
        measure as those of a fresh bank do from its first measurement. What follows from the clock
        alone, such as the angle of a nodding mount, goes on.
        """


class Memoryless:
    """A bank whose measurements follow from the fleet's state alone: nothing to keep or reset."""

    def get_state(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    def set_state(self, state: dict[str, Any]) -> None:
        """Nothing to go back to."""

    def reset(
        self,
        uavs: NDArray[np.int64] | None,
        keys: NDArray[np.uint64] | None,
        time_ns: int,
        k: int,
    ) -> None:
        """Nothing to put back."""


class NoisyBank:
    """A bank whose sensors have noise streams, and may remember something between measurements.

    `keys` (S,) are the streams, or None for sensors without noise; `NoiseStreams` explains
    `at_start` and `per_measurement`. What the sensors remember is arrays (S, ...), attributes that
    a bank names in `_KEPT` and puts back in `_switch_on`: keeping, restoring and resetting follow.
    """

    _KEPT: ClassVar[tuple[str, ...]] = ()

    def __init__(
        self,
        schedule: Schedule,
        sensors: tuple[SensorId, ...],
        keys: NDArray[np.uint64] | None,
        *,
        at_start: int = 0,
        per_measurement: int = 0,
    ) -> None:
        self.schedule = schedule
        self.sensors = sensors
        self._rows = uav_rows(sensors)
        self._noise = NoiseStreams(
            keys, len(sensors), at_start=at_start, per_measurement=per_measurement
        )

    def _switch_on(self, rows: NDArray[np.int64], time_ns: int) -> None:
        """Put what the sensors `rows` remember back to what it is at their start, `time_ns`."""

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps: noise streams, and copies of what the sensors remember."""
        kept = {name.lstrip("_"): getattr(self, name).copy() for name in self._KEPT}
        return {"noise": self._noise.get_state(), **kept}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        self._noise.set_state(state["noise"])
        for name in self._KEPT:
            setattr(self, name, np.array(state[name.lstrip("_")]))

    def reset(
        self,
        uavs: NDArray[np.int64] | None,
        keys: NDArray[np.uint64] | None,
        time_ns: int,
        k: int,
    ) -> None:
        """Give the sensors of some UAVs fresh noise and switch them on; see `Bank.reset`."""
        rows = rows_of(self._rows, uavs)
        self._noise.restart(rows, keys, k)
        self._switch_on(rows, time_ns)


def uav_rows(sensors: Sequence[SensorId]) -> NDArray[np.int64]:
    """The UAV of each sensor (S,), as rows of the fleet."""
    return np.array([sensor.uav for sensor in sensors], dtype=np.int64)


def rows_of(uav_of_row: NDArray[np.int64], uavs: NDArray[np.int64] | None) -> NDArray[np.int64]:
    """Rows of a bank that belong to `uavs`, in order; all for None."""
    if uavs is None:
        return np.arange(len(uav_of_row))
    return np.flatnonzero(np.isin(uav_of_row, uavs))
