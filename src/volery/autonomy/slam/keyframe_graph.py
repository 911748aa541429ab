"""The keyframe graph in the map: keyframes, odometry edges and loop closures."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from volery.autonomy.slam.inertial_kernels import G, Q
from volery.autonomy.slam.keyframes import (
    Keyframe,
    KeyframeBuilder,
    level_of,
    step_between,
    turn_of_heading,
)
from volery.autonomy.slam.loop_closure import LoopCloser
from volery.autonomy.slam.pose_graph import PoseGraphEdge, compose, load_gtsam, optimised
from volery.autonomy.slam.relocalization import Relocalization
from volery.autonomy.slam.settings import ScanMatching
from volery.autonomy.slam.sweep import SweepPoints
from volery.autonomy.slam.tracker import Tracker
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm

_STEP_M, _STEP_RAD, _STEP_S = 2.0, 0.6, 10.0
"""Motion, or time, between keyframes."""
_LOST_STEP_S = 2.0
"""Time between keyframes while tracking is lost, as the vehicle may hover until relocalization."""
_RELEVEL_NS = 25 * NS_PER_S
"""Period for which new estimates of gravity still correct earlier steps between keyframes."""
_PER_ROOT_M = np.array([0.015, 0.015, 0.015, 0.0006])
"""Drift of the odometry over sqrt(m): m and rad (measured on recorded flights)."""
_APART_M = 40.0
"""Min distance flown between a keyframe and a loop closure candidate."""
_NEAR_M = 12.0
_ASTRAY = np.array([1000.0, 1000.0, 1000.0, 3.0])
"""Standard deviations of the step over which tracking was lost."""


class KeyframePose(NamedTuple):
    """`map_from_odom`: position (3,) m and attitude (4,)."""

    position: Array
    attitude: Array


class KeyframeGraph(SavedAttributes):
    """Holds the keyframes of one vehicle and their graph.

    `start` (4,) is the first keyframe's pose in the map.
    """

    STATE = (
        "frames", "poses", "edges", "closures", "refused", "session", "is_placed", "correction",
        "relocalization", "_gathering", "_tried", "_settling",
    )  # fmt: skip

    def __init__(self, matching: ScanMatching, start: Array, has_loops: bool = True) -> None:
        if has_loops:
            load_gtsam()
        self._closer = LoopCloser(matching) if has_loops else None
        self._start = np.asarray(start, np.float64)
        self._settling = np.array([0.0, 0.0, 0.0, 1.0])
        """Rotation since the start pose, before the flight, (4,)."""
        self.frames: list[Keyframe] = []
        self.poses: list[Array] = []
        """Poses of the keyframes in the map, (4,) x, y, z, yaw."""
        self.edges: list[PoseGraphEdge] = []
        self.closures = self.refused = 0
        self.session = 0
        self.is_placed = True
        """Whether the current session's pose in the map is known."""
        self.correction = KeyframePose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        self.relocalization = Relocalization()
        self._gathering = KeyframeBuilder()
        self._tried = -1_000

    def add(self, seen: SweepPoints, tracker: Tracker) -> bool:
        """Adds a sweep; returns whether it has led to a new keyframe."""
        if seen.is_drawn:
            self._gathering.add(seen.points, seen.kinds)
        if not self._is_due(tracker):
            return False
        state = tracker.state
        pose = state[:3].copy(), state[Q : Q + 4].copy(), state[G : G + 3].copy()
        frame = self._gathering.keyframe(tracker.time_ns, pose, tracker.travelled_m, self.session)
        if not self.frames:
            self._settling = tracker.settling.copy()
        self._append(frame, pose[2])
        self._look_for_loop_closures()
        self._correct(pose[2])
        return True

    def restart(self, doubted_since_ns: int | None = None, moved: Array | None = None) -> None:
        """Begins a new session after tracking was lost; its pose in the map is unknown.

        Keyframes since `doubted_since_ns` may already have wrong poses, and so may all those of a
        session that was never relocalized. `moved`: (2,) m in the odometry's frame, estimated
        displacement.
        """
        doubted = {
            k
            for k, frame in enumerate(self.frames)
            if frame.session == self.session
            and (not self.is_placed or _is_since(frame, doubted_since_ns))
        }
        hint = None
        if moved is not None and self.is_placed:
            hint = rotations.rotate(self.correction.attitude, np.array([*moved, 0.0]))[:2]
        self.relocalization.begin(doubted, hint)
        self.session += 1
        self.is_placed = False
        self._gathering = KeyframeBuilder()

    def pose(self, tracker: Tracker) -> tuple[Array, Array]:
        """Returns the current position (3,) and attitude (4,) in the map."""
        at = self.correction
        position = rotations.rotate(at.attitude, tracker.state[:3]) + at.position
        return position, rotations.multiply(at.attitude, tracker.state[Q : Q + 4])

    def sigmas(self, tracker: Tracker) -> Array:
        """Returns standard deviations (4,) of x, y, z, yaw in the map, from the distance flown.

        The distance counts from the last loop closure.
        """
        if not self.is_placed:
            return _ASTRAY
        known = 0.0
        for edge in self.edges:
            if edge.is_closure:
                # A loop closure resets the drift to that of the older keyframe.
                known = max(
                    known, self.frames[edge.to].travelled_m - self.frames[edge.origin].travelled_m
                )
        travelled_m = max(tracker.travelled_m - known, 0.0)
        return np.hypot(_PER_ROOT_M * math.sqrt(travelled_m), [0.02, 0.02, 0.02, 0.001])

    # -------------------------------------------------------------------------------- keyframes

    def _is_due(self, tracker: Tracker) -> bool:
        if not self.frames or self.frames[-1].session != self.session:
            return True
        last, state = self.frames[-1], tracker.state
        step_s = _STEP_S if self.is_placed else _LOST_STEP_S
        turn = rotations.multiply(state[Q : Q + 4], rotations.conjugate(last.attitude))
        return bool(
            norm(state[:3] - last.position) > _STEP_M
            or abs(float(rotations.yaw_of(turn))) > _STEP_RAD
            or tracker.time_ns - last.time_ns > step_s * NS_PER_S
        )

    def _append(self, frame: Keyframe, gravity: Array) -> None:
        if not self.frames:
            self.frames.append(frame)
            self.poses.append(self._begin_pose(gravity))
            return
        is_new = frame.session != self.frames[-1].session
        self.frames.append(frame)
        row = len(self.frames) - 1
        step = step_between(self.frames[row - 1], frame.position, frame.attitude, gravity)
        sigmas = _ASTRAY
        if not is_new:
            moved = norm(frame.position - self.frames[row - 1].position)
            sigmas = _PER_ROOT_M * math.sqrt(max(moved, 0.1))
        self.edges.append(PoseGraphEdge(row - 1, row, step, sigmas))
        self.poses.append(compose(self.poses[row - 1], step))
        self._level_again(gravity)

    def _begin_pose(self, gravity: Array) -> Array:
        """Returns the first keyframe's pose (4,) in the map, by the current estimate of gravity."""
        attitude = self.frames[0].attitude
        turn = turn_of_heading(level_of(gravity, attitude), attitude, self._settling)
        return np.add(self._start, [0.0, 0.0, 0.0, turn])

    def _level_again(self, gravity: Array) -> None:
        """Applies the current estimate of gravity to the last keyframes."""
        first = len(self.frames) - 1
        newest = self.frames[-1]
        while (
            first > 0
            and self.frames[first - 1].session == newest.session
            and newest.time_ns - self.frames[first - 1].time_ns < _RELEVEL_NS
        ):
            first -= 1
        if first == 0:
            self.poses[0] = self._begin_pose(gravity)
        for n, edge in enumerate(self.edges):
            if edge.is_closure or edge.origin < first:
                continue
            to = self.frames[edge.to]
            step = step_between(self.frames[edge.origin], to.position, to.attitude, gravity)
            self.edges[n] = edge._replace(measured=step)
            self.poses[edge.to] = compose(self.poses[edge.origin], step)

    # ---------------------------------------------------------------------------- loop closures

    def _look_for_loop_closures(self) -> None:
        if self._closer is None:
            return
        newest = len(self.frames) - 1
        if self.is_placed:
            found = self._find_near(newest)
        else:
            found = self.relocalization.find(self._closer, self.frames, self.poses)
        if found is None:
            return
        self.edges.append(found)
        self.closures += 1
        self.is_placed = True
        self.poses[newest] = compose(self.poses[found.origin], found.measured)
        self.poses = optimised(self.poses, self.edges)

    def _find_near(self, newest: int) -> PoseGraphEdge | None:
        """Matches the nearest old keyframe; at every second keyframe at most."""
        if newest - self._tried < 2 or self._closer is None:
            return None
        here = self.frames[newest]
        best, row = _NEAR_M, -1
        for k in range(newest):
            if here.travelled_m - self.frames[k].travelled_m < _APART_M:
                break
            if k in self.relocalization.doubted:
                continue
            away = float(np.hypot(*(self.poses[k] - self.poses[newest])[:2]))
            if away < best:
                best, row = away, k
        if row < 0:
            return None
        self._tried = newest
        travelled_m = here.travelled_m - self.frames[row].travelled_m
        drift = 3.0 * _PER_ROOT_M * math.sqrt(travelled_m)
        window = (0.4 + float(drift[0]), 0.01 + float(drift[3]))
        found = self._closer.match(self.frames, self.poses, newest, row, window)
        if found is None:
            self.refused += 1
            return None
        return found.edge

    def _correct(self, gravity: Array) -> None:
        """Updates the transform of the odometry's frame from the newest keyframe."""
        frame, pose = self.frames[-1], self.poses[-1]
        level = level_of(gravity, frame.attitude)
        turn = rotations.multiply(rotations.from_yaw(float(pose[3]) - level.yaw), level.attitude)
        self.correction = KeyframePose(pose[:3] - rotations.rotate(turn, frame.position), turn)


def _is_since(frame: Keyframe, time_ns: int | None) -> bool:
    return time_ns is not None and frame.time_ns > time_ns
