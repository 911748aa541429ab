"""Publishes `/volery/status`: the state of the simulation and its speed in wall time.

Only external clients receive it, from the thread that runs the simulation; see
`Publisher.publish_external`.
"""

from __future__ import annotations

import os
import resource
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from volery.core.clock import NS_PER_S
from volery.core.wall_time import steady_time_ns
from volery.engine.engine import Engine
from volery.graph.messages import message_type, time_from_ns
from volery.graph.session import Gateway
from volery.scenario.schema import Scenario

_STATM = Path("/proc/self/statm")

TOPIC = "/volery/status"
_TYPE = "volery_interfaces/msg/SimulationStatus"
_PERIOD_S = 0.2
_WINDOW_S = 1.0
"""Wall time over which rates are averaged, s."""


class RunTiming(NamedTuple):
    """Describes the speed of a simulation."""

    real_time_factor: float
    load: list[float]
    """Wall time per simulated second, by stage, s."""


class _Sample(NamedTuple):
    wall_s: float
    time_ns: int
    stages: tuple[float, ...]


class Speedometer:
    """Measures the real-time factor over the last second of wall time."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque()

    def read(self, wall_s: float, time_ns: int, stage_seconds: Mapping[str, float]) -> RunTiming:
        """Returns the speed at wall time `wall_s` and simulated `time_ns`; 0 without progress."""
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
            return RunTiming(0.0, [0.0] * len(now.stages))
        load = [(b - a) / simulated_s for a, b in zip(then.stages, now.stages, strict=True)]
        return RunTiming(simulated_s / (now.wall_s - then.wall_s), load)

    def forget(self) -> None:
        """Discards all samples after a jump of simulated time."""
        self._samples.clear()


@dataclass
class StatusSources:
    """Provides the parts of the status that neither the engine nor the gateway has."""

    speed: Callable[[], float | None]
    state: Callable[[], int]
    recording: Callable[[], str]
    replaying: Callable[[], bool]
    ended: Callable[[], bool]


class Status:
    """Publishes the status five times a second of wall time."""

    def __init__(
        self, scenario: Scenario, engine: Engine, gateway: Gateway, sources: StatusSources
    ) -> None:
        self._scenario = scenario
        self._engine = engine
        self._gateway = gateway
        self._sources = sources
        self._publisher = gateway.graph.advertise(TOPIC, _TYPE)
        self._speedometer = Speedometer()
        self._next_s = 0.0

    def look(self, now_s: float) -> None:
        """Publishes the status at wall time `now_s` if it is due."""
        if now_s < self._next_s:
            return
        self._next_s = now_s + _PERIOD_S
        stages = self._engine.stage_seconds
        pace = self._speedometer.read(now_s, self._engine.time_ns, stages)
        if self._publisher.has_external_subscribers:
            self._publisher.publish_external(self._message(pace, list(stages)))

    def jumped(self) -> None:
        """Discards rates after a jump of simulated time."""
        self._speedometer.forget()
        self._next_s = 0.0

    def _message(self, pace: RunTiming, stages: list[str]) -> Any:
        scenario, gateway, sources = self._scenario, self._gateway, self._sources
        load = np.array(pace.load)
        load.flags.writeable = False
        return message_type(_TYPE)(
            time_from_ns(self._engine.time_ns),
            time_from_ns(steady_time_ns()),
            scenario.name,
            sources.state(),
            sources.speed() or 0.0,
            pace.real_time_factor,
            scenario.duration_s,
            sources.recording(),
            stages,
            load,
            _resident_mb(),
            len(gateway.sessions()),
            gateway.dropped,
            sources.replaying(),
            sources.ended(),
        )


def _resident_mb() -> float:
    """Returns the resident memory, MB of 1e6 bytes; its peak where the system has no statm."""
    try:
        pages = int(_STATM.read_text(encoding="ascii").split()[1])
    except (OSError, IndexError, ValueError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
