"""A finished run as metrics see it.

A metric is a function whose parameters name what it needs: `flight`, `events`, `scenario`,
`airframes`, `clearance`, `wall_s`, `estimates`, `simulation` or `log`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.core.arrays import Array
from volery.engine.events import Event
from volery.results import FlightResult
from volery.scenario.schema import Scenario
from volery.vehicle.airframe import Airframe
from volery.world.scene import Scene

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

CLEARANCE_REACH_M = 10.0
"""Distance up to which obstacles are searched, m."""
_BATCH = 4096
_STATES = (
    "position_map",
    "velocity_map",
    "attitude",
    "omega_body",
    "battery_charge",
    "mode",
)

Estimates = Mapping[str, tuple[Array, Array]]
"""By UAV: times (M,), s, and positions (M, 3), m, of its own pose estimate."""


@dataclass(frozen=True)
class FinishedRun:
    """What metrics may read of a run; its attributes are the names of their parameters."""

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
    log: Path | None = None
    """The closed log; None: there is none."""

    @property
    def events(self) -> tuple[Event, ...]:
        """All events, oldest first."""
        return self.flight.events

    @property
    def clearance(self) -> Callable[[], float]:
        """Function that returns the min distance, m, of any UAV to trees and solids."""
        return lambda: clearance_m(self.flight, self.scene)


def clearance_m(flight: FlightResult, scene: Scene) -> float:
    """Returns the min distance, m, of any UAV to trees and solids, at most the searched one."""
    points = flight.position_map.reshape(-1, 3)
    points = np.ascontiguousarray(points[np.isfinite(points).all(axis=1)])
    nearest = CLEARANCE_REACH_M
    for start in range(0, len(points), _BATCH):
        part = points[start : start + _BATCH]
        found = scene.clearance(part, CLEARANCE_REACH_M, include_terrain=False)
        nearest = min(nearest, float(found.distance.min(initial=CLEARANCE_REACH_M)))
    return nearest


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


NEEDS_SIMULATION = ("simulation", "estimates", "log")
"""What a run among other environments does not have."""


def arguments_of(run: FinishedRun, names: tuple[str, ...]) -> dict[str, Any]:
    """Returns the arguments of a metric by the names of its parameters."""
    return {name: getattr(run, name) for name in names}
