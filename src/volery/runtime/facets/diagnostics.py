"""Diagnostics of a simulation: events, digests, computing time, clients."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.engine.events import Event
from volery.engine.lock_step import Partner
from volery.graph.nodes.handles import NodeEndpoints
from volery.graph.nodes.presence import outside_nodes
from volery.graph.session import Gateway
from volery.runtime.vehicles.manager import VehicleManager

_MEASUREMENTS = 2
"""The first may still load what it needs."""


class SimulationDiagnostics:
    """Reads what happens in a simulation; changes nothing."""

    def __init__(
        self,
        manager: VehicleManager,
        gateway: Gateway,
        partners: Sequence[Partner],
    ) -> None:
        self._manager, self._gateway, self._partners = manager, gateway, partners
        self._engine, self._outlet = manager.engine, manager.outlet

    def __repr__(self) -> str:
        return f"<diagnostics: {counted(len(self._outlet.events), 'event')}>"

    @property
    def events(self) -> tuple[Event, ...]:
        """All events so far, oldest first."""
        return tuple(self._outlet.events)

    @property
    def stage_seconds(self) -> dict[str, float]:
        """Wall seconds in each stage of the step so far; see `count_cpu_time`."""
        return dict(self._engine.stage_seconds)

    def count_cpu_time(self) -> None:
        """Counts CPU seconds of the thread that runs the stages from now on, which costs more."""
        self._engine.stage_clock = time.thread_time

    @property
    def nodes(self) -> dict[str, NodeEndpoints]:
        """Topics and services that the simulation's nodes use, by the nodes' full names."""
        return {node.full_name: node.endpoints() for node in self._manager.nodes}

    def measure_sensors(self) -> dict[str, float]:
        """Measures what LIDARs and cameras cost here and now, without effect on the run.

        Returns the CPU time of each sensor, s per simulated second, by its path (`uav1/camera`):
        that of all sensors of a model and rate, divided by their number.
        """
        costs: dict[str, float] = {}
        for bank in self._engine.banks:
            if bank.name not in ("lidar", "camera") or not bank.sensors:
                continue
            state, seconds = bank.get_state(), []
            for _ in range(_MEASUREMENTS):
                before = time.process_time()
                bank.sample(0, self._engine.time_ns, self._engine.fleet)
                seconds.append(time.process_time() - before)
            bank.set_state(state)
            cost = min(seconds) / len(bank.sensors) * float(bank.schedule.rate_hz)
            costs |= dict.fromkeys((sensor.path for sensor in bank.sensors), cost)
        return costs

    @property
    def image_rates(self) -> dict[str, float]:
        """Approximate bytes per simulated second of each camera topic in a log."""
        return self._manager.publisher.cameras.log_rates()

    @property
    def client_names(self) -> frozenset[str]:
        """Full names of external nodes, of lock-step partners and of clients of bridges."""
        partners = (partner.name for partner in self._partners if not partner.has_left)
        sessions = (info.name for info in self._gateway.sessions() if " " in info.name)
        return frozenset((*outside_nodes(self._gateway.graph), *partners, *sessions))

    def on_advance(self, callback: Callable[[], None]) -> None:
        """Calls `callback` after each call of the fused step; it must change nothing."""
        self._outlet.watch = callback

    def enable_digest(self) -> None:
        """Computes a digest of all states and messages from now on; call before the first step."""
        self._outlet.enable_digest()

    def digest(self, *, by_topic: bool = False) -> str:
        """Returns the SHA-256 of all states and sensor messages since `enable_digest`, in order.

        by_topic: independent of the order of different topics, for comparisons with external
        nodes. Raises `CommandError` without `enable_digest`.
        """
        digest = self._outlet.digest
        if digest is None:
            raise CommandError("call enable_digest() before the run")
        return digest.hexdigest_by_topic() if by_topic else digest.hexdigest()
