"""`volery test`: flies scenarios with several seeds and judges the flights by `[[expect]]`.

`cli.scenario_searches` searches their values for failures.
"""

from __future__ import annotations

import math
import re
import shlex
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from volery.cli.sweep_progress import StudyProgress
from volery.cli.trust import may_run_code_of
from volery.cluster.loading import load_study, parse_study
from volery.cluster.runs import RunResult, RunSpec
from volery.cluster.study import Study
from volery.cluster.study_runs import SweepOptions, fly_runs
from volery.cluster.variations import Variation
from volery.core.errors import ScenarioError
from volery.core.machine import usable_cores
from volery.core.near_names import near_miss
from volery.scenario import library
from volery.scenario.load import has_tables, load_scenario
from volery.scenario.schema import Scenario
from volery.verdicts.judging import final_s
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

    @property
    def variations(self) -> tuple[Variation, ...]:
        """Ranges of keys. Raises `StudyError` for an invalid one."""
        return tuple(map(Variation.of, self.vary))


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


def run_tests(options: TestOptions) -> Iterator[TestedScenario]:
    """Flies scenarios one after the other and yields each when it is finished.

    Raises `ScenarioError` before the first flight for a scenario that does not exist or expects
    nothing, and `StudyError` for one that cannot start.
    """
    for test in tests_of(options):
        yield test.fly()


def tests_of(options: TestOptions) -> list[ScenarioTest]:
    """Returns the tests of all scenarios; raises as `run_tests`."""
    keys = Counter(variation.key for variation in options.variations)
    repeated = [key for key, count in keys.items() if count > 1]
    if repeated:
        raise ScenarioError(f"--vary: '{repeated[0]}' is given more than once")
    found = [path for text in options.paths for path in _scenarios_at(text, options.out)]
    names: dict[str, str] = {}
    for path in dict.fromkeys(found):
        name = _study_name(path)
        names[name if name not in names else f"{name[-50:]}_{len(names)}"] = path
    return [ScenarioTest(path, name, options) for name, path in names.items()]


def _scenarios_at(text: str, out: Path) -> list[str]:
    """Returns the scenarios that a name, file or folder stands for; not those that tests save."""
    path, saved = Path(text), out.resolve()
    if text in library.names() or path.is_file():
        return [text]
    if path.is_dir():
        files = [file for file in sorted(path.rglob("*.toml")) if has_tables(file, "expect")]
        if not path.resolve().is_relative_to(saved):
            files = [file for file in files if not file.resolve().is_relative_to(saved)]
        if not files:
            raise ScenarioError(f"{text}: no .toml file in this folder has [[expect]]")
        return [str(file) for file in files]
    raise ScenarioError(f"no scenario, file or folder '{text}'{near_miss(text, library.names())}")


