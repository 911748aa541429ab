"""Restarts the sensors of some UAVs while those of the others continue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.engine.scheduler import Scheduler
from volery.sensors.bank import Bank
from volery.sensors.samples import Samples

Keys = Mapping[tuple[int, str], np.uint64]
"""Noise streams by row of the UAV and name of the sensor."""


def restart_sensors(
    agenda: Scheduler[Any], banks: Sequence[Bank], fleet: Fleet, uavs: NDArray[np.int64], keys: Keys
) -> list[tuple[Samples, NDArray[np.int64]]]:
    """Restarts the sensors of `uavs`, after the UAVs themselves.

    A sensor that measures at this instant measures the start state, like a new sensor; returns
    those samples and the new rows in each.
    """
    chosen = set(uavs.tolist())
    fresh = []
    for bank in banks:
        rows = np.array([i for i, s in enumerate(bank.sensors) if s.uav in chosen], dtype=np.int64)
        if not len(rows):
            continue
        ids = [bank.sensors[i] for i in rows]
        streams = np.array([keys.get((s.uav, s.name), 0) for s in ids], dtype=np.uint64)
        k, measures_now = agenda.next_after(bank, fleet.step)
        time_ns = bank.schedule.instant_ns(k)
        before = bank.get_state()
        bank.reset(uavs, streams, time_ns, k)
        if measures_now and bank.lag_ns == 0:
            samples = bank.sample(k, time_ns, fleet)
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
