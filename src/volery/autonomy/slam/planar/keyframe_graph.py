"""The planar keyframe graph in the map: keyframes, odometry edges and loop closures."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from volery.autonomy.slam.planar.loop_closure import PlanarLoopCloser, PlanarLoopClosure
from volery.autonomy.slam.planar.pose_graph import PlanarEdge, optimised
from volery.autonomy.slam.planar.poses import between, compose, grown, turned
from volery.autonomy.slam.planar.settings import PlanarSettings
from volery.autonomy.slam.planar.tracker import PlanarTrackerState
from volery.autonomy.slam.pose_graph import load_gtsam
from volery.core.arrays import Array
from volery.core.saved_state import SavedAttributes

_ASTRAY = np.diag([1000.0**2, 1000.0**2, 3.0**2])
"""Covariance of the step over which tracking was lost."""
_WIDEST = np.array([8.0, 8.0, 0.8])
_NARROWEST = np.array([0.25, 0.25, 0.05])
_ANYWHERE = np.array([6.0, 6.0, math.pi])
_TRY_EACH = 0.9
"""Distance travelled between two attempts."""
_TRIES, _LOST_TRIES = 2, 3
_SPACED_M = 4.0
"""Min distance between the candidates of one keyframe."""
_AT_ONCE_M, _AT_ONCE_RAD = 0.04, 0.006
_AT_LAST = 8
"""Number of closures that change little after which the graph is optimized."""


class PlanarKeyframeGraph(SavedAttributes):
    """Holds keyframes and their graph; `start` (3,) is the first one's pose in the map."""

    STATE = (
        "frames", "poses", "edges", "session", "is_placed", "closures", "tried", "changes",
        "covariance",
        "_spread", "_pending", "_tried_at", "_cursor", "_waiting",
    )  # fmt: skip

    def __init__(self, settings: PlanarSettings, start: Array, *, has_loops: bool = True) -> None:
        if has_loops:
            load_gtsam()
        self._settings = settings
        self._closer = PlanarLoopCloser(settings) if has_loops else None
        self._start = np.asarray(start, np.float64)
        self.frames: list[PlanarTrackerState] = []
        self.poses: list[Array] = []
        """Poses of the keyframes in the map, (3,)."""
        self.edges: list[PlanarEdge] = []
        self.session = 0
        self.is_placed = True
        """Whether the current session's pose in the map is known."""
        self.closures = self.tried = self.changes = 0
        """`changes` counts keyframes and corrections."""
        self.covariance = np.zeros((3, 3))
        """Covariance of the newest keyframe in the map, (3, 3)."""
        self._spread: list[Array] = []
        """Covariance of each keyframe, (3, 3)."""
        self._pending: PlanarLoopClosure | None = None
        self._tried_at = -1e9
        self._cursor = 0
        self._waiting = 0

    def add(self, frame: PlanarTrackerState) -> bool:
        """Adds a keyframe; returns whether the map has been corrected."""
        self._append(frame)
        if self._closer is None or frame.travelled - self._tried_at < _TRY_EACH:
            return False
        newest, found = len(self.frames) - 1, None
        window = self._search_window() if self.is_placed else _ANYWHERE
        for row in self._near(newest, window) if self.is_placed else self._anywhere(newest):
            self._tried_at = frame.travelled
            self.tried += 1
            closure = self._closer.close(self.frames, self.poses, newest, row, window)
            if closure is not None and (found is None or closure.fit.met > found.fit.met):
                found = closure
        return found is not None and self._weigh(found)

    def finish(self) -> None:
        """Optimizes the graph with all closures."""
        if self._waiting:
            self._fit()

    def pose(self, own: Array) -> Array:
        """Returns a pose (3,) of the odometry's frame in the map."""
        if not self.frames:
            return compose(self._start, own)
        return compose(self.poses[-1], between(self.frames[-1].pose, own))

    @property
    def correction(self) -> Array:
        """The pose (3,) of the odometry's frame in the map."""
        return self.pose(np.zeros(3))

    # --------------------------------------------------------------------------------- keyframes

    def _append(self, frame: PlanarTrackerState) -> None:
        if not self.frames:
            self._put(frame, compose(self._start, frame.pose), np.diag([1e-6] * 3))
            return
        step, of_step = frame.step, frame.covariance
        if frame.session != self.frames[-1].session:
            step, of_step = between(self.frames[-1].pose, frame.pose), _ASTRAY
            self.session, self.is_placed, self._pending = frame.session, False, None
        row, before = len(self.frames), self.poses[-1]
        yaw = float(step[2])  # gtsam's noise is in the axes of the step's end
        information = np.linalg.inv(turned(of_step, -yaw))
        self.edges.append(PlanarEdge(row - 1, row, step, 0.5 * (information + information.T)))
        spread = grown(self._spread[-1], before, step, of_step)
        self._put(frame, compose(before, step), spread)

    def _put(self, frame: PlanarTrackerState, pose: Array, spread: Array) -> None:
        self.changes += 1
        self.frames.append(frame)
        self.poses.append(pose)
        self._spread.append(spread)
        self.covariance = spread

    # ---------------------------------------------------------------------------- loop closures

    def _search_window(self) -> Array:
        """Returns the max error (3,) of the newest keyframe's estimated pose."""
        sigmas = 3.0 * np.sqrt(np.diag(self.covariance))
        wide = max(float(sigmas[0]), float(sigmas[1]))
        window = np.array([wide, wide, float(sigmas[2])])
        return np.asarray(np.clip(window, _NARROWEST, _WIDEST))

    def _near(self, newest: int, window: Array) -> Iterator[int]:
        """Yields old keyframes that may be nearby, nearest first, spaced apart."""
        here, apart = self.frames[newest], self._settings.loop_closure.apart_m
        last = newest
        while last > 0 and (
            self.frames[last - 1].session == here.session
            and here.travelled - self.frames[last - 1].travelled <= apart
        ):
            last -= 1
        if last == 0:
            return
        away = np.hypot(*(np.array(self.poses[:last]) - self.poses[newest])[:, :2].T)
        wide = float(window[0]) > 1.0
        within = float(window[0]) + 3.0
        taken: list[int] = []
        for row in np.argsort(away, kind="stable"):
            if away[row] > within or len(taken) == (_TRIES if wide else 1):
                return
            positions = [self.poses[k][:2] for k in taken]
            if all(float(np.hypot(*(self.poses[row][:2] - p))) > _SPACED_M for p in positions):
                taken.append(int(row))
                yield int(row)

    def _anywhere(self, newest: int) -> Iterator[int]:
        """Yields some keyframes of earlier sessions in turn, while lost."""
        session = self.frames[newest].session
        old = [k for k, frame in enumerate(self.frames) if frame.session != session]
        fresh = sum(frame.session == session for frame in self.frames)
        if not old or fresh < 3:
            return
        for _ in range(min(_LOST_TRIES, len(old))):
            yield old[self._cursor % len(old)]
            self._cursor += 5  # neighbours look alike

    def _weigh(self, found: PlanarLoopClosure) -> bool:
        """Accepts a closure, at once or once a second one agrees with it."""
        c, away = self._settings.loop_closure, found.away
        far = math.hypot(away[0], away[1]) > c.far_m or abs(float(away[2])) > c.far_rad
        if not far and self.is_placed:
            self._pending = None
            self._take([found])
            return self._fit_if_due(away)
        other, self._pending = self._pending, found
        if other is None or not self._agree(other, found):
            return False
        self._pending = None
        self._take([other, found])
        self.is_placed = True
        self.poses[found.edge.to] = compose(self.poses[found.edge.origin], found.edge.measured)
        self._fit()
        return True

    def _agree(self, one: PlanarLoopClosure, other: PlanarLoopClosure) -> bool:
        """Returns whether two closures move the newest keyframes to the same pose."""
        c, first, second = self._settings.loop_closure, one.edge, other.edge
        a, b = self.frames[first.to], self.frames[second.to]
        if a.session != b.session or b.travelled - a.travelled > c.max_travelled_m:
            return False
        expected = compose(
            compose(self.poses[first.origin], first.measured), between(a.pose, b.pose)
        )
        left = between(expected, compose(self.poses[second.origin], second.measured))
        travelled = b.travelled - a.travelled
        return bool(
            math.hypot(left[0], left[1]) < c.again_m + 0.03 * travelled
            and abs(float(left[2])) < c.again_rad
        )

    def _take(self, found: list[PlanarLoopClosure]) -> None:
        for closure in found:
            self.edges.append(closure.edge)
            yaw = float(self.poses[closure.edge.to][2])
            spread = turned(np.asarray(np.linalg.inv(closure.edge.information), np.float64), yaw)
            known = self._spread[closure.edge.origin] + spread
            if np.trace(known) < np.trace(self.covariance):
                self._spread[closure.edge.to] = self.covariance = known
        self.closures += len(found)
        self._waiting += len(found)

    def _fit_if_due(self, away: Array) -> bool:
        at_once = math.hypot(away[0], away[1]) > _AT_ONCE_M or abs(float(away[2])) > _AT_ONCE_RAD
        if not at_once and self._waiting < _AT_LAST:
            return False
        self._fit()
        return True

    def _fit(self) -> None:
        before = len(self.edges)
        self.poses, self.edges = optimised(self.poses, self.edges)
        self.closures -= before - len(self.edges)
        self._waiting = 0
        self.changes += 1
