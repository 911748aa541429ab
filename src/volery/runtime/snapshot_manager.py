"""Saves and restores the state of a simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from volery.comms.radio.network import RadioNetwork
from volery.core.errors import SnapshotError
from volery.engine.engine import Engine
from volery.engine.faults import FaultPlan
from volery.engine.lock_step import Partner
from volery.graph.graph import Graph
from volery.graph.nodes.node import Node
from volery.publishing.graph_publisher import GraphPublisher
from volery.runtime.build.fleet import check_free
from volery.runtime.build.placement import StartPose
from volery.runtime.build.sensor_suites import SensorInstance
from volery.runtime.grid_map_manager import GridMapManager
from volery.runtime.monitoring.output_sink import OutputSink
from volery.runtime.run_loop import RunLoop
from volery.runtime.snapshot import (
    NodeStates,
    Snapshot,
    check_nodes,
    check_partners,
    keep_nodes,
    put_back_nodes,
    without_state,
)
from volery.runtime.vehicles.manager import VehicleManager


@dataclass
class SnapshotManager:
    """Saves and restores the parts of one simulation.

    Construct it when all parts are in their initial state: `reset` restores that state.
    """

    engine: Engine
    graph: Graph
    faults: FaultPlan
    publisher: GraphPublisher
    loop: RunLoop
    crew: VehicleManager
    partners: list[Partner]
    outlet: OutputSink
    grid_world: GridMapManager
    radio: RadioNetwork | None = None
    _start: dict[str, Any] = field(init=False)
    _starts: tuple[StartPose, ...] = field(init=False)
    _new_nodes: NodeStates = field(init=False)
    """States of nodes before their first step."""

    def __post_init__(self) -> None:
        self._start = self._state()
        self._starts = self.crew.starts
        self._new_nodes = dict(self._start["nodes"])

    @property
    def spawned(self) -> list[str]:
        """Names of UAVs that were spawned after the start."""
        return [start.name for start in self.crew.starts if start not in self._starts]

    def enlist(self, name: str) -> None:
        """Records the initial node states of a UAV that was just spawned."""
        self._new_nodes.update(keep_nodes(self._nodes_of(name)))

    def snapshot(self) -> Snapshot:
        """Returns the present state. Raises `SnapshotError` if it cannot be saved."""
        check_nodes(self.crew.nodes, "a snapshot")
        self._check("a snapshot")
        self.engine.state_check.look()
        return Snapshot(self.engine.time_ns, id(self), self.crew.starts, self._state())

    def restore(self, snapshot: Snapshot) -> None:
        """Restores `snapshot`. Raises `SnapshotError` if it is not of this simulation and fleet."""
        check_nodes(self.crew.nodes, "to restore a state")
        self._check("to restore a state")
        if not isinstance(snapshot, Snapshot):
            raise SnapshotError(f"not a snapshot: {snapshot!r}; pass what snapshot() returned")
        if snapshot.owner != id(self):
            raise SnapshotError("the snapshot belongs to another simulation")
        if snapshot.starts != self.crew.starts:
            then = ", ".join(start.name for start in snapshot.starts)
            raise SnapshotError(f"UAVs were spawned or deleted since the snapshot of {then}")
        self._put_back(snapshot.state)

    def reset(self, seed: int) -> None:
        """Restores the start and its UAVs, with the random streams of `seed`."""
        self._check("a reset", to_start=True)
        changed = self.crew.starts != self._starts
        if changed or without_state(self.crew.nodes):
            self.crew.end_nodes()  # all, so that they start in the same order again
        if changed:
            self.crew.regroup(self._starts)
        self._put_back(self._start)
        with self.graph.in_place_of(self._start["graph"]):
            self.crew.start_nodes()
        fleet = self.engine.fleet
        rows = np.arange(len(fleet))
        fleet.seed_turbulence(seed, rows, fleet.names)
        if self.radio is not None:
            self.radio.reseed(seed)
        self.crew.reseed(seed)
        self._restart_sensors(rows, self.crew.fitted)
        for partner in self.partners:
            if not partner.has_left:
                self.engine.wait_for(partner, partner.period_s)
        self.crew.take_off(fleet.names)

    def reset_uav(self, row: int) -> None:
        """Resets one UAV to its start while the others continue."""
        fleet = self.engine.fleet
        name = fleet.names[row]
        self._check("a reset")
        begun = self.crew.beginnings[name]
        check_free(fleet, row, begun.fleet["position"][0, begun.row])
        rows = np.array([row])
        fleet.restart(begun.fleet, rows, np.array([begun.row]))
        self.engine.collisions.forget(rows)
        self._restart_sensors(rows, [f for f in self.crew.fitted if f.id.uav == row])
        if without_state(self._nodes_of(name)):
            self.crew.restart_nodes(name)
        else:
            put_back_nodes(self._nodes_of(name), self._new_nodes)
        self.faults.mend(name)
        self.crew.take_off([name])

    def _nodes_of(self, name: str) -> list[Node]:
        return [node for node in self.crew.nodes if node.get_namespace() == f"/{name}"]

    def _restart_sensors(self, rows: Any, fitted: Sequence[SensorInstance]) -> None:
        self.engine.restart_sensors(rows, {(f.id.uav, f.id.name): f.key for f in fitted})

    def _check(self, what: str, *, to_start: bool = False) -> None:
        check_partners(self.partners, what, to_start=to_start)
        if not self.engine.stands:
            raise SnapshotError(f"{what} is not possible in the middle of a tick; use post()")

    def _state(self) -> dict[str, Any]:
        digest = self.outlet.digest
        return {
            "seed": self.crew.scenario.seed,
            "engine": self.engine.get_state(),
            "graph": self.graph.get_state(),
            "faults": self.faults.get_state(),
            "publisher": self.publisher.get_state(),
            "nodes": keep_nodes(self.crew.nodes),
            "digest": None if digest is None else digest.get_state(),
            "events": list(self.outlet.events),
            "owed_ns": self.loop.owed_ns,
            "past_end": self.loop.past_end,
            "grid_map": self.grid_world.get_state(),
            "radio": None if self.radio is None else self.radio.get_state(),
        }

    def _put_back(self, state: dict[str, Any]) -> None:
        self.crew.reseed(state["seed"])
        put_back_nodes(self.crew.nodes, state["nodes"])
        self.grid_world.set_state(state["grid_map"])
        self.engine.set_state(state["engine"])
        self.graph.set_state(state["graph"])
        self.faults.set_state(state["faults"])
        self.publisher.set_state(state["publisher"])
        if self.outlet.digest is not None:
            self.outlet.digest.set_state(state["digest"])
        self.outlet.events[:] = state["events"]
        self.loop.owed_ns = state["owed_ns"]
        self.loop.past_end = state["past_end"]
        if self.radio is not None:
            self.radio.set_state(state["radio"])
