"""Records the true states of a simulation's UAVs at a fixed rate, as arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError
from volery.engine.engine import Engine
from volery.engine.events import Event
from volery.results.drawn_world import DrawnWorld
from volery.results.flight_result import FlightResult
from volery.results.flight_states import NO_MODE

DEFAULT_RATE_HZ = 20.0
_FIRST_CAPACITY = 256
_COLUMNS = {"position_map": 3, "velocity_map": 3, "attitude": 4, "omega_body": 3}
"""States of the fleet that are recorded, and their numbers of components."""
_BATTERY, _MODE = sum(_COLUMNS.values()), sum(_COLUMNS.values()) + 1
_WIDTH = _MODE + 1


class RecordedRun(Protocol):
    """Describes the run that is recorded."""

    name: str
    """Name of the scenario."""

    @property
    def seed(self) -> int:
        """Seed of the scenario, or of the last reset."""

    @property
    def events(self) -> Sequence[Event]:
        """All events so far, oldest first."""

    @property
    def world(self) -> DrawnWorld:
        """World as drawn on maps."""


@dataclass
class _Segment:
    """Samples of an unchanged fleet of N UAVs."""

    names: tuple[str, ...]
    times_ns: NDArray[np.int64]
    """(capacity,)"""
    rows: Array
    """(capacity, N, columns)"""
    count: int = 0

    @classmethod
    def of(cls, names: tuple[str, ...]) -> _Segment:
        """Returns an empty segment."""
        shape = (_FIRST_CAPACITY, len(names), _WIDTH)
        return cls(names, np.zeros(_FIRST_CAPACITY, np.int64), np.zeros(shape))

    def add(self, time_ns: int, fleet: Fleet) -> None:
        """Copies the present states."""
        k = self.count
        if k == len(self.times_ns):
            self.times_ns = np.concatenate([self.times_ns, np.zeros_like(self.times_ns)])
            self.rows = np.concatenate([self.rows, np.zeros_like(self.rows)])
        self.times_ns[k] = time_ns
        first = 0
        for name, width in _COLUMNS.items():
            self.rows[k, :, first : first + width] = getattr(fleet.state, name)
            first += width
        self.rows[k, :, _BATTERY] = fleet.state.battery_charge
        self.rows[k, :, _MODE] = [int(fleet.mode(row)) for row in range(len(self.names))]
        self.count = k + 1

    def ends_at(self, time_ns: int) -> bool:
        """Returns whether the last sample is of a time."""
        return self.count > 0 and int(self.times_ns[self.count - 1]) == time_ns

    def cut(self, time_ns: int) -> None:
        """Drops the samples at and after a time."""
        self.count = int(np.searchsorted(self.times_ns[: self.count], time_ns))


class FlightRecorder:
    """Records positions, velocities, attitudes, rates, batteries and modes of all UAVs.

    `Simulation.record` makes it. Recording changes no results. After a reset or a restored
    snapshot, the samples of the undone flight are replaced. As a context manager it stops at the
    end.
    """

    def __init__(
        self,
        engine: Engine,
        run: RecordedRun,
        rate_hz: float,
        on_stop: Callable[[FlightRecorder], None],
    ) -> None:
        period_ns = NS_PER_S / rate_hz if math.isfinite(rate_hz) and rate_hz > 0.0 else 0.0
        if round(period_ns) < engine.dt_ns:
            raise CommandError(
                f"rate_hz = {rate_hz} cannot be recorded: use a rate above 0, at most that of the "
                f"physics steps, {NS_PER_S / engine.dt_ns:g} Hz"
            )
        self.rate_hz = rate_hz
        """Samples per simulated second."""
        self._engine, self._run = engine, run
        self._on_stop = on_stop
        self._segments: list[_Segment] = []
        self._events: tuple[Event, ...] | None = None
        self._start_ns = engine.time_ns
        self.resume()

    @property
    def is_recording(self) -> bool:
        """Whether it records; False after `stop`."""
        return self._events is None

    def resume(self) -> None:
        """Samples the present state, and each period from now on; after a jump in time, too."""
        self._engine.forget(self._sample)
        for segment in self._segments:
            segment.cut(self._engine.time_ns)
        self._start_ns = min(self._start_ns, self._engine.time_ns)
        self._sample()
        self._engine.every(1.0 / self.rate_hz, self._sample)

    def stop(self) -> None:
        """Ends the recording; `result` returns the flight up to now."""
        if self.is_recording:
            self._sample()
            self._events = self._recorded_events()
            self._engine.forget(self._sample)
            self._on_stop(self)

    def result(self) -> FlightResult:
        """Returns the flight so far, up to the present time; the arrays are copies."""
        if not self.is_recording:
            return self._result()
        had_sample = self._segments[-1].ends_at(self._engine.time_ns)
        self._sample()
        result = self._result()
        if not had_sample:  # later results keep to the rate
            self._segments[-1].cut(self._engine.time_ns)
        return result

    def __enter__(self) -> FlightRecorder:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.stop()

    def __repr__(self) -> str:
        samples = sum(segment.count for segment in self._segments)
        state = "records" if self.is_recording else "stopped"
        return (
            f"FlightRecorder({self._run.name!r}, {self.rate_hz:g} Hz, {samples} samples, {state})"
        )

    # ------------------------------------------------------------------------------------ inside

    def _sample(self) -> None:
        time_ns, fleet = self._engine.time_ns, self._engine.fleet
        names = tuple(self._engine.names)
        last = self._segments[-1] if self._segments else None
        if last is not None:
            last.cut(time_ns)  # commands may have changed modes since a sample of the same time
        if last is None or last.names != names:
            last = _Segment.of(names)
            self._segments.append(last)
        last.add(time_ns, fleet)

    def _result(self) -> FlightResult:
        filled = [segment for segment in self._segments if segment.count]
        names = tuple(dict.fromkeys(name for segment in filled for name in segment.names))
        total = sum(segment.count for segment in filled)
        rows = np.full((len(names), total, _WIDTH), np.nan)
        rows[:, :, _MODE] = NO_MODE
        times = np.zeros(total, np.int64)
        first = 0
        for segment in filled:
            part = slice(first, first + segment.count)
            times[part] = segment.times_ns[: segment.count]
            where = [names.index(name) for name in segment.names]
            rows[where, part] = segment.rows[: segment.count].swapaxes(0, 1)
            first += segment.count
        edges = np.cumsum([0, *_COLUMNS.values()])
        columns = zip(_COLUMNS, pairwise(edges), strict=True)
        states = {name: rows[:, :, a:b].copy() for name, (a, b) in columns}
        return FlightResult(
            scenario=self._run.name,
            seed=self._run.seed,
            uavs=names,
            times_s=times / NS_PER_S,
            battery_charge=rows[:, :, _BATTERY].copy(),
            mode=rows[:, :, _MODE].astype(np.int8),
            events=self._recorded_events() if self._events is None else self._events,
            world=self._run.world,
            **states,
        )

    def _recorded_events(self) -> tuple[Event, ...]:
        now_ns, start_ns = self._engine.time_ns, self._start_ns
        return tuple(e for e in self._run.events if start_ns <= e.time_ns <= now_ns)
