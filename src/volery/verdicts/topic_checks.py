"""Checks of expectations about topics, estimates, logs and the simulation itself."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.near_names import near_miss
from volery.core.rotations import matrix
from volery.graph.nodes.logger import ROSOUT, LoggingSeverity
from volery.results.alignment import at_times, common_times, umeyama
from volery.scenario.expectations import (
    EstimateErrorExpectation,
    LogMessageExpectation,
    NeesExpectation,
    PredicateExpectation,
    RealTimeFactorExpectation,
    TopicRateExpectation,
    TopicValueExpectation,
)
from volery.verdicts.finished_run import FinishedRun
from volery.verdicts.observing import (
    ESTIMATES,
    MISSING,
    Estimate,
    TopicRecord,
    topics_of,
)
from volery.verdicts.path_checks import rows_of, samples_of
from volery.verdicts.verdict import Finding, JudgmentError

_MIN_POSES = 3
_LINE = 200
"""Characters of a log message in a verdict."""


def topic_rate(run: FinishedRun, expectation: TopicRateExpectation) -> Finding:
    """Judges by the window with the fewest messages."""
    times_s = run.flight.times_s[samples_of(run.flight, expectation.from_s, expectation.until_s)]
    start, end = float(times_s[0]), float(times_s[-1])
    width = min(expectation.window_s, end - start)
    if width <= 0.0:
        raise JudgmentError(f"the flight ended at {end:g} s")
    worst = Finding("", math.inf)
    for uav, topic, record in _records(run, expectation):
        for number in range(max(1, math.floor((end - start) / width + 1e-6))):
            first = start + number * width
            rate = _count(record, first, first + width) / width
            if rate - expectation.at_least_hz < worst.margin:
                margin = rate - expectation.at_least_hz
                what = f"{rate:g} Hz" if record.times_s else _silent(run, topic)
                worst = Finding(what, margin, "Hz", first, uav)
    return worst


def topic_value(run: FinishedRun, expectation: TopicValueExpectation) -> Finding:
    """Judges by the UAV whose values fit least."""
    samples_of(run.flight, expectation.from_s, expectation.until_s)
    until_s = math.inf if expectation.until_s is None else expectation.until_s
    found = []
    for uav, topic, record in _records(run, expectation):
        first = bisect_left(record.times_s, expectation.from_s)
        last = bisect_right(record.times_s, until_s)
        times_s = record.times_s[first:last]
        values = record.values[expectation.field][first:last]
        if not times_s:
            what = f"no message on {topic}" if record.times_s else _silent(run, topic)
            found.append(Finding(what, uav=uav, is_passed=False))
            continue
        margins = [_margin(value, expectation, topic) for value in values]
        if expectation.when == "at_end":
            k = len(margins) - 1
        elif expectation.when == "always":
            k = int(np.argmin(margins))
        else:
            k = int(np.argmax(margins))
            k = next((i for i, margin in enumerate(margins) if margin >= 0.0), k)
        finite = math.isfinite(margins[k])
        margin = margins[k] if finite else math.nan
        text = f"{expectation.field} = {_shown(values[k])}"
        found.append(Finding(text, margin, "", times_s[k], uav, margins[k] >= 0.0))
    return min(found, key=_rank)


def estimate_error(run: FinishedRun, expectation: EstimateErrorExpectation) -> Finding:
    """Judges by the UAV with the greatest absolute trajectory error."""
    found = []
    for uav, estimate, truth in _trajectories(run, expectation):
        times_s = estimate.times_s
        residual = umeyama(estimate.position, truth).apply(estimate.position) - truth
        lengths = np.linalg.norm(residual, axis=1)
        rmse = float(np.sqrt((lengths * lengths).mean()))
        k = int(np.argmax(lengths))
        text = f"RMSE {rmse:.3f} m, {lengths[k]:.3f} m at most"
        margin = expectation.at_most_m - rmse
        found.append(Finding(text, margin, "m", float(times_s[k]), uav))
    return min(found, key=_rank)


def nees(run: FinishedRun, expectation: NeesExpectation) -> Finding:
    """Judges by the UAV whose mean NEES is farthest from the bounds."""
    found = []
    for uav, estimate, truth in _trajectories(run, expectation):
        times_s, covariance = estimate.times_s, estimate.covariance
        turn = _turn_at_start(run, uav, estimate)
        residual = (estimate.position - estimate.position[0]) @ turn.T + truth[0] - truth
        covariance = turn @ covariance @ turn.T
        usable: NDArray[np.bool_] = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
        known = np.where(usable.reshape(-1, 1, 1), covariance, 0.0)
        usable = usable & (np.linalg.det(known) > 0.0)
        if not usable.any():
            raise JudgmentError(f"{uav}: its estimate has no covariance")
        e, p = residual[usable], covariance[usable]
        values = np.einsum("ki,ki->k", e, np.linalg.solve(p, e[..., None])[..., 0])
        mean = float(values.mean())
        margin = min(expectation.at_most - mean, mean - expectation.at_least)
        k = int(np.argmax(values))
        found.append(Finding(f"mean NEES {mean:.2f}", margin, "", float(times_s[usable][k]), uav))
    return min(found, key=_rank)


def no_log_message(run: FinishedRun, expectation: LogMessageExpectation) -> Finding:
    """Judges by the first message of the level."""
    record = run.topics.get(ROSOUT, TopicRecord())
    empty: list[Any] = []
    columns = [record.values.get(path, empty) for path in ("level", "name", "msg")]
    for time_s, level, node, text in zip(record.times_s, *columns, strict=True):
        uav = str(node).strip("/").partition(".")[0]
        concerns = not expectation.uavs or uav in expectation.uavs
        if (
            level >= LoggingSeverity[expectation.level.upper()]
            and expectation.contains in text
            and concerns
        ):
            line = " ".join(str(text).split())[:_LINE]
            return Finding(f"[{node}] {line}", time_s=time_s, is_passed=False)
    return Finding("none", is_passed=True)


def real_time_factor(run: FinishedRun, expectation: RealTimeFactorExpectation) -> Finding:
    """Judges by the whole flight."""
    if run.wall_s <= 0.0:
        raise JudgmentError("the wall time is unknown")
    factor = run.flight.duration_s / run.wall_s
    return Finding(f"{factor:.2f}", factor - expectation.at_least)


def _records(
    run: FinishedRun, expectation: TopicRateExpectation | TopicValueExpectation
) -> Iterator[tuple[str, str, TopicRecord]]:
    """Yields UAV, topic and record of each topic of an expectation."""
    rows = rows_of(run.flight, expectation)
    uavs = [run.flight.uavs[row] for row in rows]
    if expectation.topic.startswith("/"):
        uavs = [""]
    for uav in uavs:
        (topic,) = topics_of(expectation.topic, (uav,))
        yield uav, topic, run.topics.get(topic, TopicRecord(values=_no_values(expectation)))


def silent_topics(run: FinishedRun, expectation: PredicateExpectation) -> str:
    """Returns which of a predicate's topics had no message, as text; empty: none."""
    uavs = expectation.uavs or run.flight.uavs
    named = [topic for each in expectation.topics for topic in topics_of(each, uavs)]
    silent = [topic for topic in named if not run.topics.get(topic, TopicRecord()).times_s]
    return _silent(run, silent[0]) if silent else ""


