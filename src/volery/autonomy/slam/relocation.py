"""Finding its place in the map again: the newest keyframe of one that is lost, among all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.loop_closing import AROUND, Closure, LoopCloser
from volery.autonomy.slam.pose_graph import Edge, between, compose

Array = NDArray[np.float64]

_REACH_M = 12.0
"""So far from an old keyframe it may be."""
_TRIES, _LEAP = 4, 3
"""Keyframes tried at each new one; so many apart, as neighbours look alike."""
_FRESH = 3
"""Keyframes since it was lost from which on they are matched."""
_AGREED = np.array([0.5, 0.5, 0.5, 0.05])
"""m and rad within which guesses from two keyframes are of one place."""
_GOOD, _GOOD_SHARE = 3, 0.2
"""So many guesses that share so much are enough also where they have returns in common."""


class _Guess(NamedTuple):
    """A pair of keyframes that fits roughly."""

    older: int
    newer: int
    share: float
    moved: Array
    """(4,) what would move the present session to where it says."""


class Relocation:
    """What one that is lost has tried so far, and which keyframes nobody can be found by."""

    def __init__(self) -> None:
        self.doubted: set[int] = set()
        """Keyframes of which it is not sure where they are."""
        self._cursor = 0
        self._guesses: list[_Guess] = []

    def begin(self, doubted: set[int]) -> None:
        """It was lost just now, and so is where some more keyframes are."""
        self.doubted |= doubted
        self._cursor = 0
        self._guesses = []

    def find(
        self, closer: LoopCloser, frames: Sequence[Keyframe], poses: Sequence[Array]
    ) -> Edge | None:
        """Some of the keyframes of earlier sessions, in turn, the latest of them first."""
        newest = len(frames) - 1
        session = frames[newest].session
        old = [
            k for k in range(newest, -1, -1)
            if frames[k].session != session and k not in self.doubted
        ]  # fmt: skip
        old = [row for first in range(_LEAP) for row in old[first::_LEAP]]
        if not old or sum(frame.session == session for frame in frames) < _FRESH:
            return None
        best = None
        for _ in range(min(_TRIES, len(old))):
            row = old[self._cursor % len(old)]
            self._cursor += 1
            found = closer.match(frames, poses, newest, row, (_REACH_M, math.pi))
            if found is None or not (found.is_sure or self._is_confirmed(found, poses)):
                continue
            if best is None or found.met > best.met:
                best = found
        return None if best is None else best.edge

    def _is_confirmed(self, found: Closure, poses: Sequence[Array]) -> bool:
        """Whether other guesses put the newest keyframe where this one does; it is kept, too."""
        edge = found.edge
        newest = poses[edge.to]
        place = compose(poses[edge.origin], edge.measured)
        alike = [guess for guess in self._guesses if _is_same(compose(guess.moved, newest), place)]
        moved = compose(place, between(newest, np.zeros(4)))
        guess = _Guess(edge.origin, edge.to, found.share, moved)
        self._guesses.append(guess)
        return _are_independent([*alike, guess])


def _are_independent(alike: list[_Guess]) -> bool:
    """Whether guesses of one place say more than one of them does."""
    newest = alike[-1]
    if any(abs(guess.older - newest.older) > 2 * AROUND for guess in alike):
        return True
    good = [guess for guess in alike if guess.share >= _GOOD_SHARE]
    sides = {guess.older for guess in good}, {guess.newer for guess in good}
    return len(good) >= _GOOD and min(map(len, sides)) > 1


def _is_same(one: Array, other: Array) -> bool:
    """Whether two poses (4,) are nearly the same."""
    apart = one - other
    apart[3] = math.remainder(float(apart[3]), math.tau)
    return bool((np.abs(apart) < _AGREED).all())
