"""Tracks a level scanner: matches each scan with a map of the last keyframes.

All poses are in the frame of the odometry, which begins at the start of the log and never jumps
when later data corrects the map.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.slam.planar.health import is_open
from volery.autonomy.slam.planar.local_map import PlanarSubmap, ScanMatch
from volery.autonomy.slam.planar.motion import PlanarMotion
from volery.autonomy.slam.planar.poses import between, placed
from volery.autonomy.slam.planar.scans import thinned
from volery.autonomy.slam.planar.settings import PlanarSettings
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes

_LEVELS = 4
_TURN_M = 0.3
"""Distance that a rotation by 1 rad counts as."""
_FEW = 12
"""Returns below which a scan is ignored."""
_POOR, _LOST_FRACTION = 0.9, 0.5
"""Fractions of the usual matched fraction below which a fit is doubtful, or rejected."""
_USUAL_S = 5.0
_LOST_SCANS, _LOST_NS = 4, NS_PER_S
_ROUGHLY = np.diag([0.7**2, 0.7**2, 0.3**2])
"""Covariance of a motion over which scans did not fit, but odometry continued."""
_WIDEST = np.array([1.6, 1.6, 0.9])
_FLOOR = np.diag([0.008**2, 0.008**2, 0.0015**2])
"""Min covariance of a step between keyframes: the common errors of map and scanner."""


class PlanarTrackerState(NamedTuple):
    """A keyframe of the tracker."""

    time_ns: int
    pose: Array
    """(3,) in the odometry's frame."""
    points: Array
    """(K, 2) m in its own axes."""
    step: Array
    """(3,) from the previous keyframe."""
    covariance: Array
    """(3, 3) of the step, in the axes of the previous keyframe."""
    travelled: float
    """Distance so far; rotations count, see `_TURN_M`."""
    usual: float
    """Recent average of the matched fraction."""
    session: int
    """Number of tracking losses."""


