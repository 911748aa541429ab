"""Serves weather, gusts and faults while the simulation runs: `/volery/...`."""

from __future__ import annotations

import json
import math
from typing import Any

from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.runtime.facets.faults import SimulationFaults
from volery.runtime.facets.world import SimulationWorld
from volery.runtime.services.results import Fields, offer_command
from volery.runtime.services.weather_messages import changed, fields_of
from volery.scenario.schema import World

_OURS = "volery_interfaces/srv"


def offer_air_and_faults(
    graph: Graph, settings: World, world: SimulationWorld, faults: SimulationFaults
) -> None:
    """Creates the services set_weather, get_weather, gust, inject_fault and end_fault.

    settings: the world of the scenario.
    """

    def set_weather(request: Any) -> None:
        world.set_weather(changed(world.weather, request, request.only))

    def get_weather(_request: Any) -> Fields:
        weather = world.weather
        return {
            **fields_of(settings, weather),
            "gusts": len(weather.gusts),
        }

    def gust(request: Any) -> None:
        amplitude = (request.amplitude.x, request.amplitude.y, request.amplitude.z)
        lasts_s = request.duration if request.duration != 0.0 else math.inf
        world.gust_now(amplitude, request.rise, lasts_s)

    def inject_fault(request: Any) -> None:
        faults.inject(_fault_of(request))

    def end_fault(request: Any) -> None:
        faults.end(_fault_of(request))

    offer_command(graph, "/volery/set_weather", f"{_OURS}/SetWeather", set_weather)
    offer_command(graph, "/volery/get_weather", f"{_OURS}/GetWeather", get_weather)
    offer_command(graph, "/volery/gust", f"{_OURS}/Gust", gust)
    offer_command(graph, "/volery/inject_fault", f"{_OURS}/InjectFault", inject_fault)
    offer_command(graph, "/volery/end_fault", f"{_OURS}/EndFault", end_fault)


def _fault_of(request: Any) -> Any:
    try:
        return json.loads(request.fault)
    except (ValueError, RecursionError) as error:
        raise CommandError(f"fault is not JSON: {error}") from None
