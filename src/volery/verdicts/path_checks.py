"""Checks of expectations about the paths, modes and batteries of UAVs."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from volery.control.flight_modes import FlightMode
from volery.core.arrays import Array
from volery.core.clock import s_from_ns
from volery.core.near_names import near_miss
from volery.results import FlightResult
from volery.scenario.expectations import (
    AreaExpectation,
    ArrivalExpectation,
    BatteryExpectation,
    ClearanceExpectation,
    ContactFreeExpectation,
    CrashFreeExpectation,
    Expectation,
    LimitsExpectation,
    ModesExpectation,
    SeparationExpectation,
    SpeedExpectation,
)
from volery.verdicts.finished_run import FinishedRun
from volery.verdicts.measures import MAX_CLEARANCE_M, area_m2, nearest_obstacle, nearest_pair
from volery.verdicts.verdict import Finding, JudgmentError

_MODE_CHANGE = re.compile(r"changed to (\w+)")


def rows_of(flight: FlightResult, expectation: Expectation) -> NDArray[np.int64]:
    """Returns the numbers of the UAVs that an expectation is about.

    Raises `JudgmentError` for a name that the flight does not have.
    """
    for name in expectation.uavs:
        if name not in flight.uavs:
            raise JudgmentError(f"no UAV '{name}'{near_miss(name, flight.uavs)}")
    names = expectation.uavs or flight.uavs
    return np.array([flight.uavs.index(name) for name in names], np.int64)


def samples_of(
    flight: FlightResult, from_s: float = 0.0, until_s: float | None = None
) -> NDArray[np.int64]:
    """Returns the numbers of the samples from one time to another; raises without any."""
    inside = flight.times_s >= from_s - 1e-9
    inside &= flight.times_s <= (np.inf if until_s is None else until_s) + 1e-9
    found = np.flatnonzero(inside)
    if not len(found):
        end_s = float(flight.times_s[-1]) if len(flight.times_s) else 0.0
        raise JudgmentError(f"the flight ended at {end_s:g} s, before {from_s:g} s")
    return found


def no_contact(run: FinishedRun, expectation: ContactFreeExpectation) -> Finding:
    """Judges by the first contact; without one, by the nearest obstacle or UAV."""
    flight, rows = run.flight, rows_of(run.flight, expectation)
    names = {flight.uavs[row] for row in rows}
    contact = next((e for e in flight.contacts if e.uav in names or e.partner in names), None)
    if contact is not None:
        what = f"hit {contact.partner}" if contact.partner else "hit the ground"
        text = f"{what} at {contact.speed_m_s:.2f} m/s"
        time_s = s_from_ns(contact.time_ns)
        return Finding(text, -contact.speed_m_s, "m/s", time_s, contact.uav, is_passed=False)
    airframes = [run.airframes[name] for name in flight.uavs if name in run.airframes]
    known = len(airframes) == len(flight)
    radius = np.array([a.body.collision_radius_m for a in airframes]) if known else None
    obstacle = nearest_obstacle(flight, run.scene, rows=rows, radius_m=radius)
    pair = nearest_pair(flight, rows=rows, radius_m=radius)
    if pair.distance_m < obstacle.distance_m:
        one, other = (flight.uavs[k] for k in pair.uavs)
        text = f"{pair.distance_m:.2f} m from {other}"
        time_s = float(flight.times_s[pair.sample])
        return Finding(text, pair.distance_m, "m", time_s, one, is_passed=True)
    if obstacle.uav < 0:
        return Finding("no UAV", is_passed=True)
    return Finding(
        f"{obstacle.distance_m:.2f} m from trees and solids, or more",
        obstacle.distance_m,
        "m",
        float(flight.times_s[obstacle.sample]),
        flight.uavs[obstacle.uav],
        is_passed=True,
    )


def no_crash(run: FinishedRun, expectation: CrashFreeExpectation) -> Finding:
    """Judges by the first sample of a crashed UAV."""
    flight, rows = run.flight, rows_of(run.flight, expectation)
    crashed = flight.mode[rows] == int(FlightMode.CRASHED)
    if not crashed.any():
        return Finding("none crashed", is_passed=True)
    sample = int(np.argmax(crashed.any(axis=0)))
    name = flight.uavs[rows[int(np.argmax(crashed[:, sample]))]]
    text = f"{int(crashed.any(axis=1).sum())} crashed"
    return Finding(text, time_s=float(flight.times_s[sample]), uav=name, is_passed=False)


def arrives(run: FinishedRun, expectation: ArrivalExpectation) -> Finding:
    """Judges by the UAV that comes least near."""
    flight, rows = run.flight, rows_of(run.flight, expectation)
    samples = samples_of(flight, 0.0, expectation.by_s)
    target = np.array(expectation.position_m)
    offset = flight.position_map[np.ix_(rows, samples)][:, :, : len(target)] - target
    distance = _existing(np.linalg.norm(offset, axis=2), np.inf)
    k = int(np.argmax(distance.min(axis=1)))
    nearest = float(distance[k].min())
    if nearest > expectation.within_m:
        sample = samples[int(np.argmin(distance[k]))]
        text = f"{nearest:.2f} m away at best"
    else:
        first = np.argmax(distance <= expectation.within_m, axis=1)
        k = int(np.argmax(first))
        sample = samples[int(first[k])]
        text = f"arrived after {flight.times_s[sample]:.2f} s"
    margin = expectation.within_m - nearest
    return Finding(text, margin, "m", float(flight.times_s[sample]), flight.uavs[rows[k]])


def separation(run: FinishedRun, expectation: SeparationExpectation) -> Finding:
    """Judges by the nearest two UAVs."""
    flight, rows = run.flight, rows_of(run.flight, expectation)
    if len(flight) < 2:
        raise JudgmentError("the flight has one UAV only")
    samples = samples_of(flight, expectation.from_s, expectation.until_s)
    pair = nearest_pair(flight, rows=rows, samples=samples)
    if not np.isfinite(pair.distance_m):
        return Finding("no two UAVs at the same time", is_passed=True)
    one, other = (flight.uavs[k] for k in pair.uavs)
    text = f"{pair.distance_m:.2f} m from {other}"
    margin = pair.distance_m - expectation.at_least_m
    return Finding(text, margin, "m", float(flight.times_s[pair.sample]), one)


def clearance(run: FinishedRun, expectation: ClearanceExpectation) -> Finding:
    """Judges by the nearest tree or solid."""
    flight, rows = run.flight, rows_of(run.flight, expectation)
    samples = samples_of(flight, expectation.from_s, expectation.until_s)
    found = nearest_obstacle(flight, run.scene, rows=rows, samples=samples)
    if found.uav < 0:
        raise JudgmentError("no UAV exists in this time")
    margin = found.distance_m - expectation.at_least_m
    or_more = " or more" if found.distance_m >= MAX_CLEARANCE_M else ""
    text = f"{found.distance_m:.2f} m{or_more}"
    time_s = float(flight.times_s[found.sample])
    return Finding(text, margin, "m", time_s, flight.uavs[found.uav])


def inside(run: FinishedRun, expectation: LimitsExpectation) -> Finding:
    """Judges by the position that is least inside."""

    def margins(position: Array) -> Array:
        x, y, z = np.moveaxis(position, 2, 0)
        found = []
        if expectation.region_m is not None:
            x_min, y_min, x_max, y_max = expectation.region_m
            found += [x - x_min, y - y_min, x_max - x, y_max - y]
        if expectation.height_m is not None:
            found += [z - expectation.height_m[0], expectation.height_m[1] - z]
        if expectation.corridor_m is not None and expectation.radius_m is not None:
            points = np.array(expectation.corridor_m)
            found.append(expectation.radius_m - _distance_to_line(position[:, :, :2], points))
        return np.asarray(np.min(found, axis=0))

    return _worst_sample(
        run,
        expectation,
        lambda flight, rows, samples: margins(flight.position_map[np.ix_(rows, samples)]),
        lambda margin: f"{abs(margin):.2f} m {'inside' if margin >= 0.0 else 'outside'}",
        "m",
    )


def speed(run: FinishedRun, expectation: SpeedExpectation) -> Finding:
    """Judges by the fastest sample."""
    limit = expectation.at_most_m_s
    return _worst_sample(
        run,
        expectation,
        lambda flight, rows, samples: limit - flight.speed_m_s[np.ix_(rows, samples)],
        lambda margin: f"{limit - margin:.2f} m/s",
        "m/s",
    )


def battery(run: FinishedRun, expectation: BatteryExpectation) -> Finding:
    """Judges by the lowest charge."""
    min_charge = expectation.at_least
    return _worst_sample(
        run,
        expectation,
        lambda flight, rows, samples: flight.battery_charge[np.ix_(rows, samples)] - min_charge,
        lambda margin: f"{min_charge + margin:.1%}",
        "",
    )


def modes(run: FinishedRun, expectation: ModesExpectation) -> Finding:
    """Judges by the UAV that enters the fewest modes in time, or the last of them latest."""
    flight, latest = run.flight, Finding("", is_passed=True)
    by_s = np.inf if expectation.by_s is None else expectation.by_s
    for row in rows_of(flight, expectation):
        name = flight.uavs[row]
        time_s, missing = _last_of(expectation.modes, _mode_history(flight, int(row)))
        if missing:
            end_s = float(flight.times_s[-1])
            return Finding(f"never {missing}", np.nan, "", end_s, name, is_passed=False)
        margin = by_s - time_s if np.isfinite(by_s) else np.nan
        text = f"{expectation.modes[-1]} at {time_s:.2f} s"
        if not latest.uav or time_s > latest.time_s:
            latest = Finding(text, margin, "s", time_s, name, is_passed=time_s <= by_s)
    return latest


def _last_of(wanted: tuple[str, ...], history: list[tuple[float, str]]) -> tuple[float, str]:
    """Returns the time of the last of the wanted modes, s, and the first that is missing."""
    left, time_s = list(wanted), 0.0
    for time_s, mode in history:
        if mode == left[0]:
            left.pop(0)
            if not left:
                return time_s, ""
    return time_s, left[0]


def area(run: FinishedRun, expectation: AreaExpectation) -> Finding:
    """Judges by the area under all paths."""
    rows = rows_of(run.flight, expectation)
    covered = area_m2(run.flight.position_map[rows], expectation.radius_m)
    return Finding(f"{covered:.1f} m2", covered - expectation.at_least_m2, "m2")


def _worst_sample(
    run: FinishedRun,
    expectation: LimitsExpectation | SpeedExpectation | BatteryExpectation,
    margins: Callable[[FlightResult, NDArray[np.int64], NDArray[np.int64]], Array],
    words: Callable[[float], str],
    unit: str,
) -> Finding:
    """Judges by the sample of a UAV with the smallest margin; margins: (rows, samples)."""
    flight, rows = run.flight, rows_of(run.flight, expectation)
    samples = samples_of(flight, expectation.from_s, expectation.until_s)
    found = _existing(margins(flight, rows, samples), np.inf)
    k, sample = np.unravel_index(int(np.argmin(found)), found.shape)
    margin = float(found[k, sample])
    if not np.isfinite(margin):
        raise JudgmentError("no UAV exists in this time")
    time_s = float(flight.times_s[samples[sample]])
    return Finding(words(margin), margin, unit, time_s, flight.uavs[rows[k]])


def _existing(values: Array, instead: float) -> Array:
    """Returns values with another one where a UAV did not exist."""
    return np.where(np.isnan(values), instead, values)


def _mode_history(flight: FlightResult, row: int) -> list[tuple[float, str]]:
    """Returns times and names of a UAV's modes, from its first sample on.

    Events have the modes that it enters by itself; those that it is commanded are in the samples.
    """
    name, numbers = flight.uavs[row], flight.mode[row]
    events = {
        s_from_ns(event.time_ns): change[1].lower()
        for event in flight.events
        if event.uav == name and (change := _MODE_CHANGE.match(event.detail))
    }
    changed = np.flatnonzero(np.diff(numbers, prepend=-1))
    after = np.searchsorted(flight.times_s, list(events), side="right")
    samples = {
        float(flight.times_s[k]): FlightMode(int(numbers[k])).name.lower()
        for k in {*changed, *after[after < len(numbers)]}
        if numbers[k] >= 0
    }
    history: list[tuple[float, str]] = []
    for time_s, mode in sorted({**samples, **events}.items()):
        if not history or history[-1][1] != mode:
            history.append((time_s, mode))
    return history


def _distance_to_line(points: Array, line: Array) -> Array:
    """Returns the distances (..., ) of points (..., 2) to a polyline (K, 2)."""
    nearest = np.full(points.shape[:-1], np.inf)
    for start, end in pairwise(line):
        along = end - start
        length = max(float(along @ along), 1e-12)
        part = np.clip((points - start) @ along / length, 0.0, 1.0)
        apart = np.linalg.norm(points - start - part[..., None] * along, axis=-1)
        nearest = np.minimum(nearest, apart)
    return nearest
