"""Keyframes: every few metres a pose and the returns around it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.matching_kernels import GROUND, UPRIGHT
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.vectors import norm

_MAX_POINTS = {UPRIGHT: 400, GROUND: 150}


class Keyframe(NamedTuple):
    """Pose and returns of a keyframe; its axes are level, x along the vehicle's heading."""

    time_ns: int
    position: Array
    """(3,) m, in the frame of the odometry."""
    attitude: Array
    """(4,) in the frame of the odometry."""
    travelled_m: float
    points: Array
    """(K, 3) m, returns around it in its axes."""
    kinds: NDArray[np.int8]
    """(K,) kinds of the returns."""
    session: int
    """Number of tracking losses before it; within a session the odometry is continuous."""


class Level(NamedTuple):
    """Orientation of a keyframe's axes in the odometry's."""

    attitude: Array
    """(4,) level from odometry: it rotates gravity to -z."""
    yaw: float
    """Heading of the vehicle about the true vertical, rad."""


def levelling(gravity: Array) -> Array:
    """Returns the smallest rotation (4,) that turns `gravity` (3,) straight down."""
    x, y, z = (-gravity / norm(gravity)).tolist()
    axis = np.array([y, -x, 0.0])
    sine = norm(axis)
    if sine < 1e-12:
        return np.array([0.0, 0.0, 0.0, 1.0])
    return rotations.exponential(axis / sine * math.atan2(sine, z))


def level_of(gravity: Array, attitude: Array) -> Level:
    """Returns the level axes of a vehicle with `attitude` (4,) under `gravity` (3,)."""
    turn = levelling(gravity)
    return Level(turn, float(rotations.yaw_of(rotations.multiply(turn, attitude))))


def turn_of_heading(level: Level, attitude: Array, settling: Array) -> float:
    """Returns the change of heading, rad, of a vehicle that rotated by `settling` (4,), body axes.

    `attitude` (4,) is that at the end; its level axes are `level`.
    """
    ahead = rotations.multiply(rotations.from_yaw(-level.yaw), level.attitude)
    before = rotations.multiply(rotations.multiply(ahead, attitude), rotations.conjugate(settling))
    return -float(rotations.yaw_of(before))


def step_between(one: Keyframe, position: Array, attitude: Array, gravity: Array) -> Array:
    """Returns the step (4,) x, y, z, yaw from a keyframe to a pose of the odometry."""
    here, there = level_of(gravity, one.attitude), level_of(gravity, attitude)
    moved = rotations.rotate(here.attitude, position - one.position)
    c, s = math.cos(here.yaw), math.sin(here.yaw)
    turn = math.remainder(there.yaw - here.yaw, math.tau)
    return np.array(
        [c * moved[0] + s * moved[1], c * moved[1] - s * moved[0], float(moved[2]), turn]
    )


class KeyframeBuilder:
    """Collects the returns since the last keyframe, in the odometry's frame."""

    def __init__(self) -> None:
        self._points: list[Array] = []
        self._kinds: list[NDArray[np.int8]] = []

    def add(self, points: Array, kinds: NDArray[np.int8]) -> None:
        """Adds returns (K, 3)."""
        useful = (kinds == UPRIGHT) | (kinds == GROUND)
        self._points.append(points[useful])
        self._kinds.append(kinds[useful])

    def keyframe(
        self, time_ns: int, state: tuple[Array, Array, Array], travelled_m: float, session: int
    ) -> Keyframe:
        """Returns the keyframe at a pose and begins the next one.

        `state` is position (3,), attitude (4,) and gravity (3,).
        """
        position, attitude, gravity = state
        level = level_of(gravity, attitude)
        points = np.concatenate([*self._points, np.zeros((0, 3))])
        kinds = np.concatenate([*self._kinds, np.zeros(0, np.int8)])
        chosen = np.concatenate([_spread(kinds, kind) for kind in _MAX_POINTS])
        turn = rotations.multiply(rotations.from_yaw(-level.yaw), level.attitude)
        own = rotations.rotate(turn, points[chosen] - position)
        self._points, self._kinds = [], []
        return Keyframe(
            time_ns, position.copy(), attitude.copy(), travelled_m, own, kinds[chosen], session
        )


def _spread(kinds: NDArray[np.int8], kind: int) -> NDArray[np.int64]:
    """Returns rows of a kind, thinned evenly."""
    rows = np.flatnonzero(kinds == kind)
    max_points = _MAX_POINTS[kind]
    if len(rows) <= max_points:
        return rows
    return rows[np.linspace(0, len(rows) - 1, max_points).round().astype(np.int64)]
