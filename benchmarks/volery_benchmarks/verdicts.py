"""Measures scenario tests: whether verdicts differ, what they cost, how soon a failure is found.

Each part is a function that returns figures; `measure(only=...)` runs some of them.

`repetitions`: one test again and again on one and two threads, while two processes burn the cores.
`processes`: a failing flight in processes with other environments. `avoidance`: flights of a minute
through forests by LIDAR, each seed its own forest. `overhead`: CPU time of `forest_survey` with ten
expectations, in turns with the same flight without. `search`: flights until the search finds a gust
that blows an avoiding UAV into a tree, beside random values. `grading`: submissions, some of them
hostile, and the digests of the others beside those of a grading without hostile ones.
"""

from __future__ import annotations

import json
import logging
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from volery.cluster.failure_search import FailureSearch, RandomSampler, Sampler, TpeSampler
from volery.cluster.loading import LoadedStudy, load_study, parse_study
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.study_runs import SweepOptions, executor_of, fly_runs
from volery.cluster.variations import Variation
from volery.core.machine import usable_cores
from volery.grading import grade, load_assignment
from volery.grading.submissions import find_submissions
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario
from volery.verdicts import judged_flight
from volery.verdicts.finished_run import digest_of
from volery.verdicts.flights import JudgedFlight
from volery_benchmarks import submissions
from volery_benchmarks.registry import chosen_parts

_LOG = logging.getLogger(__name__)
_Kinds: TypeAlias = tuple[tuple[str, Mapping[str, Any]], ...]
"""Kinds of expectations with their keys."""
_REPETITIONS, _QUICK_REPETITIONS = 1000, 20
_AVOIDANCE, _QUICK_AVOIDANCE = 1000, 10
_AVOIDANCE_S = 60.0
_TURNS, _QUICK_TURNS = 15, 2
_OVERHEAD_S = 20.0
_SEARCHES, _QUICK_SEARCHES = 20, 2
_MAX_FLIGHTS = 200
_MAX_RANDOM_FLIGHTS = 1000
_SUBMISSIONS, _QUICK_SUBMISSIONS = 27, 3
_HOVER: _Kinds = (
    ("no_contact", {}),
    ("speed", {"at_most_m_s": 1.2}),
    ("inside", {"region_m": (-1.0, -1.0, 1.0, 1.0)}),
    ("formula", {"formula": "eventually(z > 2, 0, 4) and always(speed < 1.3)"}),
    ("topic_rate", {"topic": "imu", "at_least_hz": 150.0}),
)
"""Some of them fail by little, so that any difference would show."""
_TEN: _Kinds = (
    ("no_contact", {}),
    ("no_crash", {}),
    ("separation", {"at_least_m": 5.0}),
    ("clearance", {"at_least_m": 0.2}),
    ("inside", {"height_m": (-1.0, 30.0)}),
    ("speed", {"at_most_m_s": 8.0}),
    ("battery", {"at_least": 0.1}),
    ("topic_rate", {"topic": "odom", "at_least_hz": 20.0}),
    ("no_log_message", {"level": "error"}),
    ("formula", {"formula": "always(speed < 9) and eventually(z > 1)"}),
)
_ENVIRONMENTS: tuple[Mapping[str, str], ...] = (
    {"PYTHONHASHSEED": "1", "LANG": "C"},
    {"PYTHONHASHSEED": "77", "TZ": "Asia/Tokyo", "OMP_NUM_THREADS": "1"},
    {"PYTHONHASHSEED": "random", "PYTHONOPTIMIZE": "1"},
)
_REPLAY = (
    "import sys; from volery_benchmarks.verdicts import print_replay; "
    "print_replay(int(sys.argv[1]))"
)


def measure(*, quick: bool = False, only: Sequence[str] = ()) -> dict[str, float]:
    """Returns the figures of the parts named in `only`, by default of all.

    Raises `VoleryError` for an unknown part.
    """
    figures: dict[str, float] = {}
    for name in chosen_parts("verdicts", PARTS, only):
        _LOG.info("%s", name)
        figures |= PARTS[name](quick)
    return figures


