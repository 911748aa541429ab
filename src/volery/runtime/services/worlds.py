"""Serves the worlds of the standard: the scenarios of the library."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cache
from typing import Any

from volery.core.errors import ScenarioError, VoleryError
from volery.graph.graph import Graph
from volery.runtime.construction.start_check import check_start
from volery.runtime.services.filters import tag_filter
from volery.runtime.services.results import (
    Fields,
    RefusedError,
    ResultCode,
    filled,
    offer_command,
    offer_result,
)
from volery.runtime.services.scenario_loading import offer_choices
from volery.runtime.services.spawning import resource
from volery.scenario import library
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.changes import LogRequest, WorldRequest
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario

_SRV = "simulation_interfaces/srv"
_UNSUPPORTED_FORMAT = 101
_NO_RESOURCE = 102
_PARSE_ERROR = 103
_NO_WORLD = 101

OnLoad = Callable[[WorldRequest | LogRequest | None], None]
"""Loads another scenario or log in place of the present one; None unloads."""


def offer_worlds(
    graph: Graph,
    loaded: Scenario | None,
    on_load: OnLoad | None,
    catalog: ScenarioCatalog | None = None,
) -> None:
    """Creates the services that list worlds, and load and unload them where `on_load` is given.

    The owner of the simulation implements `on_load`: the process builds another simulation, or
    none. `loaded` is the present scenario; `catalog` provides scenarios and logs, None: the
    library.
    """
    catalog = catalog or ScenarioCatalog()

    def available(request: Any) -> Fields:
        passes = tag_filter(request.filter)
        if list(request.additional_sources) and not request.continue_on_error:
            reason = "there are no sources of worlds except the library of scenarios"
            raise RefusedError(ResultCode.FEATURE_UNSUPPORTED, reason)
        names = catalog.names()
        worlds = [_read(catalog, name) for name in names]
        return {"worlds": [_world(s, names) for s in worlds if passes(tags_of(s))]}

    def current(_request: Any) -> Fields:
        if loaded is None:
            raise RefusedError(_NO_WORLD, "no world is loaded")
        return {"world": _world(loaded, catalog.names())}

    def load(request: Any) -> Fields:
        scenario = _requested(request.world_resource, catalog) if on_load is not None else None
        if scenario is not None:
            _check_start(scenario)
        change(None if scenario is None else WorldRequest(scenario.name))
        return {"world": _world(scenario, catalog.names())} if scenario is not None else {}

    def unload(_request: Any) -> None:
        if loaded is None:
            raise RefusedError(_NO_WORLD, "no world is loaded")
        change(None)

    def play(request: Any) -> Fields:
        change(LogRequest(catalog.log(request.name)))
        return {"message": f"{request.name} is being opened"}

    def change(request: WorldRequest | LogRequest | None) -> None:
        if on_load is None:
            reason = "this process simulates one scenario; start another one for another world"
            raise RefusedError(ResultCode.FEATURE_UNSUPPORTED, reason)
        try:
            on_load(request)
        except VoleryError as error:
            raise RefusedError(ResultCode.OPERATION_FAILED, str(error)) from None

    offer_result(graph, "/get_available_worlds", f"{_SRV}/GetAvailableWorlds", available)
    offer_result(graph, "/get_current_world", f"{_SRV}/GetCurrentWorld", current)
    offer_result(graph, "/load_world", f"{_SRV}/LoadWorld", load)
    offer_result(graph, "/unload_world", f"{_SRV}/UnloadWorld", unload)
    offer_command(graph, "/volery/play_recording", "volery_interfaces/srv/PlayRecording", play)
    offer_choices(graph, catalog.names, lambda name: _read(catalog, name), change)


def _check_start(scenario: Scenario) -> None:
    """Refuses a scenario that cannot be built here, while the present one flies on."""
    try:
        check_start(scenario)
    except VoleryError as error:
        raise RefusedError(ResultCode.OPERATION_FAILED, str(error)) from None


def tags_of(scenario: Scenario) -> list[str]:
    """Returns the tags of a world: its ground, `forest` if it has trees, `grid_map`."""
    world = scenario.world
    parts = {"forest": world.forest, "grid_map": world.grid_map}
    there = [name for name, part in parts.items() if part is not None]
    return [f"{world.terrain.kind}_ground", *there]


def _requested(source: Any, catalog: ScenarioCatalog) -> Scenario:
    if source.resource_string:
        raise RefusedError(_UNSUPPORTED_FORMAT, "worlds are loaded by name, not from a string")
    if not source.uri:
        raise RefusedError(_NO_RESOURCE, "uri must be the name of a scenario of the library")
    if source.uri not in catalog.names():
        known = ", ".join(catalog.names())
        raise RefusedError(ResultCode.NOT_FOUND, f"no scenario '{source.uri}'; known: {known}")
    try:
        return _read(catalog, source.uri)
    except ScenarioError as error:
        raise RefusedError(_PARSE_ERROR, str(error)) from None


@cache
def _shipped(name: str) -> Scenario:
    return load_scenario(name)


def _read(catalog: ScenarioCatalog, name: str) -> Scenario:
    return _shipped(name) if name in library.names() else catalog.load(name)


def _world(scenario: Scenario, names: Collection[str]) -> Any:
    fields = {
        "name": scenario.name,
        "world_resource": resource(scenario.name if scenario.name in names else ""),
        "description": scenario.description.strip(),
        "tags": tags_of(scenario),
    }
    return filled("simulation_interfaces/msg/WorldResource", fields)
