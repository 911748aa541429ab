"""Finding its place in the map again: the newest keyframe of one that is lost, among all."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.loop_closing import AROUND, LoopCloser
from volery.autonomy.slam.pose_graph import Edge, between, compose

Array = NDArray[np.float64]

_REACH_M, _TURN_RAD = 12.0, 0.2
"""How far it may be from an old keyframe, and from the heading that the gyroscope tells; when all
keyframes have been tried so, any heading is tried.
"""
_TRIES, _LEAP = 6, 3
"""Keyframes tried at each new one; so many apart, as neighbours look alike."""
_FRESH = 3
"""Keyframes since it was lost from which on they are matched."""
_AGREED = np.array([0.5, 0.5, 0.5, 0.05])
"""m and rad within which guesses from two keyframes are of one place."""


class Relocation:
    """What one that is lost has tried so far, and which keyframes nobody can be found by."""

    def __init__(self) -> None:
        self.doubted: set[int] = set()
        """Keyframes of which it is not sure where they are."""
        self._cursor = 0
        self._guesses: list[tuple[int, Array]] = []
        """Keyframes that fit roughly, and what would move the session to where they say."""

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
            turn = _TURN_RAD if self._cursor < len(old) else math.pi
            self._cursor += 1
            found = closer.find(frames, poses, newest, row, (_REACH_M, turn))
            if found is None or not (found.is_sure or self._is_confirmed(found.edge, poses)):
                continue
            if best is None or found.margin > best.margin:
                best = found
        return None if best is None else best.edge

    def _is_confirmed(self, guess: Edge, poses: Sequence[Array]) -> bool:
        """Whether a guess from elsewhere puts the newest keyframe there, too; this one is kept."""
        newest = poses[guess.to]
        place = compose(poses[guess.origin], guess.measured)
        confirmed = any(
            abs(row - guess.origin) > 2 * AROUND and _is_same(compose(moved, newest), place)
            for row, moved in self._guesses
        )
        self._guesses.append((guess.origin, compose(place, between(newest, np.zeros(4)))))
        return confirmed


def _is_same(one: Array, other: Array) -> bool:
    """Whether two poses (4,) are nearly the same."""
    apart = one - other
    apart[3] = math.remainder(float(apart[3]), math.tau)
    return bool((np.abs(apart) < _AGREED).all())
