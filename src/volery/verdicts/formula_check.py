"""Checks temporal formulas: their robustness at the beginning of each UAV's flight.

The robustness is how far a formula is from becoming false, in the unit of its signals: differences
at comparisons, min and max over parts and times (A. Donze and O. Maler, Robust satisfaction of
temporal logic over real-valued signals, FORMATS 2010). Windows end with the flight: what is to hold
always need not hold later, and what is to hold eventually must hold before. A window that begins
after the end of the flight cannot be judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.rotations import matrix
from volery.results import FlightResult
from volery.scenario.expectations import FormulaExpectation
from volery.scenario.formulas import (
    Comparison,
    Connective,
    Formula,
    Number,
    Signal,
    Temporal,
    Term,
    parse_formula,
)
from volery.verdicts.finished_run import FinishedRun
from volery.verdicts.path_checks import rows_of
from volery.verdicts.verdict import Finding, JudgmentError

_MAX_UNTIL = 2e8
"""Samples times samples of the window of an `until` that are computed at most."""

_OPERATIONS: Mapping[str, Callable[..., Array]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "abs": np.abs,
    "min": lambda *values: np.min(values, axis=0),
    "max": lambda *values: np.max(values, axis=0),
}


class _Robustness(NamedTuple):
    """Robustness (T,) at each sample, and what decides it (T, 2): a sample and a comparison."""

    value: Array
    decided_by: NDArray[np.int64]


def formula(run: FinishedRun, expectation: FormulaExpectation) -> Finding:
    """Judges by the UAV with the smallest robustness."""
    parsed, worst = parse_formula(expectation.formula), Finding("", math.inf)
    needed_s = _last_begin_s(parsed)
    for row in rows_of(run.flight, expectation):
        signals = _Signals(run.flight, int(row))
        if not len(signals.times_s):
            continue
        lasts_s = float(signals.times_s[-1] - signals.times_s[0])
        if needed_s > lasts_s + 0.5 * signals.period_s:
            raise JudgmentError(
                f"{signals.uav}: a window begins after {needed_s:g} s, the flight ends after "
                f"{lasts_s:g} s"
            )
        found = _evaluate(parsed, signals)
        margin, (sample, comparison) = float(found.value[0]), found.decided_by[0]
        if math.isnan(margin):
            raise JudgmentError(f"{signals.uav}: a signal of the formula is not a number")
        if math.isinf(margin):
            raise JudgmentError(
                f"{signals.uav}: the robustness is infinite: a window that moves beyond the end of "
                "the flight, a division by zero, or the separation of a UAV without others"
            )
        if not worst.uav or margin < worst.margin:
            time_s = float(signals.times_s[sample])
            text = f"robustness {margin:.3g} of {signals.comparisons[comparison].text}"
            worst = Finding(text, margin, "", time_s, signals.uav)
    if not worst.uav:
        raise JudgmentError("the flight has no UAV")
    return worst


class _Signals:
    """Signals of one UAV, T samples at which it exists."""

    def __init__(self, flight: FlightResult, row: int) -> None:
        self._flight, self._row = flight, row
        self._exists = np.isfinite(flight.position_map[row]).all(axis=1)
        self.uav = flight.uavs[row]
        self.times_s = flight.times_s[self._exists]
        """(T,) s."""
        steps = np.diff(self.times_s)
        self.period_s = float(np.median(steps)) if len(steps) else 1.0
        """Time between two samples, s."""
        self.comparisons: list[Comparison] = []
        """Comparisons evaluated so far."""

    def __getitem__(self, name: str) -> Array:
        flight, row, exists = self._flight, self._row, self._exists
        match name:
            case "t":
                found = self.times_s
            case "x" | "y" | "z":
                found = flight.position_map[row, exists, "xyz".index(name)]
            case "vx" | "vy" | "vz":
                found = flight.velocity_map[row, exists, "xyz".index(name[1])]
            case "speed":
                found = flight.speed_m_s[row, exists]
            case "battery":
                found = flight.battery_charge[row, exists]
            case "tilt_deg":
                up = matrix(flight.attitude[row, exists])[:, 2, 2]
                found = np.degrees(np.arccos(np.clip(up, -1.0, 1.0)))
            case _:
                found = self._separation()
        return np.asarray(found, np.float64)

    def _separation(self) -> Array:
        """Returns distances (T,) to the nearest other UAV, m; inf without one."""
        position = self._flight.position_map[:, self._exists]
        apart = np.linalg.norm(position - position[self._row], axis=2)
        apart[self._row] = np.inf
        return np.asarray(np.where(np.isnan(apart), np.inf, apart).min(axis=0))


def _last_begin_s(node: Formula) -> float:
    """Returns the latest time after the start at which a window of a formula begins, s."""
    if isinstance(node, Comparison):
        return 0.0
    begin_s = node.interval_s[0] if isinstance(node, Temporal) else 0.0
    return begin_s + max(_last_begin_s(part) for part in node.parts)


def _evaluate(node: Formula, signals: _Signals) -> _Robustness:
    if isinstance(node, Comparison):
        with np.errstate(invalid="ignore"):
            apart = _values(node.left, signals) - _values(node.right, signals)
        here = np.arange(len(signals.times_s))
        decided_by = np.stack((here, np.full_like(here, len(signals.comparisons))), axis=1)
        signals.comparisons.append(node)
        return _Robustness(-np.abs(apart) if node.is_equality else apart, decided_by)
    parts = [_evaluate(part, signals) for part in node.parts]
    if isinstance(node, Connective):
        if node.operator == "not":
            return _negated(parts[0])
        return reduce(_min if node.operator == "and" else _max, parts)
    first, last = _window(node, signals)
    if node.operator == "always":
        negated = _sliding_max(_negated(parts[0]), first, last)
        return _negated(negated)
    if node.operator == "eventually":
        return _sliding_max(parts[0], first, last)
    return _until(parts[0], parts[1], first, last)


def _values(term: Term, signals: _Signals) -> Array:
    """Returns the values (T,) of a term."""
    if isinstance(term, Number):
        return np.full(len(signals.times_s), term.value)
    if isinstance(term, Signal):
        return signals[term.name]
    with np.errstate(all="ignore"):
        values = [_values(each, signals) for each in term.terms]
        return np.asarray(_OPERATIONS[term.operator](*values), np.float64)


def _window(node: Temporal, signals: _Signals) -> tuple[int, int]:
    """Returns the first and the last sample of a window, counted from now."""
    a, b = (time_s / signals.period_s for time_s in node.interval_s)
    longest = len(signals.times_s)
    first = math.ceil(min(a, longest) - 1e-6)
    last = math.floor(min(b, longest) + 1e-6)
    return first, max(first, last)


def _negated(one: _Robustness) -> _Robustness:
    return _Robustness(-one.value, one.decided_by)


def _max(one: _Robustness, other: _Robustness) -> _Robustness:
    is_one = ~(other.value > one.value)
    return _Robustness(
        np.where(is_one, one.value, other.value),
        np.where(is_one[:, None], one.decided_by, other.decided_by),
    )


def _min(one: _Robustness, other: _Robustness) -> _Robustness:
    return _negated(_max(_negated(one), _negated(other)))


def _shifted(one: _Robustness, samples: int) -> _Robustness:
    """Returns the robustness some samples later; -inf, decided by the last one, after the end."""
    count = len(one.value)
    value, decided_by = np.full(count, -np.inf), np.tile(one.decided_by[-1], (count, 1))
    kept = max(0, count - samples)
    value[:kept], decided_by[:kept] = one.value[samples:], one.decided_by[samples:]
    return _Robustness(value, decided_by)


def _sliding_max(one: _Robustness, first: int, last: int) -> _Robustness:
    """Returns the max over the samples from `first` to `last` after now, by doubled windows."""
    width, found = 1, one
    while 2 * width <= last - first + 1:
        found = _max(found, _shifted(found, width))
        width *= 2
    return _max(_shifted(found, first), _shifted(found, last + 1 - width))


def _until(one: _Robustness, other: _Robustness, first: int, last: int) -> _Robustness:
    count = len(one.value)
    if count * (last + 1) > _MAX_UNTIL:
        raise JudgmentError("the window of 'until' is too long: give it the times a and b")
    found = _shifted(one, count)
    held = _negated(found)
    for k in range(min(last + 1, count)):
        if k >= first:
            found = _max(found, _min(_shifted(other, k), held))
        held = _min(held, _shifted(one, k))
    return found