def _silent(run: FinishedRun, topic: str) -> str:
    """Returns that a topic had no message, with the nearest name if the graph does not have it."""
    known = [] if run.simulation is None else [t.name for t in run.simulation.graph.topics()]
    hint = "" if topic in known else near_miss(topic, known).rstrip(".")
    return f"no message on {topic}{hint}"


def _no_values(expectation: TopicRateExpectation | TopicValueExpectation) -> dict[str, list[Any]]:
    return {expectation.field: []} if isinstance(expectation, TopicValueExpectation) else {}


def _count(record: TopicRecord, start_s: float, end_s: float) -> int:
    """Returns the number of messages in a window, whose end belongs to the next one."""
    return bisect_left(record.times_s, end_s - 1e-9) - bisect_left(record.times_s, start_s - 1e-9)


def _margin(value: Any, expectation: TopicValueExpectation, topic: str) -> float:
    """Returns the margin of a value; without bounds, inf for an equal one, else -inf."""
    if value is MISSING:
        raise JudgmentError(f"a message on {topic} has no field '{expectation.field}'")
    number = _plain(value)
    if expectation.equals is not None and isinstance(number, bool | int | float | str | None):
        return math.inf if number == expectation.equals else -math.inf
    if isinstance(number, bool) or not isinstance(number, int | float):
        what = f"{expectation.field} of {topic} is {_shown(value)}"
        needed = "no number" if expectation.equals is None else "neither a number nor a text"
        raise JudgmentError(f"{what}, which is {needed}")
    if math.isnan(number):
        raise JudgmentError(f"{expectation.field} of {topic} is not a number (NaN)")
    low = -math.inf if expectation.at_least is None else expectation.at_least
    high = math.inf if expectation.at_most is None else expectation.at_most
    return min(number - low, high - number)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _shown(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return f"{value:.6g}"
    is_plain = isinstance(value, str | int | np.generic | list | dict)
    return f"{value}"[:80] if is_plain else f"a {type(value).__name__}"


def _trajectories(
    run: FinishedRun, expectation: EstimateErrorExpectation | NeesExpectation
) -> Iterator[tuple[str, Estimate, Array]]:
    """Yields UAV, estimate and true positions (K, 3) m, map, at its times."""
    if not run.estimates:
        raise JudgmentError(f"no UAV publishes {', '.join(ESTIMATES[:-1])} or {ESTIMATES[-1]}")
    for row in rows_of(run.flight, expectation):
        uav = run.flight.uavs[row]
        if uav not in run.estimates:
            raise JudgmentError(f"{uav} publishes no estimate of its pose")
        whole = run.estimates[uav]
        inside = common_times(whole.times_s, run.flight.times_s)
        if inside.sum() < _MIN_POSES:
            raise JudgmentError(
                f"{uav} has published {inside.sum()} poses, fewer than {_MIN_POSES}"
            )
        estimate = Estimate(*(column[inside] for column in whole))
        yield uav, estimate, at_times(run.flight.times_s, run.flight[uav].position_map, estimate[0])


def _turn_at_start(run: FinishedRun, uav: str, estimate: Estimate) -> Array:
    """Returns the rotation (3, 3) into the map by which the first estimated attitude is true.

    Covariances are relative to the start, where the frame of an estimate begins.
    """
    flight = run.flight[uav]
    sample = int(np.argmin(np.abs(flight.times_s - estimate.times_s[0])))
    return np.asarray(matrix(flight.attitude[sample]) @ matrix(estimate.attitude[0]).T)


def _rank(finding: Finding) -> tuple[bool, float]:
    """Orders findings from the worst: failures first, then by margin."""
    passed = finding.margin >= 0.0 if finding.is_passed is None else finding.is_passed
    return passed, math.inf if math.isnan(finding.margin) else finding.margin
