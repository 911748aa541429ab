"""What the UAVs of a search know of each other: phases and places."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class SearchPhase(StrEnum):
    """Where in its search a UAV is."""

    READY = "ready"
    """On the ground; waits to hear of its team."""
    CLIMB = "climb"
    """Straight up to its layer."""
    ALOFT = "aloft"
    """In its layer, over its place of take-off; waits until nobody climbs any more."""
    SEARCH = "search"
    LOOK = "look"
    """Has seen something, stops over it and looks again."""
    COME = "come"
    """On the way to its place around what was found."""
    HOLD = "hold"
    HOME = "home"
    """On the way to over its place of take-off."""
    OVER_HOME = "over_home"
    """There; waits until nobody is under way any more."""
    LAND = "land"
    DONE = "done"
    """Has landed, or never flew."""
    DOWN = "down"
    """Came down against its will, or never came up; takes no further part."""
    LATE = "late"
    """Came when the others were flying already; stays on the ground."""


UNDER_WAY = frozenset(
    {SearchPhase.SEARCH, SearchPhase.LOOK, SearchPhase.COME, SearchPhase.HOLD, SearchPhase.HOME}
)
"""Between the two vertical legs: nobody climbs or sinks while a teammate is here."""
GOING_HOME = frozenset({SearchPhase.HOME, SearchPhase.OVER_HOME, SearchPhase.LAND})
"""The search is over."""
RISING = frozenset({SearchPhase.READY, SearchPhase.CLIMB})
ALOFT = UNDER_WAY | {SearchPhase.ALOFT, SearchPhase.OVER_HOME}
"""Flies by the node's own velocity commands."""
CAN_COME = RISING | {
    SearchPhase.ALOFT,
    SearchPhase.SEARCH,
    SearchPhase.LOOK,
    SearchPhase.COME,
    SearchPhase.HOLD,
}
"""A call is heeded."""
ON_THE_WAY = RISING | {SearchPhase.ALOFT, SearchPhase.LOOK, SearchPhase.COME}
"""Will be at its place, or back in the search, some time."""


@dataclass
class Teammate:
    """What is known of another UAV. Times are ns of the node's clock."""

    phase: SearchPhase | None = None
    """None: never heard of."""
    position: Array = field(default_factory=lambda: np.zeros(3))
    heard_ns: int = 0

    def is_heard(self, now_ns: int, patience_s: float) -> bool:
        """Whether it has told something lately."""
        return self.phase is not None and 0 <= now_ns - self.heard_ns <= patience_s * 1e9