def _repetitions(quick: bool) -> dict[str, float]:
    count = _QUICK_REPETITIONS if quick else _REPETITIONS
    scenario = _expecting(_bare("hover").with_(duration_s=5.0, wind=(3.0, 0, 0)), _HOVER)
    expected = _outcome(judged_flight(scenario))
    verdicts = digests = 0
    with _burning(2):
        for number in range(count):
            found = _outcome(judged_flight(scenario, threads=1 + number % 2))
            verdicts += found["verdicts"] != expected["verdicts"]
            digests += found["digest"] != expected["digest"]
    return {
        "repetitions": float(count),
        "verdicts_that_differ": float(verdicts),
        "digests_that_differ": float(digests),
    }


def _processes(_quick: bool) -> dict[str, float]:
    expected = _outcome(judged_flight(_failing(7)))
    assert not all(verdict["outcome"] == "passed" for verdict in expected["verdicts"])
    equal = 0
    for changes in _ENVIRONMENTS:
        with tempfile.TemporaryDirectory() as folder:
            found = subprocess.run(
                [sys.executable, "-c", _REPLAY, "7"],
                cwd=folder,
                env={**os.environ, **changes},
                capture_output=True,
                check=True,
                text=True,
            )
        equal += json.loads(found.stdout) == expected
    return {"replays": float(len(_ENVIRONMENTS)), "replays_equal": float(equal)}


def print_replay(seed: int) -> None:
    """Prints digest and verdicts of the failing flight with a seed."""
    sys.stdout.write(json.dumps(_outcome(judged_flight(_failing(seed)))))


def _avoidance(quick: bool) -> dict[str, float]:
    count = _QUICK_AVOIDANCE if quick else _AVOIDANCE
    scenario = _bare("forest_procedural")
    scenario = scenario.with_({"uavs[0].count": 1, "duration_s": _AVOIDANCE_S})
    with _study(scenario.expecting("no_contact"), seeds=count) as (loaded, folder):
        start = time.monotonic()
        plan = fly_runs(loaded, SweepOptions(folder, usable_cores(), reuses_results=False))
        minutes = (time.monotonic() - start) / 60.0
    results = list(plan.results.values())
    return {
        "avoidance_flights": float(count),
        "avoidance_minutes": minutes,
        "avoidance_cpu_s": statistics.fmean(result.cpu_s for result in results),
        "avoidance_failed": float(sum(not result.is_passed for result in results)),
    }


def _overhead(quick: bool) -> dict[str, float]:
    plain = _bare("forest_survey").with_(duration_s=_OVERHEAD_S)
    judged = _expecting(plain, _TEN)
    _cpu_s(judged)  # compiles
    ratios = []
    for turn in range(_QUICK_TURNS if quick else _TURNS):
        pair = (plain, judged) if turn % 2 else (judged, plain)
        seconds = {scenario is judged: _cpu_s(scenario) for scenario in pair}
        ratios.append(seconds[True] / seconds[False])
    return {
        "overhead_of_ten": statistics.median(ratios) - 1.0,
        "overhead_of_ten_least": min(ratios) - 1.0,
        "overhead_of_ten_greatest": max(ratios) - 1.0,
    }


def _search(quick: bool) -> dict[str, float]:
    seeds = range(1, 1 + (_QUICK_SEARCHES if quick else _SEARCHES))
    variations = [Variation.of(text) for text in _GUST]
    with _study(_gusty(), vary=variations) as (loaded, folder):
        options = SweepOptions(folder, usable_cores())
        results = ResultsFolder(folder)
        with results.locked(), closing(executor_of(loaded, options, results)) as executor:
            executor.prepare()

            def flights(kind: Callable[[int, int], Sampler], seed: int, max_flights: int) -> int:
                search = FailureSearch(loaded, variations, (1, 1), executor)
                found = search.search(kind(search.dimensions, seed), max_flights)
                return max_flights + 1 if found.result.is_passed else found.flights

            guided = [flights(TpeSampler, seed, _MAX_FLIGHTS) for seed in seeds]
            random = [flights(RandomSampler, seed, _MAX_RANDOM_FLIGHTS) for seed in seeds]
    return {
        "search_found": sum(count <= _MAX_FLIGHTS for count in guided) / len(guided),
        "search_flights_median": statistics.median(guided),
        "search_flights_max": float(max(guided)),
        "random_flights_median": statistics.median(random),
        "random_to_search": statistics.fmean(random) / statistics.fmean(guided),
    }


