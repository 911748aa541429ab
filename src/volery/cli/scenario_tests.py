"""`volery test`: flies scenarios with several seeds and judges the flights by `[[expect]]`."""

from __future__ import annotations

import re
import time
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from volery.cli.sweep_progress import StudyProgress
from volery.cli.trust import may_run_code_of
from volery.cluster.failure_search import FailureSearch, RandomSampler, TpeSampler
from volery.cluster.loading import load_study, parse_study
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.runs import RunResult
from volery.cluster.study import Study
from volery.cluster.study_runs import SweepOptions, executor_of, fly_runs
from volery.cluster.variations import Variation
from volery.core.errors import ScenarioError
from volery.core.machine import usable_cores
from volery.core.near_names import near_miss
from volery.core.toml_text import parse_toml
from volery.scenario import library
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario
from volery.verdicts.verdict import Verdict

_NAME = re.compile(r"[^a-z0-9_]+")


@dataclass(frozen=True)
class TestOptions:
    """Options of `volery test`."""

    __test__ = False

    paths: tuple[str, ...]
    """Names of shipped scenarios, scenario files, and folders of them."""
    seeds: int | None = None
    """Number of seeds, from `first_seed`; None: that of the scenario."""
    first_seed: int = 1
    jobs: int | None = None
    """Number of processes; None: one for each core."""
    vary: tuple[str, ...] = ()
    """Ranges of keys, `KEY=LOW:HIGH`, from which each seed draws a value."""
    seconds: float | None = None
    """Duration of the flights, simulated s; None: that of the scenario."""
    timeout_s: float | None = None
    """Wall time after which a flight counts as failed."""
    out: Path = Path("runs/test")
    """Folder of the logs of failed flights."""
    keeps_logs: bool = True
    trust: bool = False


@dataclass(frozen=True)
class TestedFlight:
    """One flight of a scenario with its verdicts."""

    __test__ = False

    seed: int
    """Seed of the scenario."""
    changes: Mapping[str, Any]
    """Values drawn for this seed, by keys."""
    result: RunResult
    """Result of the run."""
    replay: str
    """Command that repeats the flight on the page; empty for a passed one."""
    log: Path | None
    """Log of a failed flight."""

    @property
    def image(self) -> Path | None:
        """Map of the paths around the moment of the failure."""
        file = None if self.log is None else self.log.with_suffix(".png")
        return file if file is not None and file.exists() else None

    @property
    def verdicts(self) -> list[Verdict]:
        """Verdicts on the expectations; empty for a flight that ended with an error."""
        return [Verdict.from_data(each) for each in self.result.verdicts]


@dataclass(frozen=True)
class TestedScenario:
    """A scenario with its flights."""

    __test__ = False

    path: str
    """Name or path, as it was given or found."""
    flights: tuple[TestedFlight, ...]
    """Flights in the order of their seeds."""
    seconds: float
    """Wall time, s."""

    @property
    def failed(self) -> list[TestedFlight]:
        """Flights that failed or could not be judged."""
        return [flight for flight in self.flights if not flight.result.is_passed]


@dataclass(frozen=True)
class SearchedScenario:
    """A scenario whose variations were searched for a failure."""

    path: str
    """Name or path, as it was given or found."""
    flights: int
    """Flights of the search."""
    failure: TestedFlight | None
    """The failure that was found, simplified; None: no flight failed."""
    file: Path | None
    """Scenario file of the failure."""


def run_tests(options: TestOptions) -> Iterator[TestedScenario]:
    """Flies scenarios one after the other and yields each when it is finished.

    Raises `ScenarioError` before the first flight for a scenario that does not exist or expects
    nothing, and `StudyError` for one that cannot start.
    """
    for test in _tests_of(options):
        yield test.fly()


def search_failures(options: TestOptions, flights: int, sampler: str) -> list[SearchedScenario]:
    """Searches the variations of scenarios for flights that fail.

    flights: greatest number of flights for each scenario. sampler: `tpe` or `random`. Raises
    `ScenarioError` as `run_tests`, and without variations and seeds.
    """
    if not options.vary and (options.seeds or 1) < 2:
        raise ScenarioError("--search needs --vary KEY=LOW:HIGH or --seeds N: what it may change")
    return [test.search(flights, sampler) for test in _tests_of(options)]


def _tests_of(options: TestOptions) -> list[_Test]:
    """Returns the tests of all scenarios."""
    found = [path for text in options.paths for path in _scenarios_at(text)]
    names: dict[str, str] = {}
    for path in dict.fromkeys(found):
        name = _study_name(path)
        names[name if name not in names else f"{name[-50:]}_{len(names)}"] = path
    return [_Test(path, name, options) for name, path in names.items()]


def _scenarios_at(text: str) -> list[str]:
    """Returns the scenarios that a name, file or folder stands for."""
    path = Path(text)
    if text in library.names() or path.is_file():
        return [text]
    if path.is_dir():
        found = [str(each) for each in sorted(path.rglob("*.toml")) if _expects(each)]
        if not found:
            raise ScenarioError(f"{text}: no .toml file in this folder has [[expect]]")
        return found
    raise ScenarioError(f"no scenario, file or folder '{text}'{near_miss(text, library.names())}")


def _expects(path: Path) -> bool:
    """Returns whether a TOML file is a scenario with expectations."""
    try:
        data = parse_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False
    return "expect" in data and "uavs" in data


