"""Relocalization: matches the newest keyframe of a lost vehicle with all older ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.loop_closure import AROUND, LoopCloser
from volery.autonomy.slam.pose_graph import PoseGraphEdge, between, compose
from volery.core.arrays import Array

_WINDOW_M, _TURN_RAD = 12.0, 0.2
"""Max distance to an old keyframe, and from the gyroscope's heading; after all keyframes have been
tried so, any heading is tried.
"""
_TRIES, _LEAP = 6, 3
"""Keyframes tried at each new one, and their spacing, as neighbours look alike."""
_FRESH = 3
"""Keyframes since tracking was lost from which they are matched."""
_SAME = np.array([0.5, 0.5, 0.5, 0.05])
_OTHER, _HINT = 4.0 * _SAME, np.array([1.0, 1.0, 2.0, 0.1])
"""m and rad: differences within which hypotheses agree, beyond which they contradict each other,
and within which they agree with the hint.
"""
_SURE, _HINTED, _CLEARLY = 0.2, 0.12, 2.0
"""Min sum of the margins of all hypotheses of a pose; the amount that an agreeing hint adds; min
ratio to the sum of any other pose.

A single hypothesis may suffice. With few uprights any of them may be mistaken for any other, and
the hypotheses contradict each other.
"""


class PoseHypothesis(NamedTuple):
    """A hypothesis of the current session's pose in the map."""

    edge: PoseGraphEdge
    margin: float
    moved: Array
    """(4,) transform of the session."""


class Relocalization:
    """Progress of a relocalization, and the keyframes excluded from it."""

    def __init__(self) -> None:
        self.doubted: set[int] = set()
        """Keyframes with uncertain poses."""
        self._cursor = 0
        self._hypotheses: list[PoseHypothesis] = []
        self._hint: Array | None = None

    def begin(self, doubted: set[int], hint: Array | None = None) -> None:
        """Starts a relocalization; keyframes in `doubted` are excluded from now on.

        `hint`: (2,) m in the map, estimated displacement.
        """
        self.doubted |= doubted
        self._cursor = 0
        self._hypotheses = []
        self._hint = hint

    def find(
        self, closer: LoopCloser, frames: Sequence[Keyframe], poses: Sequence[Array]
    ) -> PoseGraphEdge | None:
        """Tries some keyframes of earlier sessions, newest first; returns a closure or None."""
        newest = len(frames) - 1
        session = frames[newest].session
        old = [
            k for k in range(newest, -1, -1)
            if frames[k].session != session and k not in self.doubted
        ]  # fmt: skip
        old = [row for first in range(_LEAP) for row in old[first::_LEAP]]
        if not old or sum(frame.session == session for frame in frames) < _FRESH:
            return None
        for _ in range(min(_TRIES, len(old))):
            row = old[self._cursor % len(old)]
            turn = _TURN_RAD if self._cursor < len(old) else math.pi
            self._cursor += 1
            found = closer.find(frames, poses, newest, row, (_WINDOW_M, turn))
            if found is not None:
                pose = compose(poses[row], found.edge.measured)
                moved = compose(pose, between(poses[newest], np.zeros(4)))
                self._hypotheses.append(PoseHypothesis(found.edge, found.margin, moved))
        return chosen(self._hypotheses, newest, poses[newest], self._hint)


def chosen(
    hypotheses: Sequence[PoseHypothesis], newest: int, pose: Array, hint: Array | None = None
) -> PoseGraphEdge | None:
    """Returns the best hypothesis of the newest keyframe, at `pose` (4,), if it is certain.

    `hint`: see `Relocalization.begin`.
    """
    if not hypotheses:
        return None
    poses = np.array([compose(hypothesis.moved, pose) for hypothesis in hypotheses])
    same = _within(poses[:, None], poses, _SAME)
    weights = np.array(
        [_weight([hypotheses[k] for k in np.flatnonzero(row).tolist()]) for row in same]
    )
    if hint is not None:
        weights += _HINTED * _within(poses, pose + np.append(hint, [0.0, 0.0]), _HINT)
    best = int(np.argmax(weights))
    others = weights[~_within(poses, poses[best], _OTHER)]
    fresh = [
        hypotheses[k]
        for k in np.flatnonzero(same[best]).tolist()
        if hypotheses[k].edge.to == newest
    ]
    if not fresh or weights[best] < max(_SURE, _CLEARLY * others.max(initial=0.0)):
        return None
    return max(fresh, key=lambda hypothesis: hypothesis.margin).edge


def _weight(hypotheses: Sequence[PoseHypothesis]) -> float:
    """Returns the sum of margins of the hypotheses whose older keyframes share no returns."""
    counted: list[PoseHypothesis] = []
    for hypothesis in sorted(hypotheses, key=lambda hypothesis: -hypothesis.margin):
        if all(abs(hypothesis.edge.origin - other.edge.origin) > 2 * AROUND for other in counted):
            counted.append(hypothesis)
    return sum(hypothesis.margin for hypothesis in counted)


def _within(one: Array, other: Array, limits: Array) -> NDArray[np.bool_]:
    """Returns whether poses (..., 4) differ by less than `limits` (4,)."""
    apart = one - other
    apart[..., 3] = np.remainder(apart[..., 3] + math.pi, math.tau) - math.pi
    return np.asarray((np.abs(apart) < limits).all(-1))
