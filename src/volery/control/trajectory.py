"""Trajectories: polynomial segments over time that the fused step evaluates."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from volery.control.setpoints import MAX_COORDINATE, checked
from volery.control.trajectory_kernels import BEGIN, END, FIRST, ORDER, SEGMENT_COLUMNS
from volery.core.arrays import Array
from volery.core.errors import CommandError

_MAX_SEGMENTS = 100_000
_MAX_DURATION_S = 1e6
_GAP_M = 1e-3
"""Maximum gap between polynomial segments."""


class TrajectoryPoint(NamedTuple):
    """State of a trajectory at one time."""

    position_map: Array
    """(3,) m, map frame."""
    velocity_map: Array
    """(3,) m/s, map frame."""
    acceleration_map: Array
    """(3,) m/s^2, map frame."""
    yaw: float
    """rad; 0 if the trajectory has no headings."""
    yaw_rate: float
    """rad/s."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Polynomial segments of degree up to five, consecutive in time."""

    segments: Array
    """(S, 26): begin and end, s; then six coefficients each, in rising powers of the segment's
    time, of x, y and z, m, in the map, and of yaw, rad."""
    faces: bool
    """Whether the trajectory has headings; otherwise a UAV's heading is unchanged."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Trajectory):
            return NotImplemented
        return self.faces == other.faces and np.array_equal(self.segments, other.segments)

    def __hash__(self) -> int:
        return hash((self.faces, self.segments.tobytes()))

    def __repr__(self) -> str:
        begin_s, end_s = float(self.segments[0, 0]), float(self.segments[-1, 1])
        ends = [self.at(time_s).position_map.tolist() for time_s in (begin_s, end_s)]
        first, last = (", ".join(f"{number:.2f}" for number in end) for end in ends)
        return f"<Trajectory: {begin_s:g} to {end_s:g} s, from ({first}) to ({last}) m>"

    @classmethod
    def from_samples(
        cls,
        times: ArrayLike,
        position: ArrayLike,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        yaw: ArrayLike | None = None,
        yaw_rate: ArrayLike | None = None,
    ) -> Trajectory:
        """Returns an interpolating trajectory of quintic Hermite polynomials.

        Without accelerations they are cubic. times: (K,) s, increasing, K > 1. position: (K, 3) m,
        map; velocity: (K, 3) m/s; acceleration: (K, 3) m/s^2, only with velocities; yaw: (K,) rad,
        turning the shorter arc between samples; yaw_rate: (K,) rad/s, only with yaws. Default
        velocities are those of the parabola through three neighbours, and zero at both ends. Raises
        `CommandError` for other arrays.
        """
        t = _checked_times(times)
        count = len(t)
        p = checked("position", position, (count, 3), MAX_COORDINATE)
        if velocity is None and acceleration is not None:
            raise CommandError("accelerations of a trajectory need velocities as well")
        if yaw is None and yaw_rate is not None:
            raise CommandError("yaw rates of a trajectory need yaws as well")
        v = _slopes(t, p) if velocity is None else checked("velocity", velocity, (count, 3), 1e3)
        a = None
        if acceleration is not None:
            a = checked("acceleration", acceleration, (count, 3), 1e3)
        segments = np.zeros((count - 1, SEGMENT_COLUMNS))
        segments[:, BEGIN], segments[:, END] = t[:-1], t[1:]
        for axis in range(3):
            part = None if a is None else a[:, axis]
            segments[:, _columns(axis)] = _hermite(t, p[:, axis], v[:, axis], part)
        if yaw is not None:
            angle = np.unwrap(checked("yaw", yaw, (count,), 1e4))
            if yaw_rate is None:
                rate = _slopes(t, angle[:, None])[:, 0]
            else:
                rate = checked("yaw rate", yaw_rate, (count,), 100.0)
            segments[:, _columns(3)] = _hermite(t, angle, rate, None)
        return cls(segments, yaw is not None)

    @classmethod
    def from_polynomials(
        cls, durations: ArrayLike, position: ArrayLike, yaw: ArrayLike | None = None
    ) -> Trajectory:
        """Returns a trajectory from coefficients in rising powers of the segment's time.

        durations: (S,) s. position: (S, 3, D) and yaw: (S, D) with D up to 6. Raises `CommandError`
        for other arrays, or if a segment does not begin where the previous one ends.
        """
        ends = np.cumsum(np.atleast_1d(np.asarray(durations, dtype=np.float64)))
        t = _checked_times(np.concatenate([[0.0], ends]))
        segments = np.zeros((len(t) - 1, SEGMENT_COLUMNS))
        segments[:, BEGIN], segments[:, END] = t[:-1], t[1:]
        p = np.asarray(position, dtype=np.float64)
        if p.ndim != 3 or p.shape[:2] != (len(segments), 3) or not 1 <= p.shape[2] <= ORDER:
            raise CommandError(
                f"polynomials must have shape ({len(segments)}, 3, 1 to {ORDER}), not {p.shape}"
            )
        for axis in range(3):
            first = FIRST + ORDER * axis
            segments[:, first : first + p.shape[2]] = p[:, axis]
        if yaw is not None:
            y = np.asarray(yaw, dtype=np.float64)
            if y.ndim != 2 or len(y) != len(segments) or not 1 <= y.shape[1] <= ORDER:
                raise CommandError(
                    f"yaw polynomials must have shape ({len(segments)}, 1 to {ORDER}), "
                    f"not {y.shape}"
                )
            segments[:, FIRST + 3 * ORDER : FIRST + 3 * ORDER + y.shape[1]] = y
        if not np.isfinite(segments).all():
            raise CommandError("polynomials of a trajectory must be finite")
        made = cls(segments, yaw is not None)
        made._check_joints()
        return made

    @property
    def begin_s(self) -> float:
        """Time of the first sample, s."""
        return float(self.segments[0, BEGIN])

    @property
    def end_s(self) -> float:
        """Time of the last sample, s."""
        return float(self.segments[-1, END])

    def at(self, time: float) -> TrajectoryPoint:
        """Returns the point at `time` s, limited to the times of first and last sample."""
        row = bisect_right(self.segments[:, BEGIN], time) - 1
        return self._in_segment(max(row, 0), min(max(time, self.begin_s), self.end_s))

    def led_in_from(self, position: Array, velocity: Array, yaw: float) -> Trajectory:
        """Returns the trajectory with a leading segment from a motion at time 0.

        position: (3,) m, map; velocity: (3,) m/s, map; yaw: rad.
        """
        if self.begin_s <= 0.0:
            return self
        first = self.at(self.begin_s)
        lead = Trajectory.from_samples(
            [0.0, self.begin_s],
            [position, first.position_map],
            [velocity, first.velocity_map],
            [np.zeros(3), first.acceleration_map],
            [yaw, yaw + math.remainder(first.yaw - yaw, 2.0 * math.pi)] if self.faces else None,
            [0.0, first.yaw_rate] if self.faces else None,
        )
        return Trajectory(np.vstack([lead.segments, self.segments]), self.faces)

    def _in_segment(self, row: int, time: float) -> TrajectoryPoint:
        t = time - self.segments[row, BEGIN]
        powers = t ** np.arange(ORDER)
        k = np.arange(1, ORDER)
        c = self.segments[row, FIRST:].reshape(4, ORDER)
        value, slope = c @ powers, (c[:, 1:] * k) @ powers[:-1]
        bend = (c[:, 2:] * (k[1:] * k[:-1])) @ powers[:-2]
        return TrajectoryPoint(value[:3], slope[:3], bend[:3], float(value[3]), float(slope[3]))

    def _check_joints(self) -> None:
        for row in range(1, len(self.segments)):
            time = float(self.segments[row, BEGIN])
            before, after = self._in_segment(row - 1, time), self._in_segment(row, time)
            gap = float(np.linalg.norm(after.position_map - before.position_map))
            if gap > _GAP_M:
                raise CommandError(
                    f"segment {row} of the trajectory begins {gap:.3g} m from the end of the one "
                    "before it"
                )


def _checked_times(times: ArrayLike) -> Array:
    t = np.asarray(times, dtype=np.float64)
    if t.ndim != 1 or not 2 <= len(t) <= _MAX_SEGMENTS + 1:
        raise CommandError(
            f"a trajectory has 2 to {_MAX_SEGMENTS + 1} samples, not {t.size}; a single one is a "
            "trajectory setpoint"
        )
    t = checked("times", t, t.shape, _MAX_DURATION_S)
    if t[0] < 0.0 or (np.diff(t) <= 0.0).any():
        raise CommandError("times of a trajectory must increase and not be negative")
    return t


def _columns(axis: int) -> slice:
    return slice(FIRST + ORDER * axis, FIRST + ORDER * (axis + 1))


def _slopes(t: Array, p: Array) -> Array:
    """Returns slopes (K, D) of samples (K, D): of parabolas through neighbours, zero at ends."""
    v = np.zeros_like(p)
    if len(t) > 2:
        h = np.diff(t)[:, None]
        chord = np.diff(p, axis=0) / h
        v[1:-1] = (h[1:] * chord[:-1] + h[:-1] * chord[1:]) / (h[1:] + h[:-1])
    return v


def _hermite(t: Array, p: Array, v: Array, a: Array | None) -> Array:
    """Returns coefficients (K - 1, 6) of polynomials through samples (K,) and derivatives."""
    h = np.diff(t)
    offset = p[1:] - p[:-1] - h * v[:-1]
    turn = (v[1:] - v[:-1]) * h
    c = np.zeros((len(h), ORDER))
    c[:, 0], c[:, 1] = p[:-1], v[:-1]
    if a is None:
        c[:, 2] = (3.0 * offset - turn) / h**2
        c[:, 3] = (turn - 2.0 * offset) / h**3
        return c
    bend, left = 0.5 * a[:-1] * h**2, 0.5 * a[1:] * h**2
    offset, turn = offset - bend, turn - 2.0 * bend
    left = left - bend
    c[:, 2] = 0.5 * a[:-1]
    c[:, 3] = (10.0 * offset - 4.0 * turn + left) / h**3
    c[:, 4] = (-15.0 * offset + 7.0 * turn - 2.0 * left) / h**4
    c[:, 5] = (6.0 * offset - 3.0 * turn + left) / h**5
    return c
