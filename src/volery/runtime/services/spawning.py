"""Spawning and deleting, which this simulator cannot do while it runs, and what it has instead."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from volery.runtime.services.offering import (
    Code,
    Fields,
    RefusedError,
    filled,
    offer_result,
    result,
)

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

_SRV = "simulation_interfaces/srv"
_WHY = "the fleet is built once, from the scenario's uavs; add them there and load it anew"


def offer_spawning(simulation: Simulation) -> None:
    """Offer `/get_spawnables`, and honest refusals of what would change the fleet."""
    graph, types = simulation.graph, simulation.scenario.types

    def spawnables(_request: Any) -> Fields:
        return {
            "spawnables": [
                filled(
                    "simulation_interfaces/msg/Spawnable",
                    {
                        "entity_resource": resource(name),
                        "description": f"UAV: {kind.airframe}, {kind.plant}; for scenarios",
                    },
                )
                for name, kind in types.items()
            ]
        }

    def refuse(_request: Any) -> Fields:
        raise RefusedError(Code.FEATURE_UNSUPPORTED, _WHY)

    def delete(request: Any) -> Fields:
        if request.entity not in simulation.uavs:
            raise RefusedError(Code.NOT_FOUND, f"there is no entity '{request.entity}'")
        return refuse(request)

    def refuse_each(request: Any) -> Fields:
        each = {"result": result(Code.FEATURE_UNSUPPORTED, _WHY)}
        name = "simulation_interfaces/msg/SpawnResult"
        return {
            "result": result(Code.FEATURE_UNSUPPORTED, _WHY),
            "results": [filled(name, each) for _ in request.spawn_requests],
        }

    offer_result(graph, "/get_spawnables", f"{_SRV}/GetSpawnables", spawnables)
    offer_result(graph, "/spawn_entity", f"{_SRV}/SpawnEntity", refuse)
    offer_result(graph, "/spawn_entities", f"{_SRV}/SpawnEntities", refuse_each)
    offer_result(graph, "/delete_entity", f"{_SRV}/DeleteEntity", delete)


def resource(uri: str) -> Any:
    """A `Resource` that is found under a name."""
    return filled("simulation_interfaces/msg/Resource", {"uri": uri})
