"""Detects kidnapping: compares the newest returns with those just before, not with the map.

A comparison with the map detects displacements poorly: in flight, many returns are new to the map
as well, and among many trunks a large part of any sweep matches something. From one instant to the
next few returns are new.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.relocalization_kernels import count_drawn, draw, fractions_around
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S

_NOW_NS, _BEFORE_NS = NS_PER_S // 4, 2 * NS_PER_S
"""Duration of the instant that is checked, and of the time before it that it is compared with."""
_ENOUGH = 40
"""Min number of returns of upright objects, now and before, for a comparison."""
_WELL_FRACTION, _NOTHING = 0.8, 0.15
"""Continuing fraction from which all is well, and below which the vehicle was surely moved."""
_BETTER, _ALONE = 0.25, 0.13
"""Margins by which one other position must fit better than the present one, and than any third one.

Returns from a slope move along it as the vehicle tilts, and then fit at many positions. In 30,000
instants of flights through forests, dense and sparse, no other position fitted so; the min fraction
was 0.20. In the dense forest 84 of 90 displacements by 2.8 to 5 m and 35 of 36 by 1.5 m were
detected at once, in the sparse one 60 of 75 and 26 of 33, as long as enough was in range.
"""
_IMAGE_SIDE, _CELL_M = 400, 0.2
_STEP_M, _NEAREST_M, _MAX_STEP_M = 0.4, 1.1, 6.0
"""Spacing and range of the other positions; nearer ones may look like the present one."""


def _ring() -> Array:
    line = np.arange(-_MAX_STEP_M, _MAX_STEP_M + 0.01, _STEP_M)
    steps = np.stack(np.meshgrid(line, line), 2).reshape(-1, 2)
    away = np.hypot(*steps.T)
    tried: Array = steps[(away > _NEAREST_M) & (away < _MAX_STEP_M + 0.1)]
    return tried


_STEPS = _ring()
"""(K, 2) m: offsets of the positions that are tried."""


class _Glance(NamedTuple):
    """Upright returns of one sweep."""

    time_ns: int
    is_level: bool
    points: Array
    """(K, 2) m in the frame of the odometry."""


class _View(NamedTuple):
    """Returns of a period, in m from the vehicle's present position."""

    points: Array
    """(K, 2): returns of the level LIDAR in its newest instant."""
    image: NDArray[np.uint8]
    """Occupancy by all LIDARs' returns of the whole period."""


class KidnappingDetector:
    """Holds the last seconds of upright returns; `is_broken` once they no longer continue.

    Sweeps of a level LIDAR, which observes the same objects again and again, are compared with the
    sweeps of all LIDARs.
    """

    def __init__(self) -> None:
        self.is_broken = False
        self.moved: Array | None = None
        """(2,) m, estimated displacement in the frame of the odometry; None: unknown."""
        self._glances: deque[_Glance] = deque()

    def take(self, time_ns: int, points: Array, here: Array, *, is_level: bool) -> None:
        """Adds the positions (K, 2) of a sweep's returns, seen from `here` (2,)."""
        self._glances.append(_Glance(time_ns, is_level, points))
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
        views = _View(new, _image(now, here)), _View(old, _image(before, here))
        fractions = _fractions(*views)
        if max(fractions) < _WELL_FRACTION:
            self.moved = _only_other_position(*views, 0.5 * sum(fractions))
            self.is_broken = self.moved is not None or max(fractions) < _NOTHING


def _fractions(now: _View, before: _View) -> tuple[float, float]:
    """Returns the fraction of new returns seen before, and of old returns still seen."""
    onwards = count_drawn(now.points, _CELL_M, before.image) / len(now.points)
    back = count_drawn(before.points, _CELL_M, now.image) / len(before.points)
    return onwards, back


def _only_other_position(now: _View, before: _View, here: float) -> Array | None:
    """Returns the step (2,) m to the only position that fits far better than `here`, if any."""
    fractions = np.empty(len(_STEPS))
    fractions_around(now.points, before.image, before.points, now.image, _CELL_M, _STEPS, fractions)
    best = int(np.argmax(fractions))
    away = np.hypot(*(_STEPS - _STEPS[best]).T)
    third = max(here, float(fractions[away > _NEAREST_M].max()))
    is_clear = fractions[best] > max(here + _BETTER, third + _ALONE)
    return _STEPS[best].copy() if is_clear else None


def _level(glances: list[_Glance], here: Array) -> Array:
    return _all([glance for glance in glances if glance.is_level], here)


def _all(glances: list[_Glance], here: Array) -> Array:
    return np.concatenate([np.zeros((0, 2)), *(glance.points for glance in glances)]) - here


def _image(glances: list[_Glance], here: Array) -> NDArray[np.uint8]:
    image = np.zeros((_IMAGE_SIDE, _IMAGE_SIDE), np.uint8)
    draw(_all(glances, here), _CELL_M, image)
    return image
