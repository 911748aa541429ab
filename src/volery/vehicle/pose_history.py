"""The latest poses of every UAV, for sensors that need past poses.

A ring buffer: row `k % H` is the pose after physics step k, at time `k * dt_ns`; row 0 of a new
history is the initial state. A LIDAR sweep of 18.75 ms reads about 20 rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.compiled import inline_kernel

KEPT_NS = 128_000_000
"""Duration of the history, ns: more than a turn of a 10 Hz scanner."""
MIN_LENGTH = 64


class PoseHistory(NamedTuple):
    """Poses of N UAVs after the last H physics steps; plain arrays for kernels."""

    position: NDArray[np.float64]
    """(H, N, 3) m, map."""
    attitude: NDArray[np.float64]
    """(H, N, 4) unit quaternions, map from body."""
    dt_ns: int
    """Physics step, ns."""


def new_history(position: ArrayLike, attitude: ArrayLike, dt_ns: int) -> PoseHistory:
    """Returns the history of a fleet at rest at `position` (N, 3) m, `attitude` (N, 4)."""
    length = max(MIN_LENGTH, -(-KEPT_NS // dt_ns))
    p = np.asarray(position, dtype=np.float64)
    q = np.asarray(attitude, dtype=np.float64)
    return PoseHistory(
        np.ascontiguousarray(np.broadcast_to(p, (length, *p.shape))),
        np.ascontiguousarray(np.broadcast_to(q, (length, *q.shape))),
        int(dt_ns),
    )


@inline_kernel
def record(
    history: PoseHistory, step: int, position: NDArray[np.float64], attitude: NDArray[np.float64]
) -> None:
    """Stores the poses (N, 3), (N, 4) after physics step `step`."""
    row = step % history.position.shape[0]
    for i in range(position.shape[0]):
        for j in range(3):
            history.position[row, i, j] = position[i, j]
        for j in range(4):
            history.attitude[row, i, j] = attitude[i, j]


@inline_kernel
def pose_at(
    history: PoseHistory, uav: int, time_ns: int
) -> tuple[float, float, float, float, float, float, float]:
    """Returns the pose (x, y, z, qx, qy, qz, qw) of one UAV, map frame, at a time in the history.

    Positions are interpolated linearly between two steps, attitudes by the normalized mean, whose
    error against the great arc is below 1e-9 rad for a step of a millisecond.
    """
    length = history.position.shape[0]
    # Floating point is exact here: integer divisions would cost more than all the rest.
    steps = max(time_ns, 0) / history.dt_ns
    step = np.floor(steps)
    f = steps - step
    a = int(step - length * np.floor(step / length))
    b = a if f == 0.0 else (a + 1 if a + 1 < length else 0)
    p, q = history.position, history.attitude
    g = 1.0 - f
    x = g * p[a, uav, 0] + f * p[b, uav, 0]
    y = g * p[a, uav, 1] + f * p[b, uav, 1]
    z = g * p[a, uav, 2] + f * p[b, uav, 2]
    dot = 0.0
    for j in range(4):
        dot += q[a, uav, j] * q[b, uav, j]
    h = -f if dot < 0.0 else f
    qx = g * q[a, uav, 0] + h * q[b, uav, 0]
    qy = g * q[a, uav, 1] + h * q[b, uav, 1]
    qz = g * q[a, uav, 2] + h * q[b, uav, 2]
    qw = g * q[a, uav, 3] + h * q[b, uav, 3]
    n = 1.0 / np.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    return x, y, z, qx * n, qy * n, qz * n, qw * n
