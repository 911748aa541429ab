"""Reports of `volery test`: on the terminal, as JSON, and as JUnit XML."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext, redirect_stdout
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from volery.cli.scenario_searches import SearchedScenario, search_failures
from volery.cli.scenario_tests import TestedFlight, TestedScenario, TestOptions, run_tests
from volery.cli.terminal import echo_line, echo_lines
from volery.core.errors import ScenarioError, reason_of
from volery.core.plurals import counted
from volery.core.whole_files import write_whole
from volery.verdicts.verdict import Outcome, Verdict

_SIGNS = {Outcome.PASSED: ".", Outcome.FAILED: "F", Outcome.ERROR: "E"}


def report_tests(options: TestOptions, junit: Path | None, *, as_json: bool) -> bool:
    """Flies tests and reports them; returns whether all flights passed.

    junit: file of JUnit XML; None: none. as_json: prints JSON instead of the report. Raises
    `ScenarioError` for a test that cannot start, and if the file cannot be written.
    """
    start, finished = time.monotonic(), []
    with _quiet(as_json):
        for tested in run_tests(options):
            finished.append(tested)
            if not as_json:
                print_scenario(tested)
    if as_json:
        echo_lines(json_of(finished))
    else:
        print_summary(finished, time.monotonic() - start)
    if junit is not None:
        _write_junit(junit, finished)
    return not any(tested.failed for tested in finished)


def report_search(
    options: TestOptions, flights: int, sampler: str, junit: Path | None, *, as_json: bool
) -> bool:
    """Searches failures and reports them; returns whether none was found.

    junit: file of JUnit XML; None: none. Raises `ScenarioError` as `report_tests`.
    """
    with _quiet(as_json):
        searched = search_failures(options, flights, sampler)
    if junit is not None:
        _write_junit(junit, [each.tested for each in searched])
    if as_json:
        echo_lines(json.dumps([_searched(each) for each in searched], indent=1))
    else:
        for each in searched:
            _print_search(each)
    return not any(each.tested.failed for each in searched)


def _quiet(as_json: bool) -> AbstractContextManager[object]:
    """Sends what nodes and functions of the user print to stderr, if stdout carries JSON."""
    return redirect_stdout(sys.stderr) if as_json else nullcontext()


def _print_search(searched: SearchedScenario) -> None:
    path, (flight,) = searched.tested.path, searched.tested.flights
    flown = counted(searched.flights, "flight")
    if searched.file is not None:
        echo_line(f"{path}: a failure after {flown}")
        _print_failure(path, flight)
        echo_line(f"  saved   {searched.file}")
        return
    echo_line(f"{path}: no failure in {flown}; nearest to one: {_origin(flight)}")
    for margin, unit, name in _margins(flight):
        echo_line(f"  {margin:9.3g} {unit:4} {name}")


def _searched(searched: SearchedScenario) -> dict[str, Any]:
    flight = _plain(searched.tested.flights[0])
    return {
        "scenario": searched.tested.path,
        "flights": searched.flights,
        "failure": None if searched.file is None else flight,
        "nearest": flight if searched.file is None else None,
        "file": None if searched.file is None else str(searched.file),
    }


def print_scenario(tested: TestedScenario) -> None:
    """Prints a line for a scenario, and the verdicts on its failed flights."""
    signs = "".join(_SIGNS[_outcome(flight)] for flight in tested.flights)
    echo_line(f"{tested.path}  {signs}  {tested.seconds:.1f} s")
    for flight in tested.failed:
        _print_failure(tested.path, flight)


def print_summary(all_tested: Sequence[TestedScenario], seconds: float) -> None:
    """Prints how many flights failed, and the least margin of each expectation."""
    for tested in all_tested:
        margins = _min_margins(tested)
        if margins:
            echo_line(f"least margins of {tested.path}")
        for name, (margin, unit, seed) in margins.items():
            echo_line(f"  {margin:9.3g} {unit:4} {name} (seed {seed})")
    flights = sum(len(tested.flights) for tested in all_tested)
    failed = sum(len(tested.failed) for tested in all_tested)
    outcome = (
        f"{failed} of {counted(flights, 'flight')} failed"
        if failed
        else (f"{counted(flights, 'flight')} passed")
    )
    echo_line(f"{outcome} in {seconds:.1f} s")


def json_of(all_tested: Sequence[TestedScenario]) -> str:
    """Returns all verdicts as JSON."""
    return json.dumps(
        {
            "passed": not any(tested.failed for tested in all_tested),
            "scenarios": [
                {
                    "scenario": tested.path,
                    "flights": [_plain(flight) for flight in tested.flights],
                }
                for tested in all_tested
            ],
        },
        indent=1,
    )


def junit_of(all_tested: Sequence[TestedScenario]) -> bytes:
    """Returns JUnit XML: a suite for each scenario, a case for each expectation and seed."""
    root = ElementTree.Element("testsuites")
    for tested in all_tested:
        suite = ElementTree.SubElement(root, "testsuite", name=tested.path)
        counts = {"tests": 0, "failures": 0, "errors": 0, "skipped": 0}
        for flight in tested.flights:
            for verdict in flight.verdicts or [_ended(flight)]:
                counts["tests"] += 1
                counts["failures"] += verdict.outcome is Outcome.FAILED
                counts["errors"] += verdict.outcome is Outcome.ERROR
                _add_case(suite, tested, flight, verdict)
        for key, count in counts.items():
            suite.set(key, str(count))
        suite.set("time", f"{tested.seconds:.3f}")
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _write_junit(path: Path, all_tested: Sequence[TestedScenario]) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, junit_of(all_tested))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be written: {reason_of(error)}") from None


def _add_case(
    suite: ElementTree.Element, tested: TestedScenario, flight: TestedFlight, verdict: Verdict
) -> None:
    count = max(1, len(flight.verdicts))
    case = ElementTree.SubElement(
        suite,
        "testcase",
        classname=tested.path,
        name=_clean(f"seed {flight.seed}: {verdict.name}"),
        time=f"{flight.result.wall_s / count:.3f}",
    )
    if verdict.is_passed:
        return
    tag = "failure" if verdict.outcome is Outcome.FAILED else "error"
    problem = ElementTree.SubElement(
        case, tag, type=verdict.kind or tag, message=_clean(verdict.describe())
    )
    problem.text = _clean("\n".join([verdict.describe(), *_hints(flight), flight.result.traceback]))


def _print_failure(path: str, flight: TestedFlight) -> None:
    echo_line(f"FAILED {path}, {_origin(flight)}")
    for verdict in flight.verdicts or [_ended(flight)]:
        echo_line(f"  {verdict.outcome!s:7} {verdict.describe()}")
    for hint in _hints(flight):
        echo_line(f"  {hint}")


def _origin(flight: TestedFlight) -> str:
    """Returns the seed and the values of a flight."""
    changes = (f"{key} = {value}" for key, value in flight.changes.items())
    return ", ".join([f"seed {flight.seed}", *changes])


def _hints(flight: TestedFlight) -> list[str]:
    found = {"replay": flight.replay, "log": flight.log, "image": flight.image}
    return [f"{label:7} {value}" for label, value in found.items() if value]


def _ended(flight: TestedFlight) -> Verdict:
    """Returns the verdict on a flight that ended with an error."""
    return Verdict.of_flight(flight.result.error)


def _outcome(flight: TestedFlight) -> Outcome:
    found = [verdict.outcome for verdict in flight.verdicts or [_ended(flight)]]
    if Outcome.ERROR in found:
        return Outcome.ERROR
    return Outcome.FAILED if Outcome.FAILED in found else Outcome.PASSED


def _min_margins(tested: TestedScenario) -> dict[str, tuple[float, str, int]]:
    smallest: dict[str, tuple[float, str, int]] = {}
    for flight in tested.flights:
        for margin, unit, name in _margins(flight):
            if margin < smallest.get(name, (math.inf, "", 0))[0]:
                smallest[name] = (margin, unit, flight.seed)
    return smallest


def _margins(flight: TestedFlight) -> list[tuple[float, str, str]]:
    """Returns the margins of a flight's expectations that have one, with unit and name."""
    verdicts = [verdict for verdict in flight.verdicts if math.isfinite(verdict.margin)]
    return [(verdict.margin, verdict.unit, verdict.name) for verdict in verdicts]


def _plain(flight: TestedFlight) -> dict[str, Any]:
    result = flight.result
    return {
        "seed": flight.seed,
        "changes": dict(flight.changes),
        "passed": result.is_passed,
        "verdicts": list(result.verdicts),
        "error": result.error,
        "digest": result.digest,
        "simulated_s": result.simulated_s,
        "wall_s": result.wall_s,
        "replay": flight.replay,
        "log": None if flight.log is None else str(flight.log),
        "image": None if flight.image is None else str(flight.image),
    }


def _clean(text: str) -> str:
    """Returns text without the characters that XML forbids."""
    return "".join(c for c in text if c in "\t\n" or (c >= " " and c not in "\ufffe\uffff"))
