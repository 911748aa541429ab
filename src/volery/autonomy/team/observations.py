"""Fuses single observations into positions: rays to the ground, weighted by their covariances.

A ray to an object at horizontal distance r, seen from h above its centre, meets the height of that
centre at r = h / tan(depression). With an angular error s and an error of the ground's height q r
(q: how far the ground may slope), its error is

    along the ray   sqrt(((r^2 + h^2) / h * s)^2 + (q r * r / h)^2)
    across it       r s

both with that of the UAV's own position. Observations of one object are fused by their information
(inverse covariances), so that rays from different sides narrow the position down: y = sum(W x), W =
sum(P^-1), as a Kalman filter does for a constant state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from volery.autonomy.team.target_list import Detection
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S

_GATE = 9.21
"""99th percentile of chi squared with two degrees of freedom."""
_NEAR_M = 2.0
"""Distance at which an observation belongs to a track whatever the covariances. Modelling
choice.
"""


class PositionUncertainty(NamedTuple):
    """Standard deviations of an observation."""

    angle_rad: float = 0.03
    """Angular error of the ray: pixels, attitude, time."""
    slope: float = 0.2
    """Rise or fall of the ground for each metre of distance."""
    position_m: float = 0.2
    """Error of the UAV's own position, m."""


class Observation(NamedTuple):
    """A single observation of an object."""

    time_ns: int
    position: Array
    """(3,) m, map."""
    covariance: Array
    """(2, 2) of x and y, m^2."""


def sighting_of(
    time_ns: int, eye: Array, position: Array, uncertainty: PositionUncertainty
) -> Observation:
    """Returns the observation of an object: a ray from `eye` (3,) to `position` (3,) below it."""
    offset = position[:2] - eye[:2]
    r, h = max(float(np.hypot(*offset)), 1e-3), float(eye[2] - position[2])
    along = math.hypot((r * r + h * h) / h * uncertainty.angle_rad, uncertainty.slope * r * r / h)
    across = r * uncertainty.angle_rad
    c, s = offset / r
    turn = np.array([[c, -s], [s, c]])
    own = uncertainty.position_m**2 * np.eye(2)
    return Observation(time_ns, position, turn @ np.diag([along**2, across**2]) @ turn.T + own)


@dataclass
class Track:
    """One object, fused from all its observations."""

    first_ns: int
    last_ns: int
    information: Array = field(default_factory=lambda: np.zeros((2, 2)))
    weighted: Array = field(default_factory=lambda: np.zeros(2))
    heights: float = 0.0
    count: int = 0
    number: int = 0
    """Number of the detection of this UAV; 0: not confirmed yet."""

    @property
    def covariance(self) -> Array:
        """Covariance (2, 2) of x and y, m^2."""
        return np.asarray(np.linalg.inv(self.information))

    @property
    def position(self) -> Array:
        """Position (2,) m, map."""
        return np.asarray(self.covariance @ self.weighted)

    def add(self, sighting: Observation) -> None:
        """Adds an observation."""
        weight = np.linalg.inv(sighting.covariance)
        self.information = self.information + weight
        self.weighted = self.weighted + weight @ sighting.position[:2]
        self.heights += float(sighting.position[2])
        self.count += 1
        self.last_ns = sighting.time_ns

    def fits(self, sighting: Observation) -> bool:
        """Returns whether an observation may belong to this object."""
        off = sighting.position[:2] - self.position
        spread = np.linalg.inv(self.covariance + sighting.covariance)
        return float(off @ spread @ off) <= _GATE or float(np.hypot(*off)) <= _NEAR_M

    def detection(self, finder: str) -> Detection:
        """Returns the detection that other UAVs receive."""
        a, b, c, d = self.covariance.ravel().tolist()
        x, y = self.position.tolist()
        z = self.heights / self.count
        return Detection(finder, self.number, self.last_ns, (x, y, z), (a, b, c, d), self.count)


@dataclass
class Tracks:
    """All objects that one UAV observes.

    sightings, within_s, spread_m: a track is confirmed after so many observations, over at least
    `within_s`, with a standard deviation of at most `spread_m` in its worst direction. forget_s:
    time after which an unconfirmed track without new observations is dropped.
    """

    sightings: int = 4
    within_s: float = 0.5
    spread_m: float = 2.0
    forget_s: float = 20.0
    tracks: list[Track] = field(default_factory=list)

    def add(self, sighting: Observation) -> Track:
        """Adds an observation to the nearest track that fits, or creates a track; returns it."""
        now = sighting.time_ns
        self.tracks = [
            t for t in self.tracks if t.number or now - t.last_ns <= self.forget_s * NS_PER_S
        ]
        fitting = [track for track in self.tracks if track.fits(sighting)]
        if fitting:
            position = sighting.position[:2]
            track = min(fitting, key=lambda t: float(np.hypot(*(t.position - position))))
        else:
            track = Track(now, now)
            self.tracks.append(track)
        track.add(sighting)
        if not track.number and self._is_sure(track):
            track.number = 1 + max(each.number for each in self.tracks)
        return track

    def detections(self, finder: str) -> list[Detection]:
        """Returns all confirmed detections, by number."""
        sure = sorted((t for t in self.tracks if t.number), key=lambda t: t.number)
        return [track.detection(finder) for track in sure]

    def _is_sure(self, track: Track) -> bool:
        lasted = track.last_ns - track.first_ns >= self.within_s * NS_PER_S
        spread = math.sqrt(float(np.linalg.eigvalsh(track.covariance)[-1]))
        return track.count >= self.sightings and lasted and spread <= self.spread_m
