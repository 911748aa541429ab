"""Judges a finished run by the expectations of its scenario."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from volery.core.errors import FAILURES, ScenarioError, VoleryError
from volery.graph.nodes.failures import location_of
from volery.runtime.construction.node_loading import find_function
from volery.scenario.expectations import Expectation, PredicateExpectation, names_of
from volery.scenario.schema import Scenario
from volery.verdicts import path_checks, topic_checks
from volery.verdicts.finished_run import NEEDS_SIMULATION, FinishedRun, arguments_of, read_only
from volery.verdicts.formula_check import formula
from volery.verdicts.user_functions import needs_of
from volery.verdicts.verdict import Finding, JudgmentError, Outcome, Verdict

_CHECKS: Mapping[str, Callable[[FinishedRun, Any], Finding]] = {
    "no_contact": path_checks.no_contact,
    "no_crash": path_checks.no_crash,
    "arrives": path_checks.arrives,
    "separation": path_checks.separation,
    "clearance": path_checks.clearance,
    "inside": path_checks.inside,
    "speed": path_checks.speed,
    "battery": path_checks.battery,
    "modes": path_checks.modes,
    "area": path_checks.area,
    "topic_rate": topic_checks.topic_rate,
    "topic_value": topic_checks.topic_value,
    "estimate_error": topic_checks.estimate_error,
    "nees": topic_checks.nees,
    "no_log_message": topic_checks.no_log_message,
    "real_time_factor": topic_checks.real_time_factor,
    "formula": formula,
}
_NEEDS = {
    "topic_rate": "topics",
    "topic_value": "topics",
    "no_log_message": "topics",
    "estimate_error": "estimates",
    "nees": "estimates",
}
"""What kinds need of a run besides its states."""


class Judge:
    """Judges runs by the expectations of one scenario, whose predicates it imports.

    Raises `ScenarioError` for a predicate that does not exist or may not be imported.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.expectations = scenario.expect
        """Expectations, in the order of the scenario."""
        self.names = names_of(self.expectations)
        """Their names."""
        self._predicates = {
            number: _Predicate.of(expectation, f"{scenario.name}: expect[{number}]", scenario)
            for number, expectation in enumerate(self.expectations)
            if isinstance(expectation, PredicateExpectation)
        }

    @property
    def needs(self) -> frozenset[str]:
        """Parts of a `FinishedRun` that the expectations read beside its states."""
        kinds = {expectation.kind for expectation in self.expectations}
        needs = {_NEEDS[kind] for kind in kinds if kind in _NEEDS}
        for predicate in self._predicates.values():
            needs |= {name for name in predicate.needs if name in NEEDS_SIMULATION}
        return frozenset(needs)

    def verdicts(self, run: FinishedRun, *, is_over: bool = True) -> tuple[Verdict, ...]:
        """Returns a verdict for each expectation; never raises for one that cannot be judged.

        is_over: whether the run has ended; if not, failures that the rest of the flight may mend
        are pending.
        """
        found = tuple(self._verdict(run, number, name) for number, name in enumerate(self.names))
        if is_over:
            return found
        time_s = float(run.flight.times_s[-1])
        return tuple(
            replace(verdict, outcome=Outcome.PENDING)
            if _may_change(verdict, expectation, time_s)
            else verdict
            for verdict, expectation in zip(found, self.expectations, strict=True)
        )

    def _verdict(self, run: FinishedRun, number: int, name: str) -> Verdict:
        expectation = self.expectations[number]
        try:
            if isinstance(expectation, PredicateExpectation):
                finding = self._predicates[number].judge(run)
            else:
                finding = _CHECKS[expectation.kind](run, expectation)
        except VoleryError as error:
            text = " ".join(str(error).split())
            return Verdict(name, expectation.kind, Outcome.ERROR, text)
        return Verdict.of(name, expectation.kind, finding)


def final_s(verdicts: Iterable[Verdict], expectations: Sequence[Expectation]) -> float:
    """Returns the simulated time, s, from which all failures of a flight are final.

    inf: the end of the flight, also without verdicts.
    """
    times_s = [
        math.inf if math.isnan(verdict.time_s) else expectation.decided_s(verdict.time_s)
        for verdict, expectation in zip(verdicts, expectations, strict=False)
        if not verdict.is_passed
    ]
    return max(times_s, default=math.inf)


def _may_change(verdict: Verdict, expectation: Expectation, time_s: float) -> bool:
    """Returns whether the rest of a flight may turn a failure into a pass.

    What has no moment, such as a topic without messages, is not decided yet.
    """
    if verdict.is_passed:
        return False
    undecided = verdict.outcome is Outcome.ERROR or math.isnan(verdict.time_s)
    return undecided or time_s < expectation.decided_s(verdict.time_s)


class _Predicate(NamedTuple):
    """A user's function with its arguments."""

    function: Callable[..., Any]
    needs: tuple[str, ...]
    expectation: PredicateExpectation

    @classmethod
    def of(cls, expectation: PredicateExpectation, where: str, scenario: Scenario) -> _Predicate:
        function = find_function(expectation.function, where, scenario.access)
        try:
            needs = needs_of(function, expectation.parameters)
        except VoleryError as error:
            raise ScenarioError(f"{where}: {expectation.function}: {error}") from None
        if "topics" in needs and not expectation.topics:
            raise ScenarioError(
                f"{where}: {expectation.function} reads topics: name them in 'topics'"
            )
        return cls(function, needs, expectation)

    def judge(self, run: FinishedRun) -> Finding:
        """Returns what the function returns. Raises `JudgmentError` for what it raises."""
        path_checks.rows_of(run.flight, self.expectation)
        arguments = {**arguments_of(run, self.needs), **self.expectation.parameters}
        try:
            with read_only(run.flight):
                found = self.function(**arguments)
        except FAILURES as error:
            silent = topic_checks.silent_topics(run, self.expectation)
            raise JudgmentError(
                f"{type(error).__name__}: {error}{location_of(error)}{silent and f'; {silent}'}"
            ) from error
        if isinstance(found, bool | np.bool_):
            return Finding("true" if found else "false", is_passed=bool(found))
        if not isinstance(found, int | float | np.number) or math.isnan(found):
            what = "NaN" if isinstance(found, float) else type(found).__name__
            raise JudgmentError(
                f"it returned {what}; return whether the flight passes, or a margin"
            )
        return Finding(f"{float(found):.6g}", float(found))
