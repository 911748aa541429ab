"""Serves weather, gusts and faults while the simulation runs: `/volery/...`."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from volery.core.errors import CommandError
from volery.runtime.services.results import Fields, offer_command
from volery.runtime.services.weather_messages import changed, fields_of

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

_OURS = "volery_interfaces/srv"


def offer_air_and_faults(simulation: Simulation) -> None:
    """Creates the services set_weather, get_weather, gust, inject_fault and end_fault."""

    def set_weather(request: Any) -> None:
        simulation.set_weather(changed(simulation.weather, request, request.only))

    def get_weather(_request: Any) -> Fields:
        weather = simulation.weather
        return {
            **fields_of(simulation.scenario.world, weather),
            "gusts": len(weather.gusts),
        }

    def gust(request: Any) -> None:
        amplitude = (request.amplitude.x, request.amplitude.y, request.amplitude.z)
        lasts_s = request.duration if request.duration != 0.0 else math.inf
        simulation.gust_now(amplitude, request.rise, lasts_s)

    def inject_fault(request: Any) -> None:
        simulation.inject_fault(_fault_of(request))

    def end_fault(request: Any) -> None:
        simulation.end_fault(_fault_of(request))

    graph = simulation.graph
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
