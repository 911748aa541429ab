"""The stop before a landing: a UAV commanded to land in flight comes down elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample

_STILL_M_S = 0.3
"""Speed over ground below which a UAV has stopped (modelling choice)."""
_TIMEOUT_NS = 5_000_000_000
"""Time after which it has stopped as well as it can, in gusts (modelling choice)."""


@dataclass
class Stop:
    """A stop; while it lasts its owner commands a speed of zero."""

    since_ns: int | None = None
    """Time of its begin; None before."""

    @property
    def has_begun(self) -> bool:
        """Whether it has begun."""
        return self.since_ns is not None

    def begin(self, now_ns: int) -> None:
        """Begins the stop, if it has not begun."""
        if self.since_ns is None:
            self.since_ns = now_ns

    def is_over(self, pose: OdometrySample, now_ns: int) -> bool:
        """Returns whether the UAV has stopped, or cannot."""
        if self.since_ns is None:
            return False
        is_still = float(np.hypot(*pose.velocity[:2])) < _STILL_M_S
        return is_still or now_ns - self.since_ns > _TIMEOUT_NS