class _Test:
    """The test of one scenario."""

    def __init__(self, path: str, name: str, options: TestOptions) -> None:
        self._path, self._options = path, options
        self._trust_option = " --trust" if options.trust else ""
        trust = options.trust or path in library.names() or may_run_code_of(Path(path))
        scenario = load_scenario(path, trust=trust)
        if not scenario.expect:
            raise ScenarioError(f"{path}: expects nothing: add [[expect]] (docs/scenario_tests.md)")
        self._loaded = load_study(_study_of(path, name, scenario, options), trust=trust)
        self._folder = options.out / self._loaded.study.name

    def fly(self) -> TestedScenario:
        """Flies all seeds again."""
        start = time.monotonic()
        seeds = self._options.seeds or 1
        with StudyProgress(self._path, err=True) as progress:
            options = SweepOptions(
                self._folder,
                self._workers(seeds),
                on_progress=progress.update,
                reuses_results=False,
            )
            plan = fly_runs(self._loaded, options)
        flights = [
            self._flight(run.seed, run.values, plan.results[run.id]) for run in plan.wanted()
        ]
        return TestedScenario(self._path, tuple(flights), time.monotonic() - start)

    def search(self, flights: int, sampler: str) -> SearchedScenario:
        """Searches a failure and writes a scenario that repeats it."""
        variations = [Variation.of(text) for text in self._options.vary]
        first = self._options.first_seed if self._options.seeds else self._loaded.scenario.seed
        seeds = (first, first + (self._options.seeds or 1) - 1)
        folder = ResultsFolder(self._folder)
        options = SweepOptions(self._folder, self._workers(flights))
        with folder.locked(), closing(executor_of(self._loaded, options, folder)) as executor:
            executor.prepare()
            search = FailureSearch(self._loaded, variations, seeds, executor)
            kind = TpeSampler if sampler == "tpe" else RandomSampler
            found = search.search(kind(search.dimensions, first), flights)
            if found is None:
                return SearchedScenario(self._path, flights, None, None)
            found = search.simplified(found)
        file = self._folder / "found.toml"
        scenario = self._loaded.scenario_of(found.values).with_(seed=found.seed)
        scenario.save(file, overwrite=True)
        parameters = self._loaded.study.parameters
        changes = {parameters[name].key: value for name, value in found.values.items()}
        end_s = _end_s(found.result)
        replay = f"volery run {file}{end_s}{self._trust_option} --page"
        flight = TestedFlight(found.seed, changes, found.result, replay, None)
        return SearchedScenario(self._path, found.flights, flight, file)

    def _workers(self, flights: int) -> int:
        """Returns the number of worker processes; 0: this one flies, which knows no timeout."""
        jobs = min(self._options.jobs or usable_cores(), flights)
        return 0 if jobs == 1 and self._options.timeout_s is None else jobs

    def _flight(self, seed: int, values: Mapping[str, Any], result: RunResult) -> TestedFlight:
        parameters = self._loaded.study.parameters
        changes = {parameters[n].key: v for n, v in values.items() if parameters[n].key != "seed"}
        if result.is_passed:
            return TestedFlight(seed, changes, result, "", None)
        log = self._folder / result.log if result.log else None
        return TestedFlight(seed, changes, result, self._replay(seed, values, result), log)

    def _replay(self, seed: int, values: Mapping[str, Any], result: RunResult) -> str:
        """Returns the command that repeats a failed flight until a second after it failed."""
        what = self._path
        if len(values) > 1:  # besides the seed: a file of its own
            file = self._folder / f"seed_{seed}.toml"
            scenario = self._loaded.scenario_of(values).with_(seed=seed)
            scenario.save(file, overwrite=True)
            what = str(file)
        return f"volery run {what} --seed {seed}{_end_s(result)}{self._trust_option} --page"


def _end_s(result: RunResult) -> str:
    """Returns the option that ends a flight a second after its last failure."""
    verdicts = map(Verdict.from_data, result.verdicts)
    times_s = [v.time_s for v in verdicts if not v.is_passed and np.isfinite(v.time_s)]
    return f" --seconds {max(times_s) + 1.0:.1f}" if times_s else ""


def _study_of(path: str, name: str, scenario: Scenario, options: TestOptions) -> Study:
    first = scenario.seed if options.seeds is None else options.first_seed
    seeds = list(range(first, first + (options.seeds or 1)))
    is_shipped = path in library.names()
    given: dict[str, Any] = {"seeds": seeds}
    if options.vary:
        parameters: dict[str, Any] = {"seed": {"key": "seed", "values": seeds}}
        for number, variation in enumerate(map(Variation.of, options.vary)):
            values = [variation.value(variation.drawn(seed, number)) for seed in seeds]
            parameters[variation.name(number)] = {"key": variation.key, "values": values}
        given = {"combine": "list", "parameters": parameters}
    data = {
        "name": name,
        "scenario": path if is_shipped else str(Path(path).resolve()),
        "duration_s": options.seconds,
        "metrics": ["expectations"],
        "logs": "failed" if options.keeps_logs else "none",
        "run_timeout_s": options.timeout_s,
        **given,
    }
    return parse_study(data, f"test of {path}")


def _study_name(path: str) -> str:
    words = _NAME.sub("_", Path(path).with_suffix("").as_posix().lower()).strip("_")
    return words[-60:].lstrip("_0123456789") or "scenario"
