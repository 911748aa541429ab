"""Overrides of a loaded scenario from the command line."""

from __future__ import annotations

import math
from typing import Any

from volery.core.errors import ScenarioError
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario


def apply(
    scenario: Scenario,
    *,
    uavs: int | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    nodes: bool = True,
) -> Scenario:
    """Returns the scenario with another fleet size, duration or seed, validated.

    `uavs` sets the count of a scenario's only group. `nodes`: False removes its nodes, for nodes
    that run elsewhere. Raises `ScenarioError` for invalid values, or if `uavs` is given for a
    scenario with several groups.
    """
    data: dict[str, Any] = scenario.model_dump(exclude_unset=True)
    if seconds is not None:
        if not 0.0 < seconds < math.inf:
            raise ScenarioError(f"--seconds: a run lasts longer than 0 s (found {seconds:g})")
        data["duration_s"] = seconds
    if seed is not None:
        data["seed"] = seed
    if uavs is not None:
        if uavs < 1:
            raise ScenarioError(f"--uavs: a run needs at least 1 UAV (found {uavs})")
        if len(scenario.uavs) > 1:
            raise ScenarioError(
                f"--uavs: scenario '{scenario.name}' has {len(scenario.uavs)} groups of UAVs; "
                "set their counts in its file"
            )
        group = scenario.uavs[0]
        if uavs > 1 and group.last_position_m is None:
            raise ScenarioError(
                f"--uavs: scenario '{scenario.name}' gives no last_position_m to spread UAVs to"
            )
        data["uavs"] = [{**data["uavs"][0], "count": uavs}]
    if not nodes:
        data["nodes"] = []
        data["types"] = {name: {**kind, "nodes": []} for name, kind in data["types"].items()}
    return parse_scenario(data, where=scenario.name, access=scenario.access)
