"""Motions of actors: poses as a function of simulated time alone.

A pose is (7,): x y z m, qx qy qz qw, map from body (FLU).
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Sequence
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from volery.core import rotations
from volery.core.arrays import Array

HeightAt = Callable[[float, float], float]
"""Returns z of the ground at (x, y) of the map, m."""

_GRAVITY_M_S2 = 9.80665


class ActorMotion(Protocol):
    """Motion of an actor as a function of simulated time."""

    @property
    def speed_m_s(self) -> float:
        """Maximum speed, m/s."""

    def pose_at(self, time_s: float) -> Array:
        """Returns the pose (7,), map from body, at a time since the start; at least 0 s."""


class WaypointMotion:
    """Moves along straight lines at a constant speed, turning around each waypoint.

    waypoints: (K, 3) m, map, or (K, 2) for actors on the ground, whose height `ground` returns. The
    heading is that of the line between the positions `turn_m` behind and ahead on the path.
    """

    def __init__(
        self,
        waypoints: ArrayLike,
        speed_m_s: float,
        at_end: Literal["loop", "back", "stop"],
        *,
        start_s: float = 0.0,
        turn_m: float = 0.5,
        ground: HeightAt | None = None,
    ) -> None:
        points = np.asarray(waypoints, dtype=np.float64)
        if at_end == "loop":
            points = np.vstack([points, points[:1]])
        length = np.linalg.norm(np.diff(points, axis=0), axis=1)
        moves = length > 0.0
        self._points: list[tuple[float, ...]] = [
            tuple(point) for point in points[np.append(True, moves)].tolist()
        ]
        self._along: list[float] = [0.0, *np.cumsum(length[moves]).tolist()]
        """Distance of each point along the path, m."""
        self._at_end = at_end
        self._start_s = start_s
        self._turn_m = min(turn_m, 0.25 * self._along[-1])
        self._ground = ground
        self.speed_m_s = speed_m_s

    def pose_at(self, time_s: float) -> Array:
        """Returns the pose (7,) at a time; see `ActorMotion`."""
        distance = self.speed_m_s * max(time_s - self._start_s, 0.0)
        if self._at_end == "stop":
            distance = min(distance, self._along[-1])
        x, y, *rest = self._position_at(distance)
        z = rest[0] if self._ground is None else self._ground(x, y)
        half = 0.5 * self._heading(distance)
        return np.array([x, y, z, 0.0, 0.0, math.sin(half), math.cos(half)])

    def _heading(self, distance: float) -> float:
        ahead, behind = (
            self._position_at(distance + self._turn_m),
            self._position_at(distance - self._turn_m),
        )
        dx, dy = ahead[0] - behind[0], ahead[1] - behind[1]
        if math.hypot(dx, dy) < 1e-9:  # exactly at a reversal, or vertical
            ahead, behind = (
                self._position_at(distance + 2e-3 * self._turn_m),
                self._position_at(distance),
            )
            dx, dy = ahead[0] - behind[0], ahead[1] - behind[1]
        return math.atan2(dy, dx)

    def _position_at(self, distance: float) -> list[float]:
        """Returns the position after `distance` m, with a waypoint's dimension, within the path."""
        length = self._along[-1]
        if self._at_end == "loop":
            distance %= length
        elif self._at_end == "back":
            distance %= 2.0 * length
            distance = min(distance, 2.0 * length - distance)
        distance = min(max(distance, 0.0), length)
        k = min(bisect.bisect_right(self._along, distance), len(self._along) - 1)
        fraction = (distance - self._along[k - 1]) / (self._along[k] - self._along[k - 1])
        pair = zip(self._points[k - 1], self._points[k], strict=True)
        return [a + fraction * (b - a) for a, b in pair]


class CircleMotion:
    """Circles a centre (3,) m at one height, banked so that weight and turn balance."""

    def __init__(
        self,
        centre: Sequence[float],
        radius_m: float,
        speed_m_s: float,
        *,
        start_rad: float = 0.0,
        clockwise: bool = False,
    ) -> None:
        self._centre = tuple(float(value) for value in centre)
        self._radius = radius_m
        self._start = start_rad
        self._sense = -1.0 if clockwise else 1.0
        self._lean = math.atan2(speed_m_s * speed_m_s, _GRAVITY_M_S2 * radius_m)
        self.speed_m_s = speed_m_s

    def pose_at(self, time_s: float) -> Array:
        """Returns the pose (7,) at a time; see `ActorMotion`."""
        turned = self.speed_m_s / self._radius * max(time_s, 0.0)
        angle = self._start + self._sense * turned
        x, y, z = self._centre
        x, y = x + self._radius * math.cos(angle), y + self._radius * math.sin(angle)
        heading = 0.5 * (angle + self._sense * math.pi / 2.0)
        roll = -0.5 * self._sense * self._lean
        # Heading about z, then roll about x: the product of two half-angle quaternions.
        a, b, c, d = math.sin(roll), math.cos(roll), math.sin(heading), math.cos(heading)
        return np.array([x, y, z, a * d, a * c, b * c, b * d])


class GivenMotion:
    """Motion set externally; each setting is valid from its time on.

    Settings of the last quarter of a second are stored: sensors look back that far.
    """

    _REMEMBERED_S = 0.25

    def __init__(self, pose: ArrayLike) -> None:
        self._poses: tuple[tuple[float, Array, Array], ...] = (
            (0.0, np.array(pose, dtype=np.float64), np.zeros(3)),
        )
        """Time, pose (7,) and velocity (3,) m/s of each setting; oldest first."""

    @property
    def speed_m_s(self) -> float:
        """Speed since the latest setting, m/s."""
        return float(np.linalg.norm(self._poses[-1][2]))

    def set_pose(self, time_s: float, pose: ArrayLike, velocity: ArrayLike) -> None:
        """Sets `pose` (7,) at `time_s`, and the velocity (3,) m/s from there on."""
        kept = [entry for entry in self._poses if entry[0] < time_s]
        recent = [entry for entry in kept if entry[0] > time_s - self._REMEMBERED_S]
        older = kept[: len(kept) - len(recent)][-1:]
        word = time_s, np.array(pose, dtype=np.float64), np.array(velocity, dtype=np.float64)
        self._poses = (*older, *recent, word)

    def pose_at(self, time_s: float) -> Array:
        """Returns the pose (7,) at a time; see `ActorMotion`."""
        since, pose, velocity = next(
            (entry for entry in reversed(self._poses) if entry[0] <= time_s), self._poses[0]
        )
        pose = pose.copy()
        pose[:3] += velocity * max(time_s - since, 0.0)
        return pose

    def get_state(self) -> object:
        """Returns the stored settings."""
        return self._poses

    def set_state(self, state: object) -> None:
        """Restores a state of `get_state`."""
        assert isinstance(state, tuple)
        self._poses = state


class AttachedMotion:
    """Moves with another actor: `offset` is the pose (7,) in the frame of that actor."""

    def __init__(self, base: ActorMotion, offset: ArrayLike) -> None:
        self._base = base
        self._offset = np.array(offset, dtype=np.float64)

    @property
    def speed_m_s(self) -> float:
        """Maximum speed of the origin of the other actor, m/s."""
        return self._base.speed_m_s

    def pose_at(self, time_s: float) -> Array:
        """Returns the pose (7,) at a time; see `ActorMotion`."""
        base, offset = self._base.pose_at(time_s), self._offset
        position = base[:3] + rotations.rotate(base[3:], offset[:3])
        return np.concatenate([position, rotations.multiply(base[3:], offset[3:])])
