"""Restarts the sensors of some UAVs while those of the others continue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.engine.scheduler import Scheduler
from volery.sensors.bank import Bank, rows_of, uav_rows
from volery.sensors.samples import Samples

if TYPE_CHECKING:
    from volery.engine.engine import SensorBank


class Streams(Protocol):
    """Finds the noise streams of restarted sensors."""

    def of(self, bank: Bank, rows: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Returns the streams (R,) of the sensors `rows` (R,) of a bank."""

    def of_estimates(self, uavs: NDArray[np.int64]) -> Mapping[int, np.uint64]:
        """Returns the streams of the estimates of the UAVs `uavs`, by row of the fleet."""


class NamedStreams:
    """Streams by row of the UAV and name of the sensor."""

    def __init__(self, keys: Mapping[tuple[int, str], np.uint64]) -> None:
        self._keys = keys

    def of(self, bank: Bank, rows: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Returns the streams (R,) of the sensors `rows` (R,) of a bank; 0 without one."""
        sensors = [bank.sensors[row] for row in rows.tolist()]
        return np.array([self._keys.get((s.uav, s.name), 0) for s in sensors], np.uint64)

    def of_estimates(self, uavs: NDArray[np.int64]) -> Mapping[int, np.uint64]:
        """Returns the streams of the estimates of the UAVs `uavs`, by row of the fleet."""
        chosen = set(uavs.tolist())
        return {
            uav: key for (uav, name), key in self._keys.items() if name == "odom" and uav in chosen
        }


def restart_sensors(
    agenda: Scheduler[Any],
    banks: Sequence[SensorBank],
    fleet: Fleet,
    uavs: NDArray[np.int64],
    streams: Streams,
) -> list[tuple[Samples, NDArray[np.int64]]]:
    """Restarts the sensors of `uavs`, after the UAVs themselves.

    A sensor that measures at this instant measures the start state, like a new sensor; returns
    those samples and the new rows in each.
    """
    fresh = []
    for bank in banks:
        rows = rows_of(uav_rows(bank.sensors), uavs)
        if not len(rows):
            continue
        k, measures_now = agenda.next_after(bank, fleet.step)
        if measures_now and bank.lag_ns > 0:  # what has just ended, such as a sweep, began before
            k += 1
        time_ns = bank.schedule.instant_ns(k)
        before = bank.get_state()
        bank.reset(uavs, streams.of(bank, rows), time_ns, k)
        if measures_now and bank.lag_ns == 0:
            samples = bank.sample_rows(rows, k, time_ns, fleet)
            bank.set_state(_with_rows(before, bank.get_state(), rows, len(bank.sensors)))
            fresh.append((samples, rows))
    return fresh


def _with_rows(before: Any, after: Any, rows: NDArray[np.int64], count: int) -> Any:
    """Returns state `before` with `rows`, of `count`, of every array from `after`."""
    if isinstance(after, Mapping):
        return {key: _with_rows(before.get(key), after[key], rows, count) for key in after}
    if before is None or not isinstance(after, np.ndarray) or after.shape[:1] != (count,):
        return after
    mixed = before.copy()
    mixed[rows] = after[rows]
    return mixed
