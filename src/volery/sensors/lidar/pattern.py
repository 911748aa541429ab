"""Base class of beam patterns."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from volery.core.arrays import Array
from volery.sensors.lidar.beam_table import BeamTable, block_table, in_packets
from volery.sensors.model import SensorModel
from volery.world.embree import LANES

MAX_BEAMS = 1 << 20
"""Maximum number of beams of a sweep."""


class Pattern(SensorModel):
    """Directions and times of a scanner's beams; `scan_patterns` defines the kinds."""

    rate_hz: PositiveFloat

    @property
    @abstractmethod
    def time_ns(self) -> NDArray[np.int64]:
        """(beams,) time of each beam after the start of the sweep, ns."""

    @property
    @abstractmethod
    def spacing_rad(self) -> float:
        """Angle between a beam and that `stride` numbers later, rad."""

    @property
    def stride(self) -> int:
        """Distance in beam numbers between neighbours along the sweep."""
        return 1

    @property
    def is_fixed(self) -> bool:
        """Whether every sweep has the same directions."""
        return True

    @property
    def beam_count(self) -> int:
        """Number of beams of a sweep."""
        return len(self.time_ns)

    @property
    def sweep_ns(self) -> int:
        """Time from the start of the sweep to its last beam, ns."""
        return int(self.time_ns.max())

    @cached_property
    def ring(self) -> NDArray[np.uint16]:
        """(beams,) number of each beam's ring."""
        return np.zeros(self.beam_count, dtype=np.uint16)

    def directions(self, sweep: int) -> Array:
        """Returns read-only unit vectors (3, beams) of sweep `sweep`, from 0, sensor frame FLU."""
        return self._first_directions if self.is_fixed else self._aim(sweep)

    @cached_property
    def time_s(self) -> NDArray[np.float32]:
        """(beams,) time of each beam after the start of the sweep, s, as in messages."""
        return (self.time_ns * 1e-9).astype(np.float32)

    @abstractmethod
    def _aim(self, sweep: int) -> Array:
        """Computes `directions`."""

    @cached_property
    def _first_directions(self) -> Array:
        return self._aim(0)

    def table(self, sweep: int) -> BeamTable:
        """Returns the beams of sweep number `sweep`, counted from 0, for kernels."""
        if self.is_fixed:
            return self._first_table
        fraction = self._first_table.lanes[:, -1].reshape(-1)[: self.beam_count]
        return self._first_table._replace(lanes=in_packets(self.directions(sweep), fraction))

    @cached_property
    def _first_table(self) -> BeamTable:
        order = np.arange(self.beam_count)
        return block_table(self.directions(0), self.time_ns, order, order // LANES)


def median_spacing(direction: Array) -> float:
    """Returns the median angle between consecutive unit vectors (3, N), rad."""
    chord = np.linalg.norm(np.diff(direction, axis=1), axis=0)
    return max(float(np.median(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))), 1e-9)
