"""`volery test --search`: searches the values of scenarios for flights that fail."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from volery.cli.scenario_tests import ScenarioTest, TestedScenario, TestOptions, tests_of
from volery.cluster.failure_search import FailureSearch, RandomSampler, TpeSampler
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.study_runs import SweepOptions, executor_of
from volery.core.errors import ScenarioError


@dataclass(frozen=True)
class SearchedScenario:
    """A scenario whose variations were searched for a failure."""

    flights: int
    """Flights of the search."""
    tested: TestedScenario
    """The scenario with one flight: the failure that was found, simplified; without one, the flight
    with the least margin."""
    file: Path | None
    """Scenario file of the failure; None: no flight failed."""


def search_failures(options: TestOptions, flights: int, sampler: str) -> list[SearchedScenario]:
    """Searches the variations of scenarios for flights that fail.

    flights: greatest number of flights for each scenario. sampler: `tpe` or `random`. Raises
    `ScenarioError` as `run_tests`, and without variations and seeds.
    """
    if not options.vary and (options.seeds or 1) < 2:
        raise ScenarioError("--search needs --vary KEY=LOW:HIGH or --seeds N: what it may change")
    return [_searched(test, flights, sampler) for test in tests_of(options)]


def _searched(test: ScenarioTest, flights: int, sampler: str) -> SearchedScenario:
    """Searches a failure, flies it again for its log, and writes a scenario that repeats it."""
    start = time.monotonic()
    options, loaded = test.options, test.loaded
    first = options.first_seed if options.seeds else loaded.scenario.seed
    seeds = (first, first + (options.seeds or 1) - 1)
    folder = ResultsFolder(test.folder)
    sweep = SweepOptions(test.folder, test.num_workers(flights))
    with folder.locked(), closing(executor_of(loaded, sweep, folder)) as executor:
        folder.clear()
        executor.prepare()
        search = FailureSearch(loaded, test.variations, seeds, executor)
        kind = TpeSampler if sampler == "tpe" else RandomSampler
        found = search.search(kind(search.dimensions, first), flights)
        is_failed = not found.result.is_passed
        if is_failed:
            found = search.simplified(found)
        if is_failed and options.keeps_logs:
            found = search.recorded(found)
    file = test.folder / "found.toml" if is_failed else None
    flight = test.flight(found.run, found.result, file)
    tested = TestedScenario(test.path, (flight,), time.monotonic() - start)
    return SearchedScenario(found.flights if is_failed else flights, tested, file)
