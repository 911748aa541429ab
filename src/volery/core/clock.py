"""Represents simulated time as integer nanoseconds since the start of the run."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

NS_PER_S = 1_000_000_000


def ns_from_s(seconds: float) -> int:
    """Returns the nearest integer nanosecond to `seconds`."""
    return round(seconds * NS_PER_S)


def s_from_ns(time_ns: int) -> float:
    """Returns seconds as a float; exact to a nanosecond below 100 days."""
    return time_ns / NS_PER_S


def stamp_from_ns(time_ns: int) -> tuple[int, int]:
    """Returns the ROS stamp (sec, nanosec) of a time."""
    return divmod(time_ns, NS_PER_S)


@dataclass(frozen=True, slots=True)
class Schedule:
    """Instants `phase_ns + k / rate_hz`, k = 0, 1, ..., without accumulated rounding."""

    rate_hz: Fraction
    phase_ns: int = 0
    _ratio: tuple[int, int] = field(init=False, repr=False, compare=False)
    """Twice the period in ns, as two integers."""

    def __post_init__(self) -> None:
        ratio = 2 * NS_PER_S * self.rate_hz.denominator, self.rate_hz.numerator
        object.__setattr__(self, "_ratio", ratio)

    @classmethod
    def from_hz(cls, rate_hz: float, phase_ns: int = 0) -> Schedule:
        """Returns the schedule of a rate; 30.0 and 29.97 are treated as exact decimals."""
        return cls(Fraction(str(rate_hz)), phase_ns)

    @property
    def period_ns(self) -> int:
        """Nearest integer period, ns."""
        return round(NS_PER_S / self.rate_hz)

    def instant_ns(self, k: int) -> int:
        """Returns the k-th instant, ns."""
        # Integers throughout, rounded half up: this runs once for every measurement.
        above, below = self._ratio
        return self.phase_ns + (k * above + below) // (2 * below)
