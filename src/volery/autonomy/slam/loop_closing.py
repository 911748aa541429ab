"""Seeing places again: keyframes matched with those that lie near, or with all where it is lost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.local_maps import Maps
from volery.autonomy.slam.matching_kernels import UPRIGHT
from volery.autonomy.slam.pose_graph import Edge, between, compose
from volery.autonomy.slam.relocation_kernels import draw, draw_maps, refine, search
from volery.autonomy.slam.settings import Matching

Array = NDArray[np.float64]

_PICTURE, _FINE_M, _COARSE_M = 400, 0.2, 0.4
_TRIED, _TRIED_LOST = 150, 75
"""Returns that are tried everywhere."""
_ROUNDS = 8
_BEFORE, AROUND = 2, 3
"""Keyframes before the newest one, and on both sides of the older one, that are matched."""
_LEAST_SHARE, _LEAST_MET = 0.42, 30.0
"""Share and number of uprights that must be met again, each counted by how well."""
_LEAST_SHARE_LOST, _GUESSED_SHARE_LOST, _LEAST_MET_LOST = 0.3, 0.15, 80.0
"""Of one that is lost, to be sure, and to be a guess that another one may confirm.

Of 450 pairs of a flight through the forest, matched at all headings within 12 m, those that lay so
near had shares of 0.33 in the median, nine of ten above 0.2, and one of 86 was wrong; of those that
lay farther apart, and so were wrong, nine of ten had less than 0.12, and all less than 0.23.
"""
_LEAST_INFORMATION = 2000.0
"""1/m^2, of the place in the weakest direction: what three trunks tell, seen ten times each."""
_FLOOR = np.array([0.06, 0.06, 0.06, 0.004])
"""Least standard deviation of a closure: what the map's own errors are."""


class Closure(NamedTuple):
    """A place seen again, and how surely."""

    edge: Edge
    share: float
    met: float
    is_sure: bool = True
    """Whether it needs no other one that agrees; without, only where it is lost."""


class LoopCloser:
    """Matches sets of keyframes; `poses` are theirs in the map, (4,) each."""

    def __init__(self, matching: Matching) -> None:
        self._matching = matching
        self._maps = Maps()
        self._picture = np.zeros((_PICTURE, _PICTURE), np.uint8)

    def match(
        self,
        frames: Sequence[Keyframe],
        poses: Sequence[Array],
        newest: int,
        older: int,
        reach: tuple[float, float],
    ) -> Closure | None:
        """The newest keyframe as seen from an older one; None where they do not fit.

        Of one that is lost (a reach of all headings) it may be no more than a guess.

        `reach`: how far the newest one may be from where it seems to be, m and rad.
        """  # fmt: skip
        query, query_kinds = _around(frames, poses, newest, range(newest - _BEFORE, newest + 1))
        others = range(older - AROUND, min(older + AROUND + 1, newest - _BEFORE))
        known, known_kinds = _around(frames, poses, older, others)
        guess = between(poses[older], poses[newest])
        standing = query[query_kinds == UPRIGHT]
        if len(standing) < _LEAST_MET:
            return None
        lost = reach[1] >= math.pi
        cell = _COARSE_M if lost else _FINE_M
        draw(np.ascontiguousarray(known[known_kinds == UPRIGHT][:, :2]), cell, self._picture)
        some = _TRIED_LOST if lost else _TRIED
        thin = np.ascontiguousarray(standing[:: max(len(standing) // some, 1), :2])
        found = np.zeros(3)
        middle = np.zeros(3) if lost else guess[[0, 1, 3]]
        span = np.array([reach[0], reach[0], reach[1]])
        search(thin, self._picture, cell, middle, span, 0.035 if lost else 0.0125, found)
        pose = np.array([found[0], found[1], guess[2], found[2]])
        if lost:
            pose[2] = self._height(known, known_kinds, query, query_kinds)
        return self._refined(
            pose, (known, known_kinds), (query, query_kinds), (older, newest), lost
        )

    def _refined(
        self, pose: Array, known: tuple[Array, NDArray[np.int8]],
        query: tuple[Array, NDArray[np.int8]], rows: tuple[int, int], lost: bool,
    ) -> Closure | None:  # fmt: skip
        maps, m = self._maps, self._matching
        draw_maps(
            np.ascontiguousarray(known[0]), known[1], maps.upright_keys, maps.cells,
            maps.ground_keys, maps.sums,
        )  # fmt: skip
        information, told = np.zeros((4, 4)), np.zeros(4)
        done = refine(
            pose, np.ascontiguousarray(query[0]), query[1], maps.upright_keys, maps.cells,
            maps.ground_keys, maps.sums, m.upright_sigma_m**2, m.ground_sigma_m**2, _ROUNDS,
            information, told,
        )  # fmt: skip
        share = told[0] / max(told[1], 1.0)
        weakest = float(np.linalg.eigvalsh(information[:2, :2])[0])
        is_sure = share >= (_LEAST_SHARE_LOST if lost else _LEAST_SHARE)
        is_guess = lost and share >= _GUESSED_SHARE_LOST
        met = _LEAST_MET_LOST if lost else _LEAST_MET
        if not done or told[0] < met or weakest < _LEAST_INFORMATION:
            return None
        if not (is_sure or is_guess):
            return None
        spread = np.linalg.inv(m.trust * information + 1e-3 * np.eye(4))
        sigmas = np.hypot(np.sqrt(np.maximum(np.diag(spread), 0.0)), _FLOOR)
        if told[2] < 20.0:
            sigmas[2] = 10.0  # no ground in common: the height stays open
        pose[3] = math.remainder(pose[3], math.tau)
        edge = Edge(rows[0], rows[1], pose.copy(), sigmas, True)
        return Closure(edge, float(share), float(told[0]), bool(is_sure))

    def _height(
        self, known: Array, known_kinds: NDArray[np.int8], query: Array,
        query_kinds: NDArray[np.int8],
    ) -> float:  # fmt: skip
        """How much higher the newest frame flew over its ground than the older one over its own."""
        low = [points[kinds != UPRIGHT] for points, kinds in
               ((known, known_kinds), (query, query_kinds))]  # fmt: skip
        if not len(low[0]) or not len(low[1]):
            return 0.0
        return float(np.median(low[0][:, 2]) - np.median(low[1][:, 2]))


def _around(
    frames: Sequence[Keyframe], poses: Sequence[Array], row: int, rows: range
) -> tuple[Array, NDArray[np.int8]]:
    """Returns of some keyframes of one session in the axes of one of them."""
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


__all__ = ["Closure", "LoopCloser", "compose"]
