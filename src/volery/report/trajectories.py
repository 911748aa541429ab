"""The trajectory of one UAV: poses by time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from volery.core.arrays import Array
from volery.results.alignment import at_times

_LONGEST_GAP_S = 0.5
"""Gap between poses above which there is no interpolation, s."""


@dataclass(frozen=True)
class RecordedTrajectory:
    """N poses with increasing times."""

    time_s: Array
    """(N,) s."""
    position: Array
    """(N, 3) m"""
    attitude: Array
    """(N, 4) x y z w"""

    @classmethod
    def of_rows(cls, rows: Sequence[Sequence[float]]) -> RecordedTrajectory:
        """Returns the trajectory of rows of time, position and attitude."""
        table = np.array(rows, np.float64).reshape(-1, 8)
        return cls(table[:, 0], table[:, 1:4], table[:, 4:])

    @property
    def lasts_s(self) -> float:
        """Time from the first pose to the last one, s."""
        return float(self.time_s[-1] - self.time_s[0]) if len(self.time_s) else 0.0

    @property
    def length_m(self) -> float:
        """Horizontal length, m."""
        return float(np.hypot(*np.diff(self.position[:, :2], axis=0).T).sum())

    def positions_at(self, wanted_s: Array) -> Array:
        """Interpolates positions (M, 3) at times (M,); NaN outside of the poses and in gaps."""
        found = np.full((len(wanted_s), 3), np.nan)
        if len(self.time_s) < 2:
            return found
        after = np.clip(np.searchsorted(self.time_s, wanted_s), 1, len(self.time_s) - 1)
        known = self.time_s[after] - self.time_s[after - 1] <= _LONGEST_GAP_S
        known &= (wanted_s >= self.time_s[0]) & (wanted_s <= self.time_s[-1])
        found[known] = at_times(self.time_s, self.position, wanted_s[known])
        return found

    def pose_at(self, time_s: float) -> tuple[Array, Array] | None:
        """Interpolates position (3,) and attitude (4,) at a time; None outside of the poses."""
        k = int(np.searchsorted(self.time_s, time_s))
        if k < len(self.time_s) and self.time_s[k] == time_s:
            return self.position[k], self.attitude[k]
        if not 0 < k < len(self.time_s):
            return None
        gap = self.time_s[k] - self.time_s[k - 1]
        if gap > _LONGEST_GAP_S:
            return None
        fraction = (time_s - self.time_s[k - 1]) / gap
        position = (1.0 - fraction) * self.position[k - 1] + fraction * self.position[k]
        one, other = self.attitude[k - 1], self.attitude[k]
        turn = (1.0 - fraction) * one + fraction * (other if one @ other >= 0.0 else -other)
        return position, turn / np.linalg.norm(turn)
