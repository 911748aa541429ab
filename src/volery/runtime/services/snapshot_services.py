"""Saves and restores snapshots by name, in memory; sets the speed; resets single UAVs."""

from __future__ import annotations

from typing import Any, Protocol

from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.graph.messages import time_from_ns
from volery.runtime.facets.clock import SimulationClock
from volery.runtime.facets.vehicles import SimulationVehicles
from volery.runtime.services.results import Fields, offer_command
from volery.runtime.snapshot import Snapshot

_OURS = "volery_interfaces/srv"
_MAX_SNAPSHOTS = 16
_MAX_NAME_LENGTH = 100


class SnapshotOwner(Protocol):
    """Saves and restores its state: a simulation."""

    def snapshot(self) -> Snapshot:
        """Returns the present state."""

    def restore(self, snapshot: Snapshot) -> None:
        """Restores a state of this owner."""


class SnapshotServices:
    """Provides `/volery/save_snapshot`, `restore_snapshot`, `delete_snapshot` and more."""

    def __init__(
        self,
        graph: Graph,
        owner: SnapshotOwner,
        clock: SimulationClock,
        vehicles: SimulationVehicles,
    ) -> None:
        self._graph = graph
        self._owner = owner
        self._clock = clock
        self._vehicles = vehicles
        self._snapshots: dict[str, Snapshot] = {}

    def offer(self) -> None:
        """Creates the services."""
        graph = self._graph
        for name, handler in (
            ("save_snapshot", self._save),
            ("restore_snapshot", self._restore),
            ("delete_snapshot", self._forget),
            ("reset_uav", lambda request: self._vehicles.reset(request.name)),
        ):
            offer_command(graph, f"/volery/{name}", f"{_OURS}/ByName", handler)
        offer_command(graph, "/volery/list_snapshots", f"{_OURS}/ListSnapshots", self._list)
        offer_command(graph, "/volery/set_speed", f"{_OURS}/SetSpeed", self._set_speed)

    def _save(self, request: Any) -> Fields:
        name = request.name
        if not 0 < len(name) <= _MAX_NAME_LENGTH:
            raise CommandError(f"the name of a snapshot has 1 to {_MAX_NAME_LENGTH} characters")
        if name not in self._snapshots and len(self._snapshots) >= _MAX_SNAPSHOTS:
            raise CommandError(f"{_MAX_SNAPSHOTS} snapshots are saved; delete one first")
        snapshot = self._snapshots[name] = self._owner.snapshot()
        return {"message": f"saved the state at {snapshot.time_s:.3f} s"}

    def _restore(self, request: Any) -> Fields:
        snapshot = self._find(request.name)
        self._owner.restore(snapshot)
        return {"message": f"restored the state at {snapshot.time_s:.3f} s"}

    def _forget(self, request: Any) -> None:
        self._find(request.name)
        del self._snapshots[request.name]

    def _list(self, _request: Any) -> Fields:
        stamps = [time_from_ns(snapshot.time_ns) for snapshot in self._snapshots.values()]
        return {"names": list(self._snapshots), "stamps": stamps}

    def _find(self, name: str) -> Snapshot:
        if name not in self._snapshots:
            known = ", ".join(self._snapshots) or "none"
            raise CommandError(f"there is no snapshot '{name}'; known: {known}")
        return self._snapshots[name]

    def _set_speed(self, request: Any) -> None:
        factor = request.factor
        self._clock.set_speed(None if factor <= 0.0 else factor)
