"""A finished run as metrics and expectations see it.

A function of the user is given what the names of its parameters ask for: `flight`, `events`,
`scenario`, `airframes`, `clearance`, `wall_s`, `estimates`, `topics`, `simulation`, `log` or
`verdicts`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.engine.events import Event
from volery.results import FlightResult
from volery.scenario.schema import Scenario
from volery.vehicle.airframe import Airframe
from volery.verdicts.measures import nearest_obstacle
from volery.verdicts.observing import Estimates, TopicRecord
from volery.verdicts.verdict import Verdict
from volery.world.scene import Scene

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

GIVEN = (
    "airframes",
    "clearance",
    "estimates",
    "events",
    "flight",
    "log",
    "scenario",
    "simulation",
    "topics",
    "verdicts",
    "wall_s",
)
"""Names of parameters that a function of the user may have."""
NEEDS_SIMULATION = ("simulation", "estimates", "topics", "log")
"""What a run among other environments does not have."""
_STATES = (
    "position_map",
    "velocity_map",
    "attitude",
    "omega_body",
    "battery_charge",
    "mode",
)


@dataclass(frozen=True)
class FinishedRun:
    """What metrics and expectations may read of a run."""

    flight: FlightResult
    """States of the flight, sampled, and its world."""
    scenario: Scenario
    """Scenario of the run."""
    airframes: Mapping[str, Airframe]
    """Airframes by UAV."""
    scene: Scene
    """Surfaces of the world."""
    wall_s: float
    """Wall time, s."""
    simulation: Simulation | None = None
    """The simulation at its end; None: the run was an environment among others."""
    estimates: Estimates | None = None
    """Estimated trajectories; None: they were not recorded."""
    topics: Mapping[str, TopicRecord] = field(default_factory=dict)
    """Messages that expectations ask for, by topic."""
    log: Path | None = None
    """The closed log; None: there is none."""
    verdicts: tuple[Verdict, ...] = ()
    """Verdicts on the expectations of the scenario, if it was judged."""

    @property
    def events(self) -> tuple[Event, ...]:
        """All events, oldest first."""
        return self.flight.events

    @property
    def clearance(self) -> Callable[[], float]:
        """Function that returns the min distance, m, of any UAV to trees and solids."""
        return lambda: nearest_obstacle(self.flight, self.scene).distance_m


def digest_of(flight: FlightResult) -> str:
    """Returns the SHA-256 of a flight's sampled states and its events.

    It does not depend on how the run was computed: alone or among other environments, with or
    without sensors that nothing reads.
    """
    digest = hashlib.sha256(" ".join(flight.uavs).encode())
    digest.update(np.ascontiguousarray(flight.times_s).tobytes())
    for name in _STATES:
        digest.update(np.ascontiguousarray(getattr(flight, name)).tobytes())
    for event in flight.events:
        words = [event.time_ns, event.uav, str(event.kind), *event.position_map, event.speed_m_s]
        digest.update(json.dumps([*words, event.partner, event.detail]).encode())
    return digest.hexdigest()


@contextmanager
def read_only(flight: FlightResult) -> Iterator[None]:
    """Makes a flight's states read-only while the body runs, such as a function of the user."""
    states = [getattr(flight, name) for name in (*_STATES, "times_s")]
    writeable = [state for state in states if state.flags.writeable]
    try:
        for state in writeable:
            state.flags.writeable = False
        yield
    finally:
        for state in writeable:
            state.flags.writeable = True


def arguments_of(run: FinishedRun, names: tuple[str, ...]) -> dict[str, Any]:
    """Returns the arguments of a function by the names of its parameters."""
    return {name: getattr(run, name) for name in names}
