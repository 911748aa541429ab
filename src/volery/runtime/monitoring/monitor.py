"""Publishes all monitoring topics from the thread that runs the simulation."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from volery.engine.engine import Engine
from volery.runtime.monitoring.ground_truth_tf import ground_truth_topic
from volery.runtime.monitoring.status import Status, StatusSources
from volery.runtime.monitoring.vehicles import VehicleTopic

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation


class Monitor:
    """Publishes poses, vehicles and run state; changes nothing in the simulation."""

    def __init__(self, simulation: Simulation, engine: Engine, told: StatusSources) -> None:
        self._graph = simulation.graph
        vehicles = VehicleTopic(
            engine, simulation.uavs, simulation.gateway, simulation.operators.holder_of
        )
        self._present = (ground_truth_topic(simulation.graph, engine), vehicles.present)
        self._status = Status(simulation, told)
        for present in self._present:
            present.begin(engine.every)

    def look(self) -> None:
        """Publishes changes to external clients; call it between ticks, at any rate."""
        now_s = time.perf_counter()
        for present in self._present:
            present.look(now_s)
        self._status.look(now_s)

    def jumped(self) -> None:
        """Publishes everything again after another state, or the start, was restored."""
        self._graph.republish_latched()
        self._status.jumped()
        self.look()
