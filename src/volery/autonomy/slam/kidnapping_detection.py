"""Whether what is seen goes on as it was: beside what was seen just before, not beside a map.

A map says little of a displacement: much that comes into sight is new to it, too, and among many
trunks a good part of any sweep meets something. From one instant to the next little is new.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.relocalization_kernels import count_drawn, draw, shares_around
from volery.core.clock import NS_PER_S

Array = NDArray[np.float64]

_NOW_NS, _BEFORE_NS = NS_PER_S // 4, 2 * NS_PER_S
"""The instant that is judged, and the time before it with which it is compared."""
_ENOUGH = 40
"""Returns of things that stand, now and before, from which on their shares say something."""
_MOST, _NOTHING = 0.8, 0.15
"""Shares that go on from which all is well, and below which it is surely elsewhere."""
_BETTER, _ALONE = 0.25, 0.13
"""By how much one other place must fit better than the present one, and than any third one.

What is seen of a slope moves along it as the vehicle tilts, and then fits at many places. In 30,000
instants of flights through forests, dense and sparse, no other place fitted so; the share fell to
0.20 at the least. In the dense one 84 of 90 displacements by 2.8 to 5 m and 35 of 36 by 1.5 m were
noticed at once, in the sparse one 60 of 75 and 26 of 33, as long as enough was in reach.
"""
_PICTURE, _CELL_M = 400, 0.2
_STEP_M, _NEAREST_M, _FARTHEST_M = 0.4, 1.1, 6.0
"""Of the other places that are tried; nearer ones may look like the present one."""


def _ring() -> Array:
    line = np.arange(-_FARTHEST_M, _FARTHEST_M + 0.01, _STEP_M)
    steps = np.stack(np.meshgrid(line, line), 2).reshape(-1, 2)
    away = np.hypot(*steps.T)
    tried: Array = steps[(away > _NEAREST_M) & (away < _FARTHEST_M + 0.1)]
    return tried


_STEPS = _ring()
"""(K, 2) m to the places that are tried."""


class _Glance(NamedTuple):
    """What one sweep saw of things that stand."""

    time_ns: int
    is_level: bool
    places: Array
    """(K, 2) m in the frame of the odometry."""


class _View(NamedTuple):
    """What was seen in some time, in m from where the vehicle is now."""

    places: Array
    """(K, 2) of the level LIDAR's returns in an instant of it."""
    picture: NDArray[np.uint8]
    """Where any LIDAR saw something in all of it."""


class KidnappingDetector:
    """The last seconds of what stands around; `is_broken` once it was exchanged for something else.

    A level LIDAR's sweeps, which see the same things again and again, are judged by what all
    sweeps have seen.
    """

    def __init__(self) -> None:
        self.is_broken = False
        self.moved: Array | None = None
        """(2,) m by which it was displaced then, in the frame of the odometry, if that is known."""
        self._glances: deque[_Glance] = deque()

    def take(self, time_ns: int, places: Array, here: Array, *, is_level: bool) -> None:
        """Go on with the places (K, 2) of a sweep's returns, seen from `here` (2,)."""
        self._glances.append(_Glance(time_ns, is_level, places))
        while self._glances[0].time_ns <= time_ns - _NOW_NS - _BEFORE_NS:
            self._glances.popleft()
        if is_level and not self.is_broken:
            self._compare(time_ns - _NOW_NS, here)

    def _compare(self, since_ns: int, here: Array) -> None:
        now = [glance for glance in self._glances if glance.time_ns > since_ns]
        before = [glance for glance in self._glances if glance.time_ns <= since_ns]
        last = [glance for glance in before if glance.time_ns > since_ns - _NOW_NS]
        new, old = _level(now, here), _level(last, here)
        if len(new) < _ENOUGH or len(old) < _ENOUGH:
            return
        views = _View(new, _picture(now, here)), _View(old, _picture(before, here))
        shares = _shares(*views)
        if max(shares) < _MOST:
            self.moved = _only_other_place(*views, 0.5 * sum(shares))
            self.is_broken = self.moved is not None or max(shares) < _NOTHING


def _shares(now: _View, before: _View) -> tuple[float, float]:
    """Of what is seen now that was seen before, and of what was seen before that is seen now."""
    onwards = count_drawn(now.places, _CELL_M, before.picture) / len(now.places)
    back = count_drawn(before.places, _CELL_M, now.picture) / len(before.places)
    return onwards, back


def _only_other_place(now: _View, before: _View, here: float) -> Array | None:
    """Step (2,) m to where it fits far better than `here`, and than anywhere else."""
    shares = np.empty(len(_STEPS))
    shares_around(now.places, before.picture, before.places, now.picture, _CELL_M, _STEPS, shares)
    best = int(np.argmax(shares))
    away = np.hypot(*(_STEPS - _STEPS[best]).T)
    third = max(here, float(shares[away > _NEAREST_M].max()))
    is_clear = shares[best] > max(here + _BETTER, third + _ALONE)
    return _STEPS[best].copy() if is_clear else None


def _level(glances: list[_Glance], here: Array) -> Array:
    return _all([glance for glance in glances if glance.is_level], here)


def _all(glances: list[_Glance], here: Array) -> Array:
    return np.concatenate([np.zeros((0, 2)), *(glance.places for glance in glances)]) - here


def _picture(glances: list[_Glance], here: Array) -> NDArray[np.uint8]:
    picture = np.zeros((_PICTURE, _PICTURE), np.uint8)
    draw(_all(glances, here), _CELL_M, picture)
    return picture
