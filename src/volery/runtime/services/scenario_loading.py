"""Loads scenarios with the changes that clients request: fleet size, sensors, forest density."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.runtime.construction.start_check import check_start
from volery.runtime.services.results import Fields, offer_command
from volery.scenario import changes as scenario_changes
from volery.scenario.changes import Changes, WorldRequest
from volery.scenario.schema import Scenario
from volery.scenario.sensor_sets import SENSOR_SETS, describe
from volery.vehicle.airframe import airframe_names

_OURS = "volery_interfaces/srv"


def offer_choices(
    graph: Graph,
    names: Callable[[], Sequence[str]],
    find: Callable[[str], Scenario],
    change: Callable[[WorldRequest], None],
) -> None:
    """Creates `/volery/load_scenario` and `/volery/get_scenario_options`.

    `names` and `find` return the available scenarios; `change` loads one, or raises.
    """

    def load(request: Any) -> Fields:
        if request.scenario not in names():
            known = ", ".join(names())
            raise CommandError(f"no scenario '{request.scenario}'; known: {known}")
        changes = scenario_changes.parse_changes(request.changes)
        _check_airframe(changes)
        scenario = scenario_changes.apply(find(request.scenario), changes)
        check_start(scenario)
        change(WorldRequest(request.scenario, changes))
        return {"message": f"{request.scenario} is being loaded"}

    def choices(_request: Any) -> Fields:
        return {
            "scenarios": list(names()),
            "airframes": list(_airframes()),
            "sensor_sets": list(SENSOR_SETS),
            "sensor_set_descriptions": list(_descriptions()),
            "changes_schema": _changes_schema(),
        }

    offer_command(graph, "/volery/load_scenario", f"{_OURS}/LoadScenario", load)
    offer_command(graph, "/volery/get_scenario_options", f"{_OURS}/GetScenarioOptions", choices)


@cache
def _changes_schema() -> str:
    """Returns the JSON schema of changes, cached: building it takes tens of milliseconds."""
    return json.dumps(Changes.model_json_schema())


@cache
def _airframes() -> tuple[str, ...]:
    return airframe_names()


@cache
def _descriptions() -> tuple[str, ...]:
    return tuple(describe(name) for name in SENSOR_SETS)


def _check_airframe(changes: Changes) -> None:
    """Raises `CommandError` unless the airframe ships with Volery: names must not become paths."""
    if changes.airframe is not None and changes.airframe not in airframe_names():
        known = ", ".join(airframe_names())
        raise CommandError(
            f"changes: key 'airframe': there is no '{changes.airframe}'; known: {known}"
        )
