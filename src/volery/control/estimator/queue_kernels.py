"""Queues of measurements that await the horizon, ordered by time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.vehicle.compiled import fused_kernel, inner_kernel

Rows = NDArray[np.int64]
Records = NDArray[np.void]


@fused_kernel
def enqueue_rows(
    filters: Records,
    tunings: Records,
    queues: Records,
    rows: Rows,
    stamp_ns: int,
    kind: int,
    values: Array,
    variances: Array,
    valid: NDArray[np.bool_],
) -> None:
    """Queues measurements for the horizon, sorted by stamp, then kind.

    values (S, 7), variances (S, 6), valid (S,). Late measurements, and those that find the queue
    full, are counted as dropped.
    """
    for s in range(len(rows)):
        if not valid[s]:
            continue
        state, queue = filters[rows[s]], queues[rows[s]]
        late = stamp_ns < state.reading.stamp_ns - tunings[rows[s]].lateness_ns
        if late or state.waiting_measurements == len(queue):
            state.dropped += 1
            continue
        index = state.waiting_measurements
        first = state.first_measurement
        while index > 0 and _is_later(queue[(first + index - 1) % len(queue)], stamp_ns, kind):
            queue[(first + index) % len(queue)] = queue[(first + index - 1) % len(queue)]
            index -= 1
        entry = queue[(first + index) % len(queue)]
        entry.stamp_ns = stamp_ns
        entry.kind = kind
        for k in range(7):
            entry.value[k] = values[s, k]
        for k in range(6):
            entry.variance[k] = variances[s, k]
        state.waiting_measurements += 1


@inner_kernel
def _is_later(entry: Any, stamp_ns: int, kind: int) -> bool:
    if entry.stamp_ns == stamp_ns:
        return bool(entry.kind > kind)
    return bool(entry.stamp_ns > stamp_ns)
