"""Spawns and deletes UAVs, by the standard."""

from __future__ import annotations

import itertools
from typing import Any

from volery.core.errors import PlacementError, SpawnError, SpawnFault, VoleryError
from volery.graph.graph import Graph
from volery.graph.messages import frame_of
from volery.runtime.facets.vehicles import SimulationVehicles
from volery.runtime.services.results import (
    Fields,
    RefusedError,
    ResultCode,
    failed,
    filled,
    offer_result,
    result,
)

_SRV = "simulation_interfaces/srv"
_MSG = "simulation_interfaces/msg"
_NAME_NOT_UNIQUE = 101
_NAME_INVALID = 102
_UNSUPPORTED_FORMAT = 103
_NO_RESOURCE = 104
_NAMESPACE_INVALID = 105
_PARSE_ERROR = 106
_INVALID_POSE = 109
_SPAWN_FAILED = 150
_CODES = {
    SpawnFault.NAME: _NAME_INVALID,
    SpawnFault.NAME_TAKEN: _NAME_NOT_UNIQUE,
    SpawnFault.TYPE: ResultCode.NOT_FOUND,
    SpawnFault.FAILED: _SPAWN_FAILED,
}


class SpawnServices:
    """Serves the list of spawnable types; spawns and deletes UAVs."""

    def __init__(self, graph: Graph, vehicles: SimulationVehicles) -> None:
        self._graph = graph
        self._vehicles = vehicles

    def offer(self) -> None:
        """Creates the services."""
        graph = self._graph
        offer_result(graph, "/get_spawnables", f"{_SRV}/GetSpawnables", self._spawnables)
        offer_result(graph, "/spawn_entity", f"{_SRV}/SpawnEntity", self._spawn)
        offer_result(graph, "/spawn_entities", f"{_SRV}/SpawnEntities", self._spawn_each)
        offer_result(graph, "/delete_entity", f"{_SRV}/DeleteEntity", self._delete)

    def _spawnables(self, _request: Any) -> Fields:
        types = self._vehicles.types
        spawnables = []
        for name in self._vehicles.spawnable:
            kind = types.get(name)
            what = f"{kind.airframe}, {kind.plant}" if kind else "airframe with the usual sensors"
            fields = {"entity_resource": resource(name), "description": f"UAV: {what}"}
            spawnables.append(filled(f"{_MSG}/Spawnable", fields))
        return {"spawnables": spawnables}

    def _spawn(self, request: Any) -> Fields:
        pose = request.initial_pose
        if request.entity_resource.resource_string:
            raise RefusedError(_UNSUPPORTED_FORMAT, "UAVs are spawned by type, not from a string")
        if not request.entity_resource.uri:
            raise RefusedError(_NO_RESOURCE, "uri must be an entity_resource of /get_spawnables")
        if frame_of(pose) not in ("", "map"):
            reason = f"poses are in 'map', not in '{frame_of(pose)}'"
            raise RefusedError(_INVALID_POSE, reason)
        name = self._name(request)
        if request.entity_namespace.strip("/") not in ("", name):
            reason = f"the namespace of a UAV is its name, /{name}; leave it empty"
            raise RefusedError(_NAMESPACE_INVALID, reason)
        try:
            position, turn = pose.pose.position, pose.pose.orientation
            attitude = [turn.x, turn.y, turn.z, turn.w]
            self._vehicles.spawn(
                name,
                request.entity_resource.uri,
                [position.x, position.y, position.z],
                attitude if any(attitude) else [0.0, 0.0, 0.0, 1.0],
            )
        except SpawnError as error:
            raise RefusedError(_CODES[error.fault], str(error)) from None
        except PlacementError as error:
            raise RefusedError(_INVALID_POSE, str(error)) from None
        except VoleryError as error:
            raise RefusedError(_PARSE_ERROR, str(error)) from None
        return {"entity_name": name}

    def _spawn_each(self, request: Any) -> Fields:
        """Spawns all that can be spawned; each of the others has its own error."""
        results = []
        for each in request.spawn_requests:
            try:
                fields = {"result": result(), **self._spawn(each)}
            except RefusedError as error:
                fields = {"result": failed(error)}
            results.append(filled(f"{_MSG}/SpawnResult", fields))
        missing = sum(each.result.result != ResultCode.OK for each in results)
        if missing:
            reason = f"{missing} of {len(results)} were not spawned; see their results"
            return {"result": result(_SPAWN_FAILED, reason), "results": results}
        return {"results": results}

    def _delete(self, request: Any) -> None:
        if request.entity not in self._vehicles.names:
            raise RefusedError(ResultCode.NOT_FOUND, f"there is no entity '{request.entity}'")
        self._vehicles.delete(request.entity)

    def _name(self, request: Any) -> str:
        """Returns the requested name, or a free one where that is allowed or no name is given."""
        wished, names = str(request.name), self._vehicles.names
        if wished and not (wished in names and request.allow_renaming):
            return wished
        if not wished and not request.allow_renaming:
            raise RefusedError(_NAME_INVALID, "name is empty, and allow_renaming is false")
        stem = f"{wished}_" if wished else "uav"
        free = (f"{stem}{number}" for number in itertools.count(1))
        return next(name for name in free if name not in names)


def resource(uri: str) -> Any:
    """Returns a `Resource` with a name as its URI."""
    return filled(f"{_MSG}/Resource", {"uri": uri})