class PlanarTracker(SavedAttributes):
    """Holds motion, local map and the newest keyframe."""

    def __init__(self, settings: PlanarSettings) -> None:
        self.settings = settings
        self.motion = PlanarMotion(settings.moving)
        self.time_ns: int | None = None
        self.travelled = self.travelled_m = 0.0
        self.fraction = self.usual = 0.0
        self.session = 0
        self.misfits = 0
        """Number of consecutive scans that did not fit."""
        self.is_blind = self.is_open = False
        """Whether too few returns are in range, or scans leave a direction unconstrained."""
        self._misfit_ns = 0
        self._has_odometry = False
        self._map = PlanarSubmap(settings.returns.max_range_m + 4.0, _LEVELS, settings.fitting)
        self._local: deque[PlanarTrackerState] = deque()
        self._last: PlanarTrackerState | None = None
        self._since = np.zeros((3, 3))
        """Covariance of the pose relative to the newest keyframe, in that one's axes."""
        self._fresh_fraction = 0.0

    PARTS = ("motion",)
    STATE = (
        "time_ns", "travelled", "travelled_m", "fraction", "usual", "session", "misfits",
        "is_blind", "is_open", "_misfit_ns", "_has_odometry", "_last", "_since", "_fresh_fraction",
        "_local",
    )  # fmt: skip

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        super().set_state(state)
        self._redraw()

    def set_clock(self, time_ns: int) -> None:
        """Continues from here at another time, with unknown velocity."""
        self.time_ns = time_ns
        self.motion.forget_velocity()

    @property
    def is_lost(self) -> bool:
        """Whether scans have not fitted for so long that the motion is unknown."""
        if self.misfits < _LOST_SCANS or self.time_ns is None:
            return False
        return self.time_ns - self._misfit_ns >= _LOST_NS

    def restart(self) -> bool:
        """Begins a new map with the next scan, as scans no longer fit.

        Returns whether the session continues, by odometry, though roughly.
        """
        self._local.clear()
        self.misfits, self.usual = 0, 0.0
        if self._has_odometry:
            self._since = self._since + _ROUGHLY
            return True
        self.session += 1
        self._last = None
        self.motion.forget_velocity()
        return False

    def follow(self, time_ns: int, returns: Array, step: Array | None) -> PlanarTrackerState | None:
        """Processes the returns (K, 2) of a scan; returns the new keyframe, if one was due.

        step: (3,) since the previous scan, by the odometry.
        """
        r = self.settings.returns
        dt = 0.0 if self.time_ns is None else (time_ns - self.time_ns) / NS_PER_S
        self.time_ns = time_ns
        before = self.motion.pose.copy()
        added = self.motion.move(dt, step)
        self._has_odometry = step is not None
        points = thinned(returns, r.apart_m, r.max_points)
        found = None
        self.is_blind = len(points) < _FEW
        if len(points) >= _FEW and self._local:
            found = self._match(points)
            self._judge(time_ns, dt, found)
            if self.misfits == 1 and step is None:
                self.motion.forget_velocity()  # it would only increase the error
            if self.misfits == 0:
                self.is_open = is_open(found.information)
                self.motion.correct(found.pose, found.information)
        self._update_covariance(before, added, found)
        is_first = len(points) >= _FEW and not self._local
        return self._keep(time_ns, returns) if is_first or self._is_due(found) else None

    # ---------------------------------------------------------------------------------- matching

    def _match(self, points: Array) -> ScanMatch:
        """Matches by least squares from the prediction; if that fits poorly, after a search."""
        motion = self.motion
        found = self._map.fit(points, motion.pose, motion.certainty)
        if found.fraction >= _POOR * self.usual and not self._is_surprising(found):
            return found
        sigma = np.sqrt(np.diag(motion.covariance)[:3])
        window = np.minimum(3.0 * sigma + [0.1, 0.1, 0.05], _WIDEST)
        if self.misfits:
            window = _WIDEST
        slope = 0.02 / np.maximum(window, 0.05) ** 2
        thin = np.ascontiguousarray(points[:: max(len(points) // 120, 1)])
        start, score = self._map.search(thin, motion.pose, window, slope=slope)
        if score <= 0.0:
            return found
        other = self._map.fit(points, start)
        return other if other.fraction > found.fraction + 0.03 else found

    def _is_surprising(self, found: ScanMatch) -> bool:
        """Returns whether the scan deviates from the prediction by more than four sigma."""
        away = found.pose - self.motion.pose
        away[2] = math.remainder(float(away[2]), math.tau)
        return float(away @ self.motion.certainty @ away) > 16.0

    def _judge(self, time_ns: int, dt: float, found: ScanMatch) -> None:
        self.fraction = found.fraction
        if self.fraction >= _LOST_FRACTION * self.usual:
            self.misfits = 0
            passed = min(max(dt, 0.05) / _USUAL_S, 0.2)
            self.usual += (passed if self.usual else 1.0) * (self.fraction - self.usual)
            return
        self.misfits += 1
        if self.misfits == 1:
            self._misfit_ns = time_ns

    def _update_covariance(self, before: Array, added: Array, found: ScanMatch | None) -> None:
        moved = between(before, self.motion.pose)
        self.travelled_m += math.hypot(moved[0], moved[1])
        self.travelled += math.hypot(moved[0], moved[1]) + _TURN_M * abs(float(moved[2]))
        if self._last is None:
            return
        turn = between(self._last.pose, before)[2]
        c, s = math.cos(turn), math.sin(turn)
        axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        lever = np.eye(3)
        lever[:2, 2] = axes[:2, :2] @ np.array([-moved[1], moved[0]])
        self._since = lever @ self._since @ lever.T + axes @ added @ axes.T
        if found is not None and self.misfits == 0:
            yaw = float(self._last.pose[2])
            c, s = math.cos(yaw), math.sin(yaw)
            axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            information = axes @ found.information @ axes.T
            self._since = np.linalg.inv(
                np.linalg.inv(self._since + 1e-12 * np.eye(3)) + information
            )

    # --------------------------------------------------------------------------------- keyframes

    def _is_due(self, found: ScanMatch | None) -> bool:
        if found is None or self.misfits or self._last is None:
            return False
        k = self.settings.keeping
        if self._fresh_fraction == 0.0:
            self._fresh_fraction = self.fraction
        moved = between(self._last.pose, self.motion.pose)
        distance, turn = math.hypot(moved[0], moved[1]), abs(float(moved[2]))
        stale = self.fraction < k.step_fraction * self._fresh_fraction
        return (
            distance > k.step_m
            or turn > k.step_rad
            or (stale and (distance > k.min_m or turn > k.min_rad))
        )

    def _keep(self, time_ns: int, returns: Array) -> PlanarTrackerState:
        r, pose = self.settings.returns, self.motion.pose.copy()
        step, covariance = np.zeros(3), np.zeros((3, 3))
        if self._last is not None:
            step = between(self._last.pose, pose)
            covariance = self._since + _FLOOR
        points = thinned(returns, r.apart_m, r.max_keyframe_points)
        kept = PlanarTrackerState(
            time_ns, pose, points, step, covariance, self.travelled, self.usual, self.session
        )
        self._last = kept
        self._local.append(kept)
        k = self.settings.keeping
        while len(self._local) > k.max_local_keyframes or (
            self.travelled - self._local[0].travelled > k.max_local_travelled
            and len(self._local) > 3
        ):
            self._local.popleft()
        self._since = np.zeros((3, 3))
        self._fresh_fraction = 0.0
        self._redraw()
        return kept

    def _redraw(self) -> None:
        if self._local:
            points = np.concatenate([placed(kept.points, kept.pose) for kept in self._local])
            self._map.draw(points, self._local[-1].pose)