def _grading(quick: bool) -> dict[str, float]:
    count = _QUICK_SUBMISSIONS if quick else _SUBMISSIONS
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        assignment = load_assignment(submissions.write_assignment(folder))
        submissions.write_fair(folder / "alone", count)
        submissions.write_fair(folder / "all", count)
        submissions.write_hostile(folder / "all")
        alone = grade(assignment, find_submissions(folder / "alone"))
        start = time.monotonic()
        among = grade(assignment, find_submissions(folder / "all"))
        minutes = (time.monotonic() - start) / 60.0
    found = {graded.submission: graded for graded in among}
    same = sum(
        [flight.digest for flight in found[graded.submission].flights]
        == [flight.digest for flight in graded.flights]
        for graded in alone
    )
    hostile = [graded for graded in among if graded.submission.startswith("hostile")]
    return {
        "graded": float(len(among)),
        "grading_minutes": minutes,
        "graded_as_alone": float(same),
        "hostile_points": max(graded.total for graded in hostile),
    }


PARTS: dict[str, Callable[[bool], dict[str, float]]] = {
    "repetitions": _repetitions,
    "processes": _processes,
    "avoidance": _avoidance,
    "overhead": _overhead,
    "search": _search,
    "grading": _grading,
}
"""Functions of the parts; their argument is `quick`."""

_GUST = (
    "faults[0].at_s=1:8",
    "faults[0].velocity_m_s[0]=-11:11",
    "faults[0].velocity_m_s[1]=-11:11",
)
"""When a gust comes, and its velocity."""


def _bare(name: str) -> Scenario:
    """Returns a shipped scenario without its own expectations."""
    return load_scenario(name).with_(expect=[])


def _gusty() -> Scenario:
    """Returns a short flight between trees by LIDAR, with a gust."""
    scenario = _bare("forest_procedural")
    gust = {"kind": "gust", "at_s": 1.0, "hold_s": 2.0, "velocity_m_s": [0.0, 0.0, 0.0]}
    changed = scenario.with_(
        {"uavs[0].count": 1, "duration_s": 12.0, "seed": 1, "faults": [gust]},
    )
    return changed.expecting("clearance", at_least_m=0.2).expecting("no_contact")


def _failing(seed: int) -> Scenario:
    """Returns a flight that fails a little after its start."""
    scenario = _bare("hover").with_(duration_s=5.0, seed=seed, wind=(6.0, 2.0, 0.0))
    return scenario.expecting("speed", at_most_m_s=1.0).expecting("no_contact")


def _expecting(scenario: Scenario, kinds: _Kinds) -> Scenario:
    for kind, keys in kinds:
        scenario = scenario.expecting(kind, **keys)
    return scenario


def _outcome(judged: JudgedFlight) -> dict[str, Any]:
    """Returns all of a flight that must not differ, as JSON gives it back."""
    found = {
        "digest": digest_of(judged.flight),
        "verdicts": [verdict.to_data() for verdict in judged.verdicts],
    }
    plain: dict[str, Any] = json.loads(json.dumps(found))
    return plain


def _cpu_s(scenario: Scenario) -> float:
    """Returns the CPU time of a flight, and of its verdicts if it has expectations."""
    if scenario.expect:
        start = time.process_time()
        judged_flight(scenario)
        return time.process_time() - start
    start = time.process_time()
    with Simulation(scenario) as simulation:
        simulation.run()
    return time.process_time() - start


@contextmanager
def _burning(cores: int) -> Iterator[None]:
    """Keeps cores busy."""
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(cores)]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


@contextmanager
def _study(
    scenario: Scenario, *, seeds: int = 1, vary: Sequence[Variation] = ()
) -> Iterator[tuple[LoadedStudy, Path]]:
    """Yields a study of a scenario by its expectations, and a folder for its results."""
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "scenario.toml"
        scenario.save(file)
        given: dict[str, Any] = {"seeds": list(range(1, seeds + 1))}
        if vary:
            given["parameters"] = {
                variation.name(number): {"key": variation.key, "values": [variation.low]}
                for number, variation in enumerate(vary)
            }
        data = {
            "name": "verdicts",
            "scenario": str(file),
            "metrics": ["expectations"],
            "logs": "none",
            **given,
        }
        yield load_study(parse_study(data, "bench verdicts")), Path(name) / "results"
