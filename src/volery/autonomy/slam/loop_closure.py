"""Loop closures: matches sets of keyframes with older ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.matching_kernels import UPRIGHT
from volery.autonomy.slam.pose_graph import PoseGraphEdge, between
from volery.autonomy.slam.relocalization_kernels import draw, draw_maps, refine, search
from volery.autonomy.slam.settings import ScanMatching
from volery.core.arrays import Array

_IMAGE_SIDE = 400
_ROUNDS = 8
_BEFORE, AROUND = 2, 3
"""Keyframes before the newest one, and on both sides of the older one, that are matched."""
_MIN_FRACTION, _MIN_MATCHES = 0.42, 30.0
"""Min fraction and number of matched uprights, weighted by how well they fit."""
_MIN_FRACTION_LOST, _MIN_MATCHES_LOST = 0.2, 80.0
_MIN_MARGIN_LOST = 0.05
"""Margin by which the found position must fit better than all others.

Of 480 pairs of keyframes of flights through the forest, matched within 12 m and 0.2 rad, pairs that
were that near had margins of 0.22 in the median, nine of ten above 0.12, and nine of ten a fraction
of 0.21; pairs farther apart, which fitted somewhere nevertheless, had margins of 0.10 at most, but
fractions of up to 0.39, in a thicket.
"""
_APART_M = 1.5
"""Distance from the best position beyond which a position is another one."""
_MIN_INFORMATION = 2000.0
"""1/m^2, min information on the position in the weakest direction: that of three trunks, hit ten
times each.
"""
_FLOOR = np.array([0.06, 0.06, 0.06, 0.004])
"""Min standard deviations of a closure, for the map's own errors."""


class LoopClosure(NamedTuple):
    """A loop closure and its quality."""

    edge: PoseGraphEdge
    fraction: float
    met: float
    margin: float
    """Margin over every other position that was tried."""


class _Trial(NamedTuple):
    """Resolution of a search: cell size of the occupancy image, angular step, number of returns."""

    cell_m: float
    step_rad: float
    returns: int


_NEARBY, _ANYWHERE, _ANY_HEADING = (
    _Trial(0.2, 0.0125, 150), _Trial(0.4, 0.035, 150), _Trial(0.4, 0.035, 75)
)  # fmt: skip


class _Pair(NamedTuple):
    """Sets to match: returns (K, 3) in the axes of a keyframe, and their kinds (K,)."""

    query: Array
    query_kinds: NDArray[np.int8]
    known: Array
    known_kinds: NDArray[np.int8]


