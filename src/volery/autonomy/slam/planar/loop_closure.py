"""Loop closures in the plane: matches the newest keyframes with older ones around them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from volery.autonomy.slam.planar.local_map import PlanarSubmap, ScanMatch
from volery.autonomy.slam.planar.pose_graph import PlanarEdge
from volery.autonomy.slam.planar.poses import between, placed
from volery.autonomy.slam.planar.scans import thinned
from volery.autonomy.slam.planar.settings import PlanarSettings
from volery.autonomy.slam.planar.tracker import PlanarTrackerState
from volery.core.arrays import Array

_LEVELS = 6
_MAX_FRAMES, _MAX_QUERIES = 24, 12
_THIN, _FINE = 160, 600
"""Number of returns for the search, and for the fit."""
_ALIKE, _OTHER_M = 0.93, 0.7
"""A second position at this distance that scores nearly as well makes both ambiguous."""
_ANY_RAD = 3.0
"""Window from which tracking counts as lost: it is centred on the older keyframe."""
_MIN_INFORMATION = 400.0
"""1/m^2 of the position in the weaker direction: below it only the stronger one is constrained."""
_MARGIN = np.array([0.3, 0.3, 0.1])
"""Amount by which a fit may exceed the window of the search."""
_FLOOR = np.diag([0.02**2, 0.02**2, 0.004**2])
"""Min covariance of a closure."""


class PlanarLoopClosure(NamedTuple):
    """A loop closure, its fit, and how far it moves the newest keyframe."""

    edge: PlanarEdge
    fit: ScanMatch
    away: Array
    """(3,) from the newest keyframe's estimated pose, in the axes of the older one."""


class PlanarLoopCloser:
    """Matches the newest keyframes with old ones.

    `poses` are those of all keyframes in the map, (3,) each.
    """

    def __init__(self, settings: PlanarSettings) -> None:
        self._settings = settings
        half_width_m = settings.returns.max_range_m + settings.loop_closure.around_m
        self._map = PlanarSubmap(min(half_width_m, 40.0), _LEVELS, settings.fitting)

    def close(
        self,
        frames: Sequence[PlanarTrackerState],
        poses: Sequence[Array],
        newest: int,
        older: int,
        window: Array,
    ) -> PlanarLoopClosure | None:
        """Returns the newest keyframe relative to an older one; None if they do not fit.

        window: (3,) max error of the newest one's estimated pose, m and rad.
        """
        known = self._around(frames, poses, newest, older)
        query = self._query(frames, newest)
        if len(known) == 0 or len(query) < 2 * self._settings.loop_closure.min_matches:
            return None
        at = poses[older]
        drawn = np.concatenate([placed(frames[k].points, between(at, poses[k])) for k in known])
        self._map.draw(drawn, np.zeros(3))
        lost = window[2] >= _ANY_RAD
        hypothesis = np.zeros(3) if lost else between(at, poses[newest])
        is_narrow = window[0] < 0.35 and window[2] < 0.1
        start = hypothesis if is_narrow else self._found(query, hypothesis, window)
        if start is None:
            return None
        fine = np.ascontiguousarray(query[:: max(len(query) // _FINE, 1)])
        found = self._map.fit(fine, start)
        away = between(hypothesis, found.pose)
        if not self._is_believed(found, away, window, frames[newest].usual):
            return None
        information = self._information(found.information, float(found.pose[2]))
        edge = PlanarEdge(older, newest, found.pose, information, is_closure=True)
        return PlanarLoopClosure(edge, found, away)

    def _found(self, query: Array, hypothesis: Array, window: Array) -> Array | None:
        """Returns the best pose in the window; None if no pose fits, or two do."""
        thin = np.ascontiguousarray(query[:: max(len(query) // _THIN, 1)])
        slope = np.zeros(3) if window[2] >= _ANY_RAD else 0.04 / window**2
        min_score = 0.45
        pose, score = self._map.search(thin, hypothesis, window, slope=slope, min_score=min_score)
        if score <= 0.0:
            return None
        shut = np.array([pose[0], pose[1], _OTHER_M])
        other, second = self._map.search(
            thin, hypothesis, window, slope=slope, min_score=_ALIKE * score, shut=shut
        )
        if second > 0.0 and not self._is_along(thin, pose, other):
            return None
        return pose

    def _is_along(self, query: Array, pose: Array, other: Array) -> bool:
        """Returns whether two poses differ only along the direction that the walls leave open."""
        found = self._map.fit(query, pose)
        values, axes = np.linalg.eigh(found.information[:2, :2])
        if values[0] > _MIN_INFORMATION:
            return False
        across = abs(float(axes[:, 1] @ (other[:2] - pose[:2])))
        return across < 0.4 and abs(math.remainder(float(other[2] - pose[2]), math.tau)) < 0.1

    def _is_believed(self, found: ScanMatch, away: Array, window: Array, usual: float) -> bool:
        c = self._settings.loop_closure
        fraction = min(max(c.fraction * usual, c.min_fraction), c.max_fraction)
        values = np.linalg.eigvalsh(found.information[:2, :2])
        weak = values[0] < _MIN_INFORMATION
        wanted = fraction + (0.06 if window[0] > 1.5 else 0.0) + (0.04 if weak else 0.0)
        if found.fraction < wanted or found.met < c.min_matches or values[1] < _MIN_INFORMATION:
            return False
        if weak and window[0] > 3.0:
            return False  # any corridor would match
        return bool((np.abs(away) <= window + _MARGIN).all())

    def _information(self, information: Array, yaw: float) -> Array:
        """Returns a closure's information, in the axes of its measurement."""
        c, s = math.cos(yaw), math.sin(yaw)
        axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        own = axes @ information @ axes.T
        return np.asarray(np.linalg.inv(np.linalg.inv(own + 1e-3 * np.eye(3)) + _FLOOR))

    def _around(
        self, frames: Sequence[PlanarTrackerState], poses: Sequence[Array], newest: int, older: int
    ) -> list[int]:
        """Returns the nearest old keyframes around the older one."""
        c, here = self._settings.loop_closure, frames[newest]
        away = {
            k: float(np.hypot(*(poses[k] - poses[older])[:2]))
            for k in range(newest)
            if frames[k].session == frames[older].session
            and (
                here.session != frames[k].session
                or here.travelled - frames[k].travelled > c.apart_m
            )
        }
        near = sorted((k for k in away if away[k] < c.around_m), key=lambda k: away[k])
        return near[:_MAX_FRAMES]

    def _query(self, frames: Sequence[PlanarTrackerState], newest: int) -> Array:
        """Returns the last keyframes' returns (K, 2), in the axes of the newest keyframe."""
        here, parts = frames[newest], []
        for k in range(newest, max(newest - _MAX_QUERIES, -1), -1):
            travelled = here.travelled - frames[k].travelled
            if frames[k].session != here.session or travelled > self._settings.loop_closure.query_m:
                break
            step = between(here.pose, frames[k].pose)
            parts.append(placed(thinned(frames[k].points, 0.1, 200), step))
        return np.concatenate(parts)
