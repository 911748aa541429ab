"""Grades: points for the verdicts on a submission's flights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from volery.verdicts.verdict import Verdict


@dataclass(frozen=True)
class GradedFlight:
    """A flight of a submission."""

    submission: str
    """Name of the submission."""
    seed: int
    """Seed of the scenario."""
    verdicts: tuple[Verdict, ...] = ()
    """A verdict for each expectation; empty for a flight that did not take place."""
    digest: str = ""
    """SHA-256 of states and events, the same on each machine; empty without a flight."""
    problem: str = ""
    """How the node ended before the flight, or why there was none; empty: it did not."""
    simulated_s: float = 0.0
    """Simulated time, s."""
    wall_s: float = 0.0
    """Wall time, s."""

    def to_data(self) -> dict[str, Any]:
        """Returns the flight as plain data for JSON."""
        return {**vars(self), "verdicts": [verdict.to_data() for verdict in self.verdicts]}


@dataclass(frozen=True)
class Grade:
    """The grade of a submission."""

    submission: str
    """Name of the submission."""
    flights: tuple[GradedFlight, ...]
    """Its flights, in the order of the seeds."""
    max_points: Mapping[str, float]
    """Greatest points, by expectation."""

    @property
    def points(self) -> dict[str, float]:
        """Points by expectation: those of the assignment times the share of flights that pass."""
        passed = dict.fromkeys(self.max_points, 0)
        for flight in self.flights:
            for verdict in flight.verdicts:
                passed[verdict.name] += verdict.is_passed
        return {
            name: maximum * passed[name] / len(self.flights)
            for name, maximum in self.max_points.items()
        }

    @property
    def total(self) -> float:
        """Sum of the points over all expectations."""
        return sum(self.points.values())

    @property
    def problems(self) -> list[str]:
        """Problems of its flights, each once with its first seed."""
        first: dict[str, int] = {}
        for flight in self.flights:
            if flight.problem:
                first.setdefault(flight.problem, flight.seed)
        return [f"seed {seed}: {problem}" for problem, seed in first.items()]

    def to_data(self) -> dict[str, Any]:
        """Returns the grade as plain data for JSON."""
        return {
            "submission": self.submission,
            "total": self.total,
            "max_total": sum(self.max_points.values()),
            "points": self.points,
            "flights": [flight.to_data() for flight in self.flights],
        }
