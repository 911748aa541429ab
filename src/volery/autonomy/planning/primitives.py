"""Motion primitives that end at rest: accelerate, cruise, brake.

The parts that change the velocity are the minimum-jerk polynomials with free end position of M. W.
Mueller, M. Hehn, R. D'Andrea, "A computationally efficient motion primitive for quadrocopter
trajectory generation", IEEE Transactions on Robotics 31(6), 2015: from (p, v, a) to a velocity
without acceleration. A change of velocity by dv in time T needs 1.5 dv / T at most.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array

_MIN_S = 0.5
"""Shortest change of velocity: the attitude loop cannot follow a shorter one (modelling choice)."""


class PrimitiveState(NamedTuple):
    """Motion at one time, all (3,): m, m/s, m/s^2."""

    position: Array
    velocity: Array
    acceleration: Array


class MotionLimits(NamedTuple):
    """Motion limits of trajectories: m/s and m/s^2."""

    speed: float
    acceleration: float
    climb: float
    climb_acceleration: float
    horizon_s: float
    """Time until braking begins."""


class PrimitiveCandidates(NamedTuple):
    """Primitives from one state: times (C,) s and velocities (C, 3) m/s of the cruise."""

    start: PrimitiveState
    velocity: Array
    offset: Array
    """(C,): height over the flight surface, relative to the wanted one, m."""
    rise_s: Array
    """(C,): duration of the change of velocity."""
    cruise_s: Array
    brake_s: Array

    def path(self, index: int) -> PrimitivePath:
        """Returns one candidate as a trajectory."""
        return PrimitivePath(
            self.start,
            self.velocity[index],
            float(self.rise_s[index]),
            float(self.cruise_s[index]),
            float(self.brake_s[index]),
        )


def change_s(dv: Array, limits: MotionLimits) -> Array:
    """Returns the times (C,) s that changes of velocity `dv` (C, 3) m/s need."""
    level = 1.5 * np.hypot(dv[:, 0], dv[:, 1]) / limits.acceleration
    upright = 1.5 * np.abs(dv[:, 2]) / limits.climb_acceleration
    return np.maximum(np.maximum(level, upright), _MIN_S)


@dataclass(frozen=True, slots=True)
class PrimitivePath:
    """Accelerates from `start` in `rise_s`, cruises for `cruise_s`, brakes in `brake_s`."""

    start: PrimitiveState
    velocity: Array
    rise_s: float
    cruise_s: float
    brake_s: float

    @property
    def duration_s(self) -> float:
        """Returns the time until rest."""
        return self.rise_s + self.cruise_s + self.brake_s

    def at(self, time_s: float) -> PrimitiveState:
        """Returns the motion at `time_s`; after the end it is at rest."""
        if time_s < self.rise_s:
            return changed(self.start, self.velocity, self.rise_s, max(time_s, 0.0))
        risen = changed(self.start, self.velocity, self.rise_s, self.rise_s)
        cruised = min(time_s - self.rise_s, self.cruise_s)
        steady = PrimitiveState(
            risen.position + self.velocity * cruised, self.velocity, np.zeros(3)
        )
        if time_s < self.rise_s + self.cruise_s:
            return steady
        braked = min(time_s - self.rise_s - self.cruise_s, self.brake_s)
        return changed(steady, np.zeros(3), self.brake_s, braked)


def changed(
    start: PrimitiveState, velocity: Array, duration_s: float, time_s: float
) -> PrimitiveState:
    """Returns the motion `time_s` into a change of velocity that takes `duration_s`."""
    dv = velocity - start.velocity - start.acceleration * duration_s
    da = -start.acceleration
    beta = (-12.0 * dv + 6.0 * duration_s * da) / duration_s**3
    gamma = (6.0 * duration_s * dv - 2.0 * duration_s**2 * da) / duration_s**3
    t = time_s
    return PrimitiveState(
        start.position
        + t * (start.velocity + t * (start.acceleration / 2 + t * (gamma / 6 + t * beta / 24))),
        start.velocity + t * (start.acceleration + t * (gamma / 2 + t * beta / 6)),
        start.acceleration + t * (gamma + t * beta / 2),
    )


def at_rest(position: Array) -> PrimitivePath:
    """Returns a trajectory that holds a position (3,) m."""
    rest = PrimitiveState(position.copy(), np.zeros(3), np.zeros(3))
    return PrimitivePath(rest, np.zeros(3), 0.5, 0.0, 0.5)


def braking(start: PrimitiveState, limits: MotionLimits) -> PrimitivePath:
    """Returns the shortest stop."""
    seconds = float(change_s(-start.velocity[None], limits)[0])
    return PrimitivePath(start, np.zeros(3), seconds, 0.0, _MIN_S)


def fan(
    start: PrimitiveState,
    directions: Array,
    speeds: Array,
    offsets: Array,
    rises: Array,
    limits: MotionLimits,
) -> PrimitiveCandidates:
    """Returns primitives along `directions` (D,) rad at `speeds` (S,) m/s.

    They lead to heights of `offsets` (O,) m. rises: (D, S, O) m/s: vertical velocity of each,
    positive up. The last primitive stops.
    """
    d, s, o = np.meshgrid(directions, speeds, offsets, indexing="ij")
    climb = np.clip(rises, -limits.climb, limits.climb)
    velocity = np.stack([s * np.cos(d), s * np.sin(d), climb], axis=-1).reshape(-1, 3)
    velocity = np.vstack([velocity, np.zeros(3)])
    rise = change_s(velocity - start.velocity, limits)
    cruise = np.maximum(limits.horizon_s - rise, 0.0)
    cruise[-1] = 0.0
    brake = change_s(velocity, limits)
    return PrimitiveCandidates(start, velocity, np.append(o.ravel(), 0.0), rise, cruise, brake)