class ScenarioTest:
    """The test of one scenario.

    name: that of its folder below `TestOptions.out`. Raises `ScenarioError` for a scenario that
    expects nothing, and `StudyError` for one that cannot start.
    """

    def __init__(self, path: str, name: str, options: TestOptions) -> None:
        self.path, self.options = path, options
        trust = options.trust or path in library.names() or may_run_code_of(Path(path))
        scenario = load_scenario(path, trust=trust)
        if not scenario.expect:
            raise ScenarioError(f"{path}: expects nothing: add [[expect]] (docs/scenario_tests.md)")
        self.variations = tuple(_fitted(each, scenario) for each in options.variations)
        """Ranges of its keys."""
        self.loaded = load_study(self._study(name, scenario), trust=trust)
        """The study of its flights."""
        self.folder = options.out / self.loaded.study.name
        """Folder of its files."""

    def fly(self) -> TestedScenario:
        """Flies all seeds again."""
        start = time.monotonic()
        with StudyProgress(self.path, err=True) as progress:
            options = SweepOptions(
                self.folder,
                self.num_workers(self.options.seeds or 1),
                on_progress=progress.update,
                reuses_results=False,
            )
            plan = fly_runs(self.loaded, options)
        flights = [self.flight(run, plan.results[run.id]) for run in plan.wanted()]
        return TestedScenario(self.path, tuple(flights), time.monotonic() - start)

    def num_workers(self, flights: int) -> int:
        """Returns the number of worker processes; 0: this one flies, which knows no timeout."""
        jobs = min(self.options.jobs or usable_cores(), flights)
        return 0 if jobs == 1 and self.options.timeout_s is None else jobs

    def flight(self, run: RunSpec, result: RunResult, file: Path | None = None) -> TestedFlight:
        """Returns a flight; saves the scenario of a failed one.

        file: file of that scenario; None: in the folder of the logs, if it has other values.
        """
        changes = self._changes(run.values)
        if result.is_passed:
            return TestedFlight(run.seed, changes, result, "", None)
        if file is None and changes:
            file = self.folder / "logs" / f"seed_{run.seed}.toml"
        if file is not None:
            scenario = self.loaded.scenario_of(run.values).with_(seed=run.seed)
            scenario.save(file, overwrite=True)
        what = shlex.quote(self.path if file is None else str(file))
        trust = " --trust" if self.options.trust else ""
        replay = f"volery run {what} --seed {run.seed}{self._end_of(result)}{trust} --page"
        log = self.folder / result.log if result.log else None
        return TestedFlight(run.seed, changes, result, replay, log)

    def _study(self, name: str, scenario: Scenario) -> Study:
        options = self.options
        first = scenario.seed if options.seeds is None else options.first_seed
        seeds = list(range(first, first + (options.seeds or 1)))
        given: dict[str, Any] = {"seeds": seeds}
        if self.variations:
            parameters: dict[str, Any] = {"seed": {"key": "seed", "values": seeds}}
            for number, variation in enumerate(self.variations):
                values = [variation.value(variation.drawn(seed, number)) for seed in seeds]
                parameters[variation.name(number)] = {"key": variation.key, "values": values}
            given = {"combine": "list", "parameters": parameters}
        is_shipped = self.path in library.names()
        data = {
            "name": name,
            "scenario": self.path if is_shipped else str(Path(self.path).resolve()),
            "duration_s": options.seconds,
            "metrics": ["expectations"],
            "logs": "failed" if options.keeps_logs else "none",
            "run_timeout_s": options.timeout_s,
            **given,
        }
        return parse_study(data, f"test of {self.path}")

    def _changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Returns the values of a run's parameters but the seed, by their keys."""
        parameters = self.loaded.study.parameters
        changes = {parameters[name].key: value for name, value in values.items()}
        changes.pop("seed", None)
        return changes

    def _end_of(self, result: RunResult) -> str:
        """Returns the option that ends a flight a second after its failures are final."""
        end_s = final_s(map(Verdict.from_data, result.verdicts), self.loaded.scenario.expect) + 1.0
        if end_s >= self.loaded.duration_s:
            end_s = self.loaded.duration_s if self.options.seconds is not None else math.inf
        return f" --seconds {end_s:.1f}" if math.isfinite(end_s) else ""


def _fitted(variation: Variation, scenario: Scenario) -> Variation:
    """Returns a variation whose values are whole numbers if its key takes no others.

    Raises `ScenarioError` if the scenario has no such key, or rejects an end of the range.
    """
    problem = _problem(variation, scenario)
    if not problem:
        return variation
    whole = replace(variation, is_whole=True)
    if _problem(whole, scenario):
        raise ScenarioError(problem)
    return whole


def _problem(variation: Variation, scenario: Scenario) -> str:
    """Returns why a scenario rejects an end of a range, or a value inside; empty: it does not."""
    middle = 0.5 * (variation.low + variation.high) + 0.1 * (variation.high - variation.low)
    for number in (variation.low, variation.high, middle):
        try:
            scenario.with_({variation.key: variation.value(number)})
        except ScenarioError as error:
            return f"--vary {variation.key}={number:g}: {error}"
    return ""


def _study_name(path: str) -> str:
    words = _NAME.sub("_", Path(path).with_suffix("").as_posix().lower()).strip("_")
    return words[-60:].lstrip("_0123456789") or "scenario"
