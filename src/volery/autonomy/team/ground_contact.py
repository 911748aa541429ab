"""Whether a UAV is airborne, on the ground or too low for planners, by its sonar and its pose."""

from __future__ import annotations

import math

from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import Range

STILL_M_S = 0.2
"""Speed below which a UAV counts as still."""
_LOW_M, _SONAR_TIMEOUT_S = 1.5, 1.0
"""Height by a recent sonar range below which planners plan nothing."""
_AIRBORNE_M = 0.6
"""Height above its last stand from which on a UAV flies again."""
_GROUND_M, _GROUND_S = 0.35, 2.0
"""A UAV that is still for this time with a sonar range below this one stands on the ground."""
_NEVER_NS = -1 << 62


class GroundContact(SavedAttributes):
    """The height of the last stand and the newest sonar range. All limits are modelling choices."""

    STATE = ("stand_m", "_low_since_ns", "_sonar_m", "_sonar_ns")

    def __init__(self) -> None:
        self.stand_m = 0.0
        """Height in the map of the ground on which the UAV stood last."""
        self._low_since_ns: int | None = None
        """Time since which the sonar reports the ground; None: it does not."""
        self._sonar_m, self._sonar_ns = math.inf, _NEVER_NS

    def on_range(self, message: Range, now_ns: int) -> None:
        """Takes a range of the sonar."""
        self._sonar_m, self._sonar_ns = max(float(message.range), 0.0), now_ns
        if not (message.range <= _GROUND_M):  # below the sonar's minimum it is -inf
            self._low_since_ns = None
        elif self._low_since_ns is None:
            self._low_since_ns = now_ns

    def is_low(self, height_m: float, now_ns: int) -> bool:
        """Whether a recent range is too short for planners; then takes the ground as the stand.

        height_m: of the UAV in the map.
        """
        is_low = now_ns - self._sonar_ns < _SONAR_TIMEOUT_S * NS_PER_S and self._sonar_m < _LOW_M
        if is_low:
            self.stand_m = height_m - self._sonar_m
        return is_low

    def is_above_stand(self, pose: OdometrySample) -> bool:
        """Whether a UAV that had landed flies again."""
        return bool(pose.position[2] > self.stand_m + _AIRBORNE_M)

    def has_come_down(self, pose: OdometrySample, now_ns: int) -> bool:
        """Whether the UAV has stood on the ground for a while, by its sonar."""
        if self._low_since_ns is None or norm(pose.velocity) >= STILL_M_S:
            return False
        return now_ns - self._low_since_ns > _GROUND_S * NS_PER_S
