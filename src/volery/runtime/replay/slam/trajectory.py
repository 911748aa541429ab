"""Computes the trajectory in the map from odometry and the final keyframes."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import DataFileError
from volery.core.whole_files import whole_file

Times = NDArray[np.int64]

_NEAR_NS = 100_000_000
"""Max time between a keyframe and its odometry, ns."""


class EstimatedTrajectory(NamedTuple):
    """Holds poses in the map frame."""

    time_ns: Times
    """Times (N,), ns, as in the log."""
    clock_ns: Times
    """Times (N,), ns, without backward steps of the clock; rising."""
    position: Array
    """Positions (N, 3), m."""
    attitude: Array
    """Attitudes (N, 4), x y z w."""

    @property
    def length_m(self) -> float:
        """Path length over ground, m."""
        return path_length_m(self.position)


def path_length_m(positions: Array) -> float:
    """Returns the path length over ground along positions (N, 2+), m."""
    return float(np.hypot(*np.diff(positions[:, :2], axis=0).T).sum())


def rising(time_ns: Times) -> Times:
    """Returns the times without backward steps."""
    steps = np.diff(time_ns, prepend=time_ns[:1])
    back = np.where(steps < 0, 1_000_000 - steps, 0)
    return np.asarray(time_ns + np.cumsum(back))


def rows_of_keyframes(keyframe_ns: Times, time_ns: Times) -> NDArray[np.int64]:
    """Returns the rows (K,) of the odometry times (N,) that match keyframes; -1: none."""
    rows, at = np.full(len(keyframe_ns), -1, np.int64), 0
    for k, wanted in enumerate(keyframe_ns):
        near = np.flatnonzero(np.abs(time_ns[at:] - wanted) < _NEAR_NS)
        if len(near):
            ends = np.flatnonzero(np.diff(near) > 1)  # of the first pass of the clock
            first = near[: ends[0] + 1] if len(ends) else near
            best = first[np.argmin(np.abs(time_ns[at + first] - wanted))]
            rows[k] = at = at + int(best)
    return rows


def corrected(
    time_ns: Times,
    position: Array,
    attitude: Array,
    keyframe_ns: Times,
    keyframes: Array,
    tilt: Array,
) -> EstimatedTrajectory:
    """Returns the odometry corrected to the keyframes' poses (K, 4): x, y, z, m, yaw, rad, map.

    Between two keyframes the correction is interpolated. `tilt` is the attitude (4,), x y z w, of
    the odometry frame in the map; its heading is irrelevant.
    """
    position, attitude = rotations.rotate(tilt, position), rotations.multiply(tilt, attitude)
    rows = rows_of_keyframes(keyframe_ns, time_ns)
    matched = np.flatnonzero(rows >= 0)
    rows, keyframes = rows[matched], keyframes[matched]
    clock = rising(time_ns)
    if not len(rows):
        return EstimatedTrajectory(time_ns, clock, position, attitude)
    turns = keyframes[:, 3] - rotations.yaw_of(attitude[rows])
    after = np.clip(np.searchsorted(rows, np.arange(len(clock)), side="right"), 1, len(rows))
    one, other = after - 1, np.minimum(after, len(rows) - 1)
    span = np.maximum(clock[rows[other]] - clock[rows[one]], 1)
    fraction = np.clip((clock - clock[rows[one]]) / span, 0.0, 1.0)[:, None]
    laid = [_laid(position, attitude, rows[k], keyframes[k], turns[k]) for k in (one, other)]
    positions = laid[0][0] + fraction * (laid[1][0] - laid[0][0])
    sign = np.where((laid[0][1] * laid[1][1]).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    turned = rotations.normalize((1.0 - fraction) * laid[0][1] + fraction * sign * laid[1][1])
    return EstimatedTrajectory(time_ns, clock, positions, turned)


def _laid(
    position: Array, attitude: Array, rows: NDArray[np.int64], keyframes: Array, turns: Array
) -> tuple[Array, Array]:
    """Returns all poses (N,), each moved rigidly with its keyframe."""
    about = np.zeros((len(turns), 4))
    about[:, 2], about[:, 3] = np.sin(0.5 * turns), np.cos(0.5 * turns)
    moved = rotations.rotate(about, position - position[rows]) + keyframes[:, :3]
    return moved, rotations.multiply(about, attitude)


def write_tum(path: Path, trajectory: EstimatedTrajectory) -> None:
    """Writes the poses as text, one per line: `timestamp x y z qx qy qz qw`, s and m."""
    try:
        with whole_file(path) as file:
            file.write(b"# timestamp x y z qx qy qz qw\n")
            for when, position, turn in zip(
                trajectory.time_ns, trajectory.position, trajectory.attitude, strict=True
            ):
                numbers = " ".join(f"{number:.6f}" for number in (*position, *turn))
                file.write(f"{when // 10**9}.{when % 10**9:09d} {numbers}\n".encode())
    except OSError as error:
        raise DataFileError(f"{path}: the path cannot be written: {error.strerror}") from None
