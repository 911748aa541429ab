"""Makes a running simulation from a scenario's name and changes to it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from volery.runtime.simulation import Simulation
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario


def make(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    /,
    *,
    threads: int = 2,
    recordings: Path | None = None,
    trust: bool = False,
    **keys: Any,
) -> Simulation:
    """Returns a running simulation of a scenario with changes; use it as a context manager.

        volery.make("hover", uavs=8, seed=1, wind=(3.0, 0.0, 0.0), sensors=["lidar"])

    scenario: a shipped scenario's name (`list_scenarios`), the path of a TOML file, or a
    `Scenario`. changes and keys: those of `Scenario.with_`. threads and recordings: those of
    `Simulation`. trust: that of `load_scenario`, for a path. Raises `ScenarioError`, naming key and
    allowed values, for a scenario or a change that is invalid.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario, trust=trust)
    if changes or keys:
        scenario = scenario.with_(changes, **keys)
    return Simulation(scenario, threads=threads, recordings=recordings)
