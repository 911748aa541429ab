"""`/volery/status`: how the simulation runs, in wall time.

Shown to clients outside alone, from the thread that runs the simulation; see `Publisher.show`.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from volery.core.clock import NS_PER_S
from volery.graph.messages import message_type, time_from_ns
from volery.runtime.monitoring.memory import resident_mb

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

TOPIC = "/volery/status"
_TYPE = "volery_interfaces/msg/SimulationStatus"
_PERIOD_S = 0.2
_WINDOW_S = 1.0
"""Of wall time, over which rates are told."""


class Pace(NamedTuple):
    """How fast a simulation has been."""

    real_time_factor: float
    load: list[float]
    """s of wall time a simulated second, by stage."""


class _Sample(NamedTuple):
    wall_s: float
    time_ns: int
    stages: tuple[float, ...]


class Speedometer:
    """Measures the pace over the last second of wall time."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque()

    def read(self, wall_s: float, time_ns: int, stage_seconds: Mapping[str, float]) -> Pace:
        """The pace at `wall_s`, where simulated `time_ns` is reached; 0 where nothing moves."""
        samples = self._samples
        if samples and time_ns < samples[-1].time_ns:  # an earlier state was restored
            samples.clear()
        now = _Sample(wall_s, time_ns, tuple(stage_seconds.values()))
        samples.append(now)
        while len(samples) > 2 and samples[1].wall_s <= wall_s - _WINDOW_S:
            samples.popleft()
        then = samples[0]
        simulated_s = (now.time_ns - then.time_ns) / NS_PER_S
        if simulated_s <= 0.0:
            return Pace(0.0, [0.0] * len(now.stages))
        load = [(b - a) / simulated_s for a, b in zip(then.stages, now.stages, strict=True)]
        return Pace(simulated_s / (now.wall_s - then.wall_s), load)

    def forget(self) -> None:
        """Begin anew: simulated time has jumped."""
        self._samples.clear()


@dataclass
class StatusSources:
    """What the status tells that services know."""

    state: Callable[[], int]
    recording: Callable[[], str]
    ended: Callable[[], bool]


class Status:
    """Shows how a simulation runs, five times a second of wall time."""

    def __init__(self, simulation: Simulation, told: StatusSources) -> None:
        self._simulation = simulation
        self._told = told
        self._publisher = simulation.graph.advertise(TOPIC, _TYPE)
        self._speedometer = Speedometer()
        self._next_s = 0.0

    def look(self, now_s: float) -> None:
        """Show the status if it is time to, at `now_s` of wall time."""
        if now_s < self._next_s:
            return
        self._next_s = now_s + _PERIOD_S
        simulation = self._simulation
        stages = simulation.stage_seconds
        pace = self._speedometer.read(now_s, simulation.time_ns, stages)
        if self._publisher.watched:
            self._publisher.show(self._message(pace, list(stages)))

    def jumped(self) -> None:
        """Simulated time has jumped."""
        self._speedometer.forget()
        self._next_s = 0.0

    def _message(self, pace: Pace, stages: list[str]) -> Any:
        simulation, gateway = self._simulation, self._simulation.gateway
        load = np.array(pace.load)
        load.flags.writeable = False
        return message_type(_TYPE)(
            time_from_ns(simulation.time_ns),
            time_from_ns(time.time_ns()),
            simulation.scenario.name,
            self._told.state(),
            simulation.speed or 0.0,
            pace.real_time_factor,
            simulation.scenario.duration_s,
            self._told.recording(),
            stages,
            load,
            resident_mb(),
            len(gateway.sessions()),
            gateway.dropped,
            simulation.replaying,
            self._told.ended(),
        )
