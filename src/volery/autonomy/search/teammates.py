"""Phases and positions that the UAVs of a search share."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from volery.core.arrays import Array


class SearchPhase(StrEnum):
    """Phase of a UAV in a search."""

    READY = "ready"
    """On the ground; waits for its team's messages."""
    CLIMB = "climb"
    """Climbs vertically to its layer."""
    ALOFT = "aloft"
    """In its layer, over its take-off position; waits until no teammate climbs."""
    SEARCH = "search"
    LOOK = "look"
    """Has detected something, stops over it and looks again."""
    COME = "come"
    """Flies to its position around the detection."""
    HOLD = "hold"
    HOME = "home"
    """Flies to above its take-off position."""
    OVER_HOME = "over_home"
    """Above its take-off position; waits until no teammate is under way."""
    LAND = "land"
    DONE = "done"
    """Has landed, or never flew."""
    DOWN = "down"
    """Fell or failed to take off; takes no further part."""
    LATE = "late"
    """Started when the others were flying already; stays on the ground."""


UNDER_WAY = frozenset(
    {SearchPhase.SEARCH, SearchPhase.LOOK, SearchPhase.COME, SearchPhase.HOLD, SearchPhase.HOME}
)
"""Between the two vertical legs: no teammate climbs or descends meanwhile."""
GOING_HOME = frozenset({SearchPhase.HOME, SearchPhase.OVER_HOME, SearchPhase.LAND})
"""The search is over."""
RISING = frozenset({SearchPhase.READY, SearchPhase.CLIMB})
ALOFT = UNDER_WAY | {SearchPhase.ALOFT, SearchPhase.OVER_HOME}
"""Flies by the node's velocity commands."""
CAN_COME = RISING | {
    SearchPhase.ALOFT,
    SearchPhase.SEARCH,
    SearchPhase.LOOK,
    SearchPhase.COME,
    SearchPhase.HOLD,
}
"""Accepts calls."""
ON_THE_WAY = RISING | {SearchPhase.ALOFT, SearchPhase.LOOK, SearchPhase.COME}
"""Will be at its position, or back in the search."""


@dataclass
class Teammate:
    """State of another UAV. Times are ns of the node's clock."""

    phase: SearchPhase | None = None
    """None: no message yet."""
    position: Array = field(default_factory=lambda: np.zeros(3))
    received_ns: int = 0

    def is_recent(self, now_ns: int, timeout_s: float) -> bool:
        """Returns whether the last message is recent."""
        return self.phase is not None and 0 <= now_ns - self.received_ns <= timeout_s * 1e9
