"""What a simulation keeps of itself, and how it goes back to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from volery.control.fleet import Fleet
from volery.core.errors import SnapshotError
from volery.engine.engine import Engine
from volery.engine.faults import FaultPlan
from volery.engine.partners import Partner
from volery.graph.graph import Graph
from volery.graph.node import Node
from volery.graph.publishing import GraphPublisher
from volery.runtime.building import check_free
from volery.runtime.outlet import Outlet
from volery.runtime.run_loop import RunLoop
from volery.runtime.sensor_fitting import Fitted, refit
from volery.runtime.snapshot import (
    Snapshot,
    check_nodes,
    check_partners,
    keep_nodes,
    put_back_nodes,
)


@dataclass
class Keeper:
    """Keeps and puts back the parts of one simulation.

    `take_off(names)` has those of the UAVs take off that do so by themselves. Make it when all
    parts stand at their start: that state is what `reset` goes back to.
    """

    fleet: Fleet
    engine: Engine
    graph: Graph
    faults: FaultPlan
    publisher: GraphPublisher
    loop: RunLoop
    fitted: Sequence[Fitted]
    nodes: list[Node]
    partners: list[Partner]
    outlet: Outlet
    take_off: Callable[[Sequence[str]], None]
    _start: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        self._start = self._state()

    def snapshot(self) -> Snapshot:
        """The present state."""
        self._check("a snapshot", self.nodes)
        return Snapshot(self.engine.time_ns, id(self), self._state())

    def restore(self, snapshot: Snapshot) -> None:
        """Go to a kept state."""
        self._check("to restore a state", self.nodes)
        if not isinstance(snapshot, Snapshot):
            raise SnapshotError(f"not a snapshot: {snapshot!r}")
        if snapshot.owner != id(self):
            raise SnapshotError("the snapshot is of another simulation")
        self._put_back(snapshot.state)

    def reset(self, seed: int) -> None:
        """Go back to the start, with other random streams."""
        self._check("a reset", self.nodes)
        self._put_back(self._start)
        rows = np.arange(len(self.fleet))
        self.fleet.seed_turbulence(seed, rows, self.fleet.names)
        self._restart_sensors(rows, refit(self.fitted, seed))
        self.take_off(self.fleet.names)

    def reset_uav(self, row: int) -> None:
        """Put one UAV back to its start while the others fly on."""
        name = self.fleet.names[row]
        nodes = [k for k, node in enumerate(self.nodes) if node.get_namespace() == f"/{name}"]
        self._check("a reset", [self.nodes[k] for k in nodes])
        start = self._start["engine"]["fleet"]
        check_free(self.fleet, row, start["position"][0, row])
        rows = np.array([row])
        self.fleet.restart(start, rows)
        self.engine.collisions.forget(rows)
        self._restart_sensors(rows, [f for f in self.fitted if f.id.uav == row])
        states = self._start["nodes"]
        put_back_nodes([self.nodes[k] for k in nodes], [states[k] for k in nodes])
        self.faults.mend(row)
        self.take_off([name])

    def _restart_sensors(self, rows: Any, fitted: Sequence[Fitted]) -> None:
        self.engine.restart_sensors(rows, {(f.id.uav, f.id.name): f.key for f in fitted})

    def _check(self, what: str, nodes: Sequence[Node]) -> None:
        check_nodes(nodes, what)
        check_partners(self.partners, what)
        if not self.engine.stands:
            raise SnapshotError(f"{what} is not possible in the middle of a tick; use post()")

    def _state(self) -> dict[str, Any]:
        digest = self.outlet.digest
        return {
            "engine": self.engine.get_state(),
            "graph": self.graph.get_state(),
            "faults": self.faults.get_state(),
            "publisher": self.publisher.get_state(),
            "nodes": keep_nodes(self.nodes),
            "digest": None if digest is None else digest.get_state(),
            "events": list(self.outlet.events),
            "owed_ns": self.loop.owed_ns,
        }

    def _put_back(self, state: dict[str, Any]) -> None:
        put_back_nodes(self.nodes, state["nodes"])
        self.engine.set_state(state["engine"])
        self.graph.set_state(state["graph"])
        self.faults.set_state(state["faults"])
        self.publisher.set_state(state["publisher"])
        if self.outlet.digest is not None:
            self.outlet.digest.set_state(state["digest"])
        self.outlet.events[:] = state["events"]
        self.loop.owed_ns = state["owed_ns"]
