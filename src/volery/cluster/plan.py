"""Which runs of a study are wanted, and which of them are still missing.

A stop rule decides from the first repetitions of a point only, in their order: the wanted runs do
not depend on the order in which runs end, nor on interruptions.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence

from volery.cluster.confidence import estimate_mean
from volery.cluster.runs import RunResult, RunSpec
from volery.cluster.study import StudyStop


class RunPlan:
    """The runs of a study, point by point, and their results so far.

    results: usable results by identity; `add` adds to them.
    """

    def __init__(
        self, runs: Sequence[RunSpec], results: Mapping[str, RunResult], stop: StudyStop | None
    ) -> None:
        self.results = dict(results)
        """Results by identity."""
        self._stop = stop
        self._by_point: dict[int, list[RunSpec]] = {}
        for run in runs:
            self._by_point.setdefault(run.point, []).append(run)
        self._wanted = {point: self._first_count(point) for point in self._by_point}
        self._missing: deque[RunSpec] = deque()
        self._left = dict.fromkeys(self._by_point, 0)
        """By point: wanted runs without a result."""
        for point, count in self._wanted.items():
            self._ask(self._by_point[point][:count])
            if not self._left[point]:
                self._decide(point)

    @property
    def total(self) -> int:
        """Number of wanted runs so far."""
        return sum(self._wanted.values())

    @property
    def max_total(self) -> int:
        """Number of runs if no point stops early."""
        return sum(map(len, self._by_point.values()))

    @property
    def has_missing(self) -> bool:
        """Whether wanted runs have neither results nor been taken."""
        return bool(self._missing)

    def wanted(self) -> Iterator[RunSpec]:
        """Yields the wanted runs so far, in order."""
        for point, count in self._wanted.items():
            yield from self._by_point[point][:count]

    def take(self, count: int) -> tuple[RunSpec, ...]:
        """Removes and returns up to `count` missing runs of one point."""
        batch: list[RunSpec] = []
        while self._missing and len(batch) < count:
            if batch and self._missing[0].point != batch[0].point:
                break
            batch.append(self._missing.popleft())
        return tuple(batch)

    def missing_of_next_point(self, limit: int) -> int:
        """Returns the number of missing runs of the point that comes next, up to `limit`."""
        count = 0
        for run in self._missing:
            if count == limit or run.point != self._missing[0].point:
                break
            count += 1
        return count

    def add(self, run: RunSpec, result: RunResult) -> None:
        """Adds a result; a stop rule may want further runs of the point."""
        is_new = run.id not in self.results
        self.results[run.id] = result
        self._left[run.point] -= is_new
        if not self._left[run.point]:
            self._decide(run.point)

    # ------------------------------------------------------------------------------------- inside

    def _first_count(self, point: int) -> int:
        runs = self._by_point[point]
        return len(runs) if self._stop is None else min(len(runs), self._stop.min_repetitions)

    def _ask(self, runs: Sequence[RunSpec]) -> None:
        missing = [run for run in runs if run.id not in self.results]
        self._missing.extend(missing)
        for run in missing:
            self._left[run.point] += 1

    def _decide(self, point: int) -> None:
        """Wants more runs of a point if those with results, which are all wanted ones, vary."""
        runs, stop = self._by_point[point], self._stop
        while stop is not None and not self._left[point]:
            count = self._wanted[point]
            found = [self.results[run.id].metrics.get(stop.metric) for run in runs[:count]]
            numbers = [value for value in found if value is not None]
            is_known = estimate_mean(numbers, stop.confidence).half_width <= stop.half_width
            if is_known or count == len(runs):
                return
            self._wanted[point] = min(len(runs), count + stop.every)
            self._ask(runs[count : self._wanted[point]])
