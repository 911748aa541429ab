"""Saves and restores the state of a simulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from volery.core.errors import SnapshotError
from volery.engine.lock_step import Partner
from volery.engine.sensor_restart import NamedStreams
from volery.graph.nodes.node import Node
from volery.runtime.construction.fleet import check_free
from volery.runtime.construction.placement import StartPose
from volery.runtime.construction.sensor_suites import SensorInstance
from volery.runtime.grid_map_manager import GridMapManager
from volery.runtime.run_loop import RunLoop
from volery.runtime.snapshot import (
    NodeStates,
    Snapshot,
    check_nodes,
    check_partners,
    restore_nodes,
    save_nodes,
    without_state,
)
from volery.runtime.vehicles.manager import VehicleManager


class SnapshotManager:
    """Saves and restores the parts of one simulation.

    `save_start` saves the state that `reset` restores; call it when the simulation is complete.
    """

    def __init__(
        self,
        manager: VehicleManager,
        loop: RunLoop,
        partners: Sequence[Partner],
        grid_map: GridMapManager,
    ) -> None:
        self._manager = manager
        self._engine = manager.engine
        self._graph = manager.graph
        self._radio = manager.radio
        self._outlet = manager.outlet
        self._loop = loop
        self._partners = partners
        self._grid_map = grid_map
        self._start: dict[str, Any] = {}
        self._starts: tuple[StartPose, ...] = ()
        self._new_nodes: NodeStates = {}
        """States of nodes before their first step."""

    def save_start(self) -> None:
        """Saves the present state as the start."""
        self._start = self._state()
        self._starts = self._manager.starts
        self._new_nodes = dict(self._start["nodes"])

    @property
    def spawned(self) -> list[str]:
        """Names of UAVs that were spawned after the start."""
        return [start.name for start in self._manager.starts if start not in self._starts]

    def enlist(self, name: str) -> None:
        """Records the initial node states of a UAV that was just spawned."""
        self._new_nodes.update(save_nodes(self._nodes_of(name)))

    def snapshot(self) -> Snapshot:
        """Returns the present state. Raises `SnapshotError` if it cannot be saved."""
        self._check_whole("a snapshot")
        check_nodes(self._manager.nodes, "a snapshot")
        self._check("a snapshot")
        self._engine.state_check.look()
        return Snapshot(self._engine.time_ns, id(self), self._manager.starts, self._state())

    def restore(self, snapshot: Snapshot) -> None:
        """Restores `snapshot`. Raises `SnapshotError` if it is not of this simulation and fleet."""
        self._check_whole("to restore a state")
        check_nodes(self._manager.nodes, "to restore a state")
        self._check("to restore a state")
        if not isinstance(snapshot, Snapshot):
            raise SnapshotError(f"not a snapshot: {snapshot!r}; pass what snapshot() returned")
        if snapshot.owner != id(self):
            raise SnapshotError("the snapshot belongs to another simulation")
        if snapshot.starts != self._manager.starts:
            then = ", ".join(start.name for start in snapshot.starts)
            raise SnapshotError(f"UAVs were spawned or deleted since the snapshot of {then}")
        self._restore_state(snapshot.state, "another state was restored")

    def reset(self, seed: int) -> None:
        """Restores the start and its UAVs, with the random streams of `seed`."""
        self._check("a reset", to_start=True)
        changed = self._manager.starts != self._starts
        if changed or without_state(self._manager.nodes):
            self._manager.end_nodes()  # all, so that they start in the same order again
        if changed:
            try:
                self._manager.regroup(self._starts)
            except Exception:
                self._manager.start_nodes()
                raise
        self._restore_state(self._start, "the simulation was reset")
        with self._graph.in_place_of(self._start["graph"]):
            self._manager.start_nodes()
        fleet = self._engine.fleet
        rows = np.arange(len(fleet))
        fleet.seed_turbulence(seed, rows, fleet.names)
        if self._radio is not None:
            self._radio.reseed(seed)
        self._manager.reseed(seed)
        self._restart_sensors(rows, self._manager.fitted)
        for partner in self._partners:
            if not partner.has_left:
                self._engine.wait_for(partner, partner.period_s)
        self._manager.take_off(fleet.names)

    def reset_uav(self, row: int) -> None:
        """Resets one UAV to its start while the others continue."""
        fleet = self._engine.fleet
        name = fleet.names[row]
        self._check("a reset")
        begun = self._manager.beginnings[name]
        check_free(fleet, row, begun.fleet["position"][0, begun.row])
        rows = np.array([row])
        fleet.restart(begun.fleet, rows, np.array([begun.row]))
        self._engine.collisions.forget(rows)
        self._outlet.latest.forget(name)
        self._manager.futures.fail(name, "the UAV was reset")
        self._restart_sensors(rows, [f for f in self._manager.fitted if f.id.uav == row])
        if without_state(self._nodes_of(name)):
            self._manager.restart_nodes(name)
        else:
            restore_nodes(self._nodes_of(name), self._new_nodes)
        self._manager.faults.mend(name)
        self._manager.take_off([name])

    def _nodes_of(self, name: str) -> list[Node]:
        return [node for node in self._manager.nodes if node.get_namespace() == f"/{name}"]

    def _restart_sensors(self, rows: Any, fitted: Sequence[SensorInstance]) -> None:
        streams = NamedStreams({(f.id.uav, f.id.name): f.key for f in fitted})
        self._engine.restart_sensors(rows, streams)

    def _check(self, what: str, *, to_start: bool = False) -> None:
        check_partners(self._partners, what, to_start=to_start)
        if not self._engine.stands:
            raise SnapshotError(f"{what} is not possible in the middle of a tick; use post()")

    def _check_whole(self, what: str) -> None:
        if self._engine.division is not None:
            raise SnapshotError(f"{what} is not possible in a run that is divided among machines")

    def _state(self) -> dict[str, Any]:
        digest = self._outlet.digest
        return {
            "seed": self._manager.scenario.seed,
            "engine": self._engine.get_state(),
            "graph": self._graph.get_state(),
            "faults": self._manager.faults.get_state(),
            "publisher": self._manager.publisher.get_state(),
            "transforms": self._manager.transforms.get_state(),
            "nodes": save_nodes(self._manager.nodes),
            "digest": None if digest is None else digest.get_state(),
            "events": list(self._outlet.events),
            "latest": self._outlet.latest.get_state(),
            "owed_ns": self._loop.owed_ns,
            "past_end": self._loop.past_end,
            "grid_map": self._grid_map.get_state(),
            "radio": None if self._radio is None else self._radio.get_state(),
        }

    def _restore_state(self, state: dict[str, Any], reason: str) -> None:
        self._manager.futures.fail_all(reason)
        self._manager.reseed(state["seed"])
        restore_nodes(self._manager.nodes, state["nodes"])
        self._grid_map.set_state(state["grid_map"])
        self._engine.set_state(state["engine"])
        self._graph.set_state(state["graph"])
        self._manager.faults.set_state(state["faults"])
        self._manager.publisher.set_state(state["publisher"])
        self._manager.transforms.set_state(state["transforms"])
        if self._outlet.digest is not None:
            self._outlet.digest.set_state(state["digest"])
        self._outlet.events[:] = state["events"]
        self._outlet.latest.set_state(state["latest"])
        self._loop.owed_ns = state["owed_ns"]
        self._loop.past_end = state["past_end"]
        if self._radio is not None:
            self._radio.set_state(state["radio"])
