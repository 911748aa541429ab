"""Searches the variations of a scenario for a flight that fails, and simplifies what it finds.

A sampler proposes values, flights rate them by their smallest margin, and the search ends at the
first flight that fails. The same seed and number of workers give the same search.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from volery.cluster.batches import BatchResult, RunBatch
from volery.cluster.executor import BatchLoss, Executor
from volery.cluster.loading import LoadedStudy
from volery.cluster.runs import RunResult, RunSpec, failure_of
from volery.cluster.variations import Variation
from volery.core.extras import import_extra
from volery.verdicts.verdict import Verdict

_COLLECT_S = 0.5
_HALVINGS = 6
"""Bisections of a value when a failure is simplified: to 1/64 of its range."""
_MIN_SCALE = 1e-6
_EXPLORING = 4
"""One of so many proposals is random."""


class Sampler(Protocol):
    """Proposes points of the unit cube, and learns from their ratings."""

    def propose(self, count: int) -> list[list[float]]:
        """Returns points (count, D), each coordinate from 0 to 1."""

    def learn(self, ratings: Sequence[float]) -> None:
        """Takes the ratings of the last points; low ones are wanted."""


class RandomSampler:
    """Proposes independent points."""

    def __init__(self, dimensions: int, seed: int) -> None:
        self._rng, self._dimensions = np.random.default_rng(seed), dimensions

    def propose(self, count: int) -> list[list[float]]:
        """Returns points (count, D), each coordinate from 0 to 1."""
        points: list[list[float]] = self._rng.uniform(size=(count, self._dimensions)).tolist()
        return points

    def learn(self, ratings: Sequence[float]) -> None:
        """Does nothing."""


class TpeSampler:
    """Proposes points by a tree-structured Parzen estimator, of Optuna.

    J. Bergstra et al., Algorithms for hyper-parameter optimization, NeurIPS 2011. Each fourth point
    is random, because margins have local minima. Raises `VoleryError` if Optuna is not installed.
    """

    def __init__(self, dimensions: int, seed: int) -> None:
        optuna = import_extra("volery test --search", "optuna", "optuna", "search")
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
        unit = optuna.distributions.FloatDistribution(0.0, 1.0)
        self._space = {f"x{k}": unit for k in range(dimensions)}
        self._trials: list[Any] = []
        self._rng = np.random.default_rng([seed, 1])
        self._num_proposed = 0

    def propose(self, count: int) -> list[list[float]]:
        """Returns points (count, D), each coordinate from 0 to 1."""
        self._trials = [self._ask() for _ in range(count)]
        return [[trial.params[name] for name in self._space] for trial in self._trials]

    def _ask(self) -> Any:
        self._num_proposed += 1
        if self._num_proposed % _EXPLORING == 0:
            drawn = self._rng.random(len(self._space)).tolist()
            self._study.enqueue_trial(dict(zip(self._space, drawn, strict=True)))
        return self._study.ask(self._space)

    def learn(self, ratings: Sequence[float]) -> None:
        """Takes the ratings of the last points; low ones are wanted."""
        for trial, rating in zip(self._trials, ratings, strict=True):
            self._study.tell(trial, rating)


@dataclass(frozen=True)
class FoundFlight:
    """A flight of a search."""

    run: RunSpec
    """Its seed, and values of the parameters that it needs; others are those of the scenario."""
    result: RunResult
    """Its result."""
    flights: int
    """Flights of the search when it was found."""


class FailureSearch:
    """Searches the variations of a study for a failure.

    loaded: a study with a parameter for each variation, `Variation.name(number)`. seeds: first and
    last seed among which it searches. executor: an executor that is prepared.
    """

    def __init__(
        self,
        loaded: LoadedStudy,
        variations: Sequence[Variation],
        seeds: tuple[int, int],
        executor: Executor,
        on_flight: Callable[[int], None] = lambda _count: None,
    ) -> None:
        self._loaded, self._variations, self._seeds = loaded, variations, seeds
        self._executor, self._on_flight = executor, on_flight
        self._scales: dict[str, float] = {}
        self._number = 0

    @property
    def dimensions(self) -> int:
        """Number of values that a sampler proposes: one a variation, and one for the seed."""
        return len(self._variations) + (self._seeds[0] < self._seeds[1])

    def search(self, sampler: Sampler, flights: int) -> FoundFlight:
        """Returns the first failure within a number of flights.

        If all pass, the flight with the least margin. flights: 1 or more.
        """
        flown, closest, min_rating = 0, None, math.inf
        while flown < flights:
            count = min(self._executor.num_workers, flights - flown)
            points = sampler.propose(count)
            runs = [self._run(*self._point(point)) for point in points]
            results = self._fly(runs)
            for k, (run, result) in enumerate(zip(runs, results, strict=True)):
                if not result.is_passed:
                    return FoundFlight(run, result, flown + k + 1)
            ratings = [self._rating(result) for result in results]
            sampler.learn(ratings)
            flown += count
            k = int(np.argmin(ratings))
            if closest is None or ratings[k] < min_rating:
                closest, min_rating = FoundFlight(runs[k], results[k], flown), ratings[k]
            self._on_flight(flown)
        assert closest is not None
        return closest

    def simplified(self, found: FoundFlight) -> FoundFlight:
        """Returns a failure with fewer and simpler changes.

        Each value is left out if the flight fails without it, or else is moved towards the low end
        of its range as far as it still fails, and rounded.
        """
        for number, variation in enumerate(self._variations):
            name = variation.name(number)
            without = {key: value for key, value in found.run.values.items() if key != name}
            fails = self._failing(without, found)
            found = self._lowered(variation, name, found) if fails is None else fails
        return found

    def recorded(self, found: FoundFlight) -> FoundFlight:
        """Flies a failure again and returns it with its log."""
        (result,) = self._fly([found.run], record=True)
        return replace(found, result=result)

    # ------------------------------------------------------------------------------------- inside

    def _point(self, point: Sequence[float]) -> tuple[dict[str, Any], int]:
        """Returns the values and the seed of a point of the unit cube."""
        values = {
            variation.name(number): variation.value(variation.at(point[number]))
            for number, variation in enumerate(self._variations)
        }
        first, last = self._seeds
        part = point[-1] if first < last else 0.0
        return values, min(last, first + int(part * (last - first + 1)))

    def _run(self, values: Mapping[str, Any], seed: int) -> RunSpec:
        identity = hashlib.sha256(json.dumps([values, seed], sort_keys=True).encode()).hexdigest()
        return RunSpec(identity[:24], 0, 0, dict(values), seed)

    def _lowered(self, variation: Variation, name: str, found: FoundFlight) -> FoundFlight:
        """Returns a failure with the lowest value of a parameter that still fails, rounded."""

        def failing_with(number: float) -> FoundFlight | None:
            values = {**found.run.values, name: variation.value(number)}
            return self._failing(values, found)

        lowest = failing_with(variation.low)
        if lowest is not None:
            return lowest
        passing, failing = variation.low, variation.number(found.run.values[name])
        for _ in range(_HALVINGS):
            middle = 0.5 * (passing + failing)
            fails = failing_with(middle)
            if fails is None:
                passing = middle
            else:
                failing, found = middle, fails
        for rounded in variation.rounded(failing):
            fails = failing_with(rounded)
            if fails is not None:
                return fails
        return found

    def _failing(self, values: Mapping[str, Any], found: FoundFlight) -> FoundFlight | None:
        """Returns the failure with other values; None: the flight passes."""
        run = self._run(values, found.run.seed)
        (result,) = self._fly([run])
        return None if result.is_passed else replace(found, run=run, result=result)

    def _fly(self, runs: Sequence[RunSpec], *, record: bool = False) -> list[RunResult]:
        """Flies runs, one for each worker, and returns their results in their order."""
        waiting: dict[int, RunSpec] = {}
        results: dict[str, RunResult] = {}
        for run in runs:
            self._number += 1
            waiting[self._number] = run
            self._executor.submit(RunBatch(self._number, (run,), record=record))
            if not self._executor.can_submit():
                self._collect(waiting, results)
        while waiting:
            self._collect(waiting, results)
        return [results[run.id] for run in runs]

    def _collect(self, waiting: dict[int, RunSpec], results: dict[str, RunResult]) -> None:
        for found in self._executor.collect(_COLLECT_S):
            if isinstance(found, BatchResult):
                run = waiting.pop(found.number)
                results[run.id] = found.results[0]
            elif isinstance(found, BatchLoss):
                run = waiting.pop(found.batch.number)
                results[run.id] = failure_of(run, f"its worker {found.reason}")

    def _rating(self, result: RunResult) -> float:
        """Returns the smallest margin, each in parts of that of the first flight."""
        found = []
        for verdict in map(Verdict.from_data, result.verdicts):
            if math.isfinite(verdict.margin):
                scale = self._scales.setdefault(verdict.name, max(_MIN_SCALE, abs(verdict.margin)))
                found.append(verdict.margin / scale)
        return min(found, default=0.0)