class LoopCloser:
    """Matches sets of keyframes; `poses` are their poses in the map, (4,) each."""

    def __init__(self, matching: ScanMatching) -> None:
        self._matching = matching
        self._maps = Submaps.empty()
        self._image = np.zeros((_IMAGE_SIDE, _IMAGE_SIDE), np.uint8)

    def match(
        self,
        frames: Sequence[Keyframe],
        poses: Sequence[Array],
        newest: int,
        older: int,
        window: tuple[float, float],
    ) -> LoopClosure | None:
        """Returns the newest keyframe relative to an older one; None if they do not fit.

        `window`: max error of the newest one's estimated pose, m and rad.
        """
        pair = _pair(frames, poses, newest, older)
        if pair is None:
            return None
        predicted = between(poses[older], poses[newest])
        span = np.array([window[0], window[0], window[1]])
        found, margin = self._searched(pair, predicted[[0, 1, 3]], span, _NEARBY)
        pose = np.array([found[0], found[1], predicted[2], found[2]])
        closure = self._refined(pose, pair, (older, newest), margin)
        fits = (
            closure is not None
            and closure.fraction >= _MIN_FRACTION
            and closure.met >= _MIN_MATCHES
        )
        return closure if fits else None

    def find(
        self,
        frames: Sequence[Keyframe],
        poses: Sequence[Array],
        newest: int,
        older: int,
        window: tuple[float, float],
    ) -> LoopClosure | None:
        """Returns a hypothesis for a lost vehicle's newest keyframe relative to an older one.

        `window`: max distance from the older one, m, and from the estimated heading, rad. None if
        no pose fits.
        """
        pair = _pair(frames, poses, newest, older)
        if pair is None:
            return None
        seems = np.array([0.0, 0.0, between(poses[older], poses[newest])[3]])
        span = np.array([window[0], window[0], window[1]])
        trial = _ANY_HEADING if window[1] >= math.pi else _ANYWHERE
        found, margin = self._searched(pair, seems, span, trial)
        pose = np.array([found[0], found[1], _height(pair), found[2]])
        closure = self._refined(pose, pair, (older, newest), margin)
        fits = (
            closure is not None
            and closure.fraction >= _MIN_FRACTION_LOST
            and closure.met >= _MIN_MATCHES_LOST
            and margin >= _MIN_MARGIN_LOST
        )
        return closure if fits else None

    def _searched(
        self, pair: _Pair, middle: Array, span: Array, trial: _Trial
    ) -> tuple[Array, float]:
        """Returns the best pose (3,) x, y, yaw, and its margin over any other position."""
        uprights = pair.query[pair.query_kinds == UPRIGHT]
        known = pair.known[pair.known_kinds == UPRIGHT]
        draw(np.ascontiguousarray(known[:, :2]), trial.cell_m, self._image)
        thin = np.ascontiguousarray(uprights[:: max(len(uprights) // trial.returns, 1), :2])
        side = 2 * math.ceil(span[0] / trial.cell_m) + 1
        found, fractions = np.zeros(3), np.empty((side, side))
        best = search(
            thin, self._image, trial.cell_m, middle, span, trial.step_rad, found, fractions
        )
        rows, columns = np.indices(fractions.shape)
        row, column = np.unravel_index(int(np.argmax(fractions)), fractions.shape)
        away = trial.cell_m * np.hypot(rows - row, columns - column) > _APART_M
        return found, best - float(fractions[away].max(initial=0.0))

    def _refined(
        self, pose: Array, pair: _Pair, rows: tuple[int, int], margin: float
    ) -> LoopClosure | None:
        maps, m = self._maps, self._matching
        draw_maps(np.ascontiguousarray(pair.known), pair.known_kinds, maps)
        information, sums = np.zeros((4, 4)), np.zeros(4)
        done = refine(
            pose, np.ascontiguousarray(pair.query), pair.query_kinds, maps,
            m.upright_sigma_m**2, m.ground_sigma_m**2, _ROUNDS, information, sums,
        )  # fmt: skip
        weakest = float(np.linalg.eigvalsh(information[:2, :2])[0])
        if not done or weakest < _MIN_INFORMATION:
            return None
        spread = np.linalg.inv(m.trust * information + 1e-3 * np.eye(4))
        sigmas = np.hypot(np.sqrt(np.maximum(np.diag(spread), 0.0)), _FLOOR)
        if sums[2] < 20.0:
            sigmas[2] = 10.0  # no common ground: the height stays open
        pose[3] = math.remainder(pose[3], math.tau)
        edge = PoseGraphEdge(rows[0], rows[1], pose.copy(), sigmas, True)
        return LoopClosure(edge, float(sums[0] / max(sums[1], 1.0)), float(sums[0]), margin)


def _pair(
    frames: Sequence[Keyframe], poses: Sequence[Array], newest: int, older: int
) -> _Pair | None:
    """Returns the newest keyframes and those around an older one; None for too few returns."""
    query = _around(frames, poses, newest, range(newest - _BEFORE, newest + 1))
    if np.count_nonzero(query[1] == UPRIGHT) < _MIN_MATCHES:
        return None
    others = range(older - AROUND, min(older + AROUND + 1, newest - _BEFORE))
    return _Pair(*query, *_around(frames, poses, older, others))


def _height(pair: _Pair) -> float:
    """Returns how much higher over ground the newest keyframe was than the older one, m."""
    query = pair.query[pair.query_kinds != UPRIGHT]
    known = pair.known[pair.known_kinds != UPRIGHT]
    if not len(known) or not len(query):
        return 0.0
    return float(np.median(known[:, 2]) - np.median(query[:, 2]))


def _around(
    frames: Sequence[Keyframe], poses: Sequence[Array], row: int, rows: range
) -> tuple[Array, NDArray[np.int8]]:
    """Returns the returns of keyframes of one session in the axes of one of them."""
    points, kinds = [], []
    for k in rows:
        if not 0 <= k < len(frames) or frames[k].session != frames[row].session:
            continue
        step = between(poses[row], poses[k])
        c, s = math.cos(step[3]), math.sin(step[3])
        own = frames[k].points
        turned = np.stack(
            [c * own[:, 0] - s * own[:, 1], s * own[:, 0] + c * own[:, 1], own[:, 2]], 1
        )
        points.append(turned + step[:3])
        kinds.append(frames[k].kinds)
    if not points:
        return np.zeros((0, 3)), np.zeros(0, np.int8)
    return np.concatenate(points), np.concatenate(kinds)
