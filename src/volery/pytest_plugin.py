"""A plugin of pytest: scenarios with `[[expect]]` are tests, and tests fly scenarios.

pytest loads it by its entry point. It collects scenarios named `test_*.toml` or `*_test.toml`, one
test for each seed, and offers the fixture `flight` and the marker `seeds`; docs/scenario_tests.md
explains it. `-p no:volery.pytest_plugin` switches it off.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from volery.core.errors import ScenarioError, VoleryError

if TYPE_CHECKING:
    from volery.scenario.schema import Scenario
    from volery.verdicts.flights import JudgedFlight

_PATTERNS = ("test_*.toml", "*_test.toml")
_UNSAFE = re.compile(r"[^\w.-]+")


class FlightFailedError(AssertionError):
    """A flight did not pass.

    The first line is the first failure, the others are the verdicts and the files that were kept.
    """

    __module__ = "builtins"  # as of pytest's own failures: the summary has room for the failure


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds the options of the plugin."""
    group = parser.getgroup("volery", "Volery")
    group.addoption(
        "--volery-seeds",
        type=int,
        metavar="N",
        help="fly scenario files and tests marked `seeds` with seeds 1 to N",
    )
    group.addoption(
        "--volery-out",
        type=Path,
        default=Path("runs/test"),
        metavar="DIR",
        help="folder for logs and maps of failed flights",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Registers the marker."""
    config.addinivalue_line(
        "markers", "seeds(n): runs the test with `seed` from 1 to n, a fixture of Volery's plugin"
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Runs a test with the marker `seeds` once for each seed."""
    marker = metafunc.definition.get_closest_marker("seeds")
    if marker is not None and "seed" in metafunc.fixturenames:
        count = metafunc.config.getoption("--volery-seeds") or marker.args[0]
        metafunc.parametrize("seed", range(1, count + 1))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
    """Collects scenario files."""
    if not any(file_path.match(pattern) for pattern in _PATTERNS):
        return None
    from volery.scenario.load import has_tables

    return ScenarioFile.from_parent(parent, path=file_path) if has_tables(file_path) else None


class ScenarioFile(pytest.File):
    """A scenario file, with a test for each seed."""

    def collect(self) -> Iterator[ScenarioTest]:
        """Yields the tests. Raises `CollectError` for an invalid file, or without [[expect]]."""
        from volery.scenario.load import load_scenario

        try:
            scenario = load_scenario(self.path, trust=True)  # as pytest trusts Python beside it
            if not scenario.expect:
                raise ScenarioError(f"{self.path.name}: expects nothing: add [[expect]]")
        except VoleryError as error:
            raise self.CollectError(str(error)) from None
        count = self.config.getoption("--volery-seeds")
        for seed in [scenario.seed] if count is None else range(1, count + 1):
            test = ScenarioTest.from_parent(self, name=f"seed {seed}")
            test.scenario = scenario.with_(seed=seed)
            yield test


class ScenarioTest(pytest.Item):
    """A flight of a scenario file with one seed."""

    scenario: Scenario
    """The scenario with its seed."""

    def runtest(self) -> None:
        """Flies and judges. Raises `FlightFailedError` if the flight does not pass."""
        from volery.verdicts.flights import judged_flight

        _check(self, self.scenario, judged_flight(self.scenario))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Returns the verdicts, without a traceback; other errors as pytest shows them."""
        if isinstance(excinfo.value, VoleryError | FlightFailedError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Returns the position of the test for reports."""
        return self.path, None, f"{self.path.name}::{self.name}"


@pytest.fixture
def flight(request: pytest.FixtureRequest) -> Callable[..., JudgedFlight]:
    """Flies scenarios: `flight("hop.toml", seed=3, wind=[3.0, 0.0, 0.0])`.

    A relative file is beside the test. Keys are those of `Scenario.with_`. Returns the flight with
    its verdicts; fails the test if one of them is not passed, unless `check=False`.
    """
    from volery.scenario.load import load_scenario
    from volery.scenario.schema import Scenario
    from volery.verdicts.flights import judged_flight

    def fly(scenario: Scenario | str | Path, *, check: bool = True, **keys: Any) -> JudgedFlight:
        __tracebackhide__ = True
        problem = ""
        try:
            if not isinstance(scenario, Scenario):
                file = request.path.parent / scenario
                is_file = file.suffix == ".toml" or file.exists()
                scenario = load_scenario(file if is_file else scenario, trust=True)
            flown = scenario.with_(keys) if keys else scenario
            judged = judged_flight(flown)
        except ScenarioError as error:
            problem = str(error)
        if problem:  # outside, so that pytest shows no lines of Volery
            pytest.fail(problem)
        if check:
            _check(request.node, flown, judged)
        return judged

    return fly


def _check(item: pytest.Item, scenario: Scenario, judged: JudgedFlight) -> None:
    """Raises `FlightFailedError` for a failed flight, of which it keeps files."""
    __tracebackhide__ = True
    if judged.is_passed:
        return
    failures = [verdict.describe() for verdict in judged.verdicts if not verdict.is_passed]
    more = f" (and {len(failures) - 1} more)" if len(failures) > 1 else ""
    lines = [f"{verdict.outcome!s:7} {verdict.describe()}" for verdict in judged.verdicts]
    for kind, hint in _kept(item, scenario, judged):
        item.user_properties.append((kind, hint))
        lines.append(f"{kind:7} {hint}")
    first = f"{scenario.name}, seed {scenario.seed}: {failures[0]}{more}"
    raise FlightFailedError("\n".join([first, *lines]))


def _kept(item: pytest.Item, scenario: Scenario, judged: JudgedFlight) -> Sequence[tuple[str, str]]:
    """Writes the scenario of a failed flight, its log and a map of its paths.

    Returns their paths and the command that repeats the flight. It is flown again for the log.
    """
    from volery.cluster.single_runs import SingleRun
    from volery.runtime.flight_recorder import DEFAULT_RATE_HZ
    from volery.verdicts.failure_map import failure_png
    from volery.verdicts.judging import Judge, final_s

    folder: Path = item.config.rootpath / item.config.getoption("--volery-out")
    folder.mkdir(parents=True, exist_ok=True)
    name = _UNSAFE.sub("_", item.nodeid).strip("_")[-120:]
    file, log, image = (folder / f"{name}{end}" for end in (".toml", ".mcap", ".png"))
    judge = Judge(scenario)
    with SingleRun(scenario, DEFAULT_RATE_HZ, log, judge.needs, judge) as run:
        run.fly()
    image.write_bytes(failure_png(judged.flight, judged.verdicts, scenario.expect))
    scenario.save(file, overwrite=True)
    end_s = final_s(judged.verdicts, scenario.expect) + 1.0
    seconds = f" --seconds {end_s:.1f}" if end_s < scenario.duration_s else ""
    replay = f"volery run {shlex.quote(str(file))}{seconds} --trust --page"
    return (("replay", replay), ("log", str(log)), ("image", str(image)))
