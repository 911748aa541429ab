"""Ways of things: where one is at a simulated time, as a function of that time alone.

A pose is (7,): x y z m, qx qy qz qw, map from body (FLU).
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Sequence
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
HeightAt = Callable[[float, float], float]
"""z of the ground at a place (x, y) of the map, m."""

_GRAVITY_M_S2 = 9.80665


class ActorMotion(Protocol):
    """A way."""

    @property
    def speed_m_s(self) -> float:
        """Never is it faster."""

    def pose_at(self, time_s: float) -> Array:
        """Pose (7,) at a time since the start, before which it stands as at the start."""


class WaypointMotion:
    """Along straight lines at a constant speed, turning ahead of and behind each waypoint.

    waypoints: (K, 3) m, or (K, 2) for what goes on the ground, whose height `ground` tells. The
    heading is that of the line between the places `turn_m` behind and ahead on the way.
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
        self._way: list[float] = [0.0, *np.cumsum(length[moves]).tolist()]
        """How far along the way each point lies, m."""
        self._at_end = at_end
        self._start_s = start_s
        self._turn_m = min(turn_m, 0.25 * self._way[-1])
        self._ground = ground
        self.speed_m_s = speed_m_s

    def pose_at(self, time_s: float) -> Array:
        """See `ActorMotion`."""
        way = self.speed_m_s * max(time_s - self._start_s, 0.0)
        if self._at_end == "stop":
            way = min(way, self._way[-1])
        x, y, *rest = self._place(way)
        z = rest[0] if self._ground is None else self._ground(x, y)
        half = 0.5 * self._heading(way)
        return np.array([x, y, z, 0.0, 0.0, math.sin(half), math.cos(half)])

    def _heading(self, way: float) -> float:
        ahead, behind = self._place(way + self._turn_m), self._place(way - self._turn_m)
        dx, dy = ahead[0] - behind[0], ahead[1] - behind[1]
        if math.hypot(dx, dy) < 1e-9:  # at the very point where it turns back, or straight up
            ahead, behind = self._place(way + 2e-3 * self._turn_m), self._place(way)
            dx, dy = ahead[0] - behind[0], ahead[1] - behind[1]
        return math.atan2(dy, dx)

    def _place(self, way: float) -> list[float]:
        """Where it is after `way` m, by the numbers of a waypoint; an end is not passed."""
        length = self._way[-1]
        if self._at_end == "loop":
            way %= length
        elif self._at_end == "back":
            way %= 2.0 * length
            way = min(way, 2.0 * length - way)
        way = min(max(way, 0.0), length)
        k = min(bisect.bisect_right(self._way, way), len(self._way) - 1)
        share = (way - self._way[k - 1]) / (self._way[k] - self._way[k - 1])
        pair = zip(self._points[k - 1], self._points[k], strict=True)
        return [a + share * (b - a) for a, b in pair]


class CircleMotion:
    """Round a centre (3,) m at one height, leaning so that weight and turn balance."""

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
        """See `ActorMotion`."""
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
    """Where something outside says, from the time on at which that was said.

    What was said of the last quarter of a second is remembered: sensors look back that far.
    """

    _REMEMBERED_S = 0.25

    def __init__(self, pose: ArrayLike) -> None:
        self._said: tuple[tuple[float, Array, Array], ...] = (
            (0.0, np.array(pose, dtype=np.float64), np.zeros(3)),
        )
        """Since when, pose then, velocity (3,) m/s since then; oldest first."""

    @property
    def speed_m_s(self) -> float:
        """Speed since the last word."""
        return float(np.linalg.norm(self._said[-1][2]))

    def say(self, time_s: float, pose: ArrayLike, velocity: ArrayLike) -> None:
        """Be at `pose` (7,) now, at `time_s`, and go on from there at `velocity` (3,) m/s."""
        kept = [said for said in self._said if said[0] < time_s]
        recent = [said for said in kept if said[0] > time_s - self._REMEMBERED_S]
        older = kept[: len(kept) - len(recent)][-1:]
        word = time_s, np.array(pose, dtype=np.float64), np.array(velocity, dtype=np.float64)
        self._said = (*older, *recent, word)

    def pose_at(self, time_s: float) -> Array:
        """See `ActorMotion`."""
        since, pose, velocity = next(
            (said for said in reversed(self._said) if said[0] <= time_s), self._said[0]
        )
        pose = pose.copy()
        pose[:3] += velocity * max(time_s - since, 0.0)
        return pose

    def get_state(self) -> object:
        """What a snapshot keeps."""
        return self._said

    def set_state(self, state: object) -> None:
        """Go back to a kept state."""
        assert isinstance(state, tuple)
        self._said = state
