"""Publishes all monitoring topics from the thread that runs the simulation."""

from __future__ import annotations

import time

from volery.graph.session import Gateway
from volery.runtime.monitoring.active_faults import faults_topic
from volery.runtime.monitoring.ground_truth_tf import ground_truth_topic
from volery.runtime.monitoring.status import Status, StatusSources
from volery.runtime.monitoring.vehicles import VehicleTopic
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.runtime.vehicles.manager import VehicleManager

_CLOCK_PERIOD_S = 0.01
_DIGEST_PERIOD_S = 0.01


class Monitor:
    """Publishes clock, poses, vehicles and run state; changes nothing in the simulation."""

    def __init__(
        self,
        manager: VehicleManager,
        gateway: Gateway,
        operators: ControlAuthority,
        sources: StatusSources,
    ) -> None:
        self._graph = gateway.graph
        engine, publisher, outlet = manager.engine, manager.publisher, manager.outlet
        vehicles = VehicleTopic(engine, manager.uavs, gateway, operators.operator_of)
        self._present = (
            ground_truth_topic(gateway.graph, engine),
            vehicles.present,
            faults_topic(gateway.graph, manager.faults),
        )
        self._status = Status(manager.scenario, engine, gateway, sources)
        engine.every(
            _CLOCK_PERIOD_S,
            lambda: publisher.publish_clock(engine.time_ns),
            wanted=lambda: publisher.clock_wanted,
        )
        engine.every(
            _DIGEST_PERIOD_S, outlet.take_fingerprint, wanted=lambda: outlet.digest is not None
        )
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
