"""The verdict on one expectation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from volery.core.errors import VoleryError


class JudgmentError(VoleryError):
    """An expectation cannot be judged: an unknown UAV, a signal without values, a bad function."""


class Outcome(StrEnum):
    """Outcome of an expectation."""

    PASSED = "passed"
    """The flight did what was expected."""
    FAILED = "failed"
    """It did not."""
    ERROR = "error"
    """It could not be judged."""
    PENDING = "pending"
    """During a flight: it may still do what was expected."""


@dataclass(frozen=True)
class Finding:
    """What a check has found, at the moment that decides."""

    text: str
    """What was measured, in words."""
    margin: float = math.nan
    """Distance from failing, negative if it failed; nan: the expectation has no margin."""
    unit: str = ""
    """Unit of the margin."""
    time_s: float = math.nan
    """Simulated time of that moment, s; nan: there is none."""
    uav: str = ""
    """UAV that decides; empty: none alone."""
    is_passed: bool | None = None
    """Whether the flight passes; None: the margin is not negative."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on one expectation of a flight."""

    name: str
    """Name of the expectation."""
    kind: str
    """Kind of the expectation."""
    outcome: Outcome
    """Whether the flight passes."""
    text: str
    """What was measured, or why it could not be judged."""
    margin: float = math.nan
    """Distance from failing, in `unit` (such as m), negative if it failed; nan: it has none."""
    unit: str = ""
    """Unit of the margin."""
    time_s: float = math.nan
    """Simulated time of the moment that decided, s; nan: there is none."""
    uav: str = ""
    """UAV that decided; empty: none alone."""

    @classmethod
    def of(cls, name: str, kind: str, finding: Finding) -> Verdict:
        """Returns the verdict that follows from a finding."""
        passed = finding.is_passed
        if passed is None:
            passed = finding.margin >= 0.0
        return cls(
            name,
            kind,
            Outcome.PASSED if passed else Outcome.FAILED,
            finding.text,
            finding.margin,
            finding.unit,
            finding.time_s,
            finding.uav,
        )

    @classmethod
    def of_flight(cls, error: str) -> Verdict:
        """Returns the verdict on a flight that ended with an error."""
        return cls("flight", "flight", Outcome.ERROR, " ".join(error.split()))

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Verdict:
        """Returns the verdict of `to_data`."""
        numbers = {k: math.nan if data[k] is None else data[k] for k in ("margin", "time_s")}
        return cls(**{**data, **numbers, "outcome": Outcome(data["outcome"])})

    def to_data(self) -> dict[str, Any]:
        """Returns the verdict as plain data for JSON; numbers that do not exist are None."""
        numbers = {"margin": self.margin, "time_s": self.time_s}
        plain = {k: x if math.isfinite(x) else None for k, x in numbers.items()}
        return {**vars(self), "outcome": str(self.outcome), **plain}

    @property
    def is_passed(self) -> bool:
        """Whether the flight passes."""
        return self.outcome is Outcome.PASSED

    def describe(self) -> str:
        """Returns one line: name, measurement, UAV and time."""
        where = [self.uav] if self.uav else []
        where += [f"at {self.time_s:.2f} s"] if math.isfinite(self.time_s) else []
        moment = f" ({' '.join(where)})" if where else ""
        return f"{self.name}: {self.text}{moment}"
