"""Gives the UAVs of a scenario autopilots."""

from __future__ import annotations

from typing import Any

from volery.mavlink.codec import dialect
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario

NODE = "volery.mavlink.node:Autopilot"


def with_autopilots(scenario: Scenario) -> Scenario:
    """The scenario with an autopilot beside each UAV whose type has none.

    It is part of what is flown then: logs tell of it, and repeated flights have it too.
    `BridgeError` where pymavlink is not installed.
    """
    dialect()
    data: dict[str, Any] = scenario.model_dump(exclude_unset=True)
    for name, uav_type in scenario.types.items():
        if all(entry.node != NODE for entry in uav_type.nodes):
            kept = [entry.model_dump(exclude_unset=True) for entry in uav_type.nodes]
            data["types"][name] = {**data["types"][name], "nodes": [*kept, {"node": NODE}]}
    changed = parse_scenario(data, where=scenario.name)
    changed._folder = scenario.folder
    return changed
