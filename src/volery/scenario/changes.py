"""Changes that a client may make to a scenario when loading it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from volery.core.errors import ScenarioError
from volery.scenario.base import Data, NonNegative
from volery.scenario.fleet_size import resized
from volery.scenario.load import parse_scenario
from volery.scenario.schema import InventoryForest, ProceduralForest, Scenario
from volery.scenario.sensor_sets import SensorSet, fit
from volery.scenario.uav_types import with_airframe
from volery.scenario.validation import describe_validation_error

_WHERE = "changes"
_M2_A_HA = 1e4


class Changes(Data):
    """Changes to a scenario; None leaves a value unchanged."""

    uavs: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Number of UAVs in the scenario's only group."""
    airframe: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Airframe of all types: a shipped name."""
    sensors: tuple[SensorSet, ...] | None = None
    """Sensor sets of all types; see `sensor_sets.fit`."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    seconds: Annotated[float, Field(gt=0.0, le=1_000_000.0)] | None = None
    tree_density_per_ha: NonNegative | None = None
    """Tree density of a procedural forest."""
    tree_share: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    """Fraction of the trees of an inventory."""
    speed: Annotated[float, Field(ge=0.0, lt=1e6)] | None = None
    """Real-time factor; 0: as fast as possible."""


@dataclass(frozen=True)
class WorldRequest:
    """Request of a client to load a scenario."""

    name: str
    changes: Changes = field(default_factory=Changes)


@dataclass(frozen=True)
class LogRequest:
    """Request of a client to play a recorded log."""

    path: Path


def parse_changes(text: str) -> Changes:
    """Parses changes from JSON; empty: none.

    Raises `ScenarioError`, naming error and allowed values, for invalid changes.
    """
    if not text.strip():
        return Changes()
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"{_WHERE}: not JSON: {error}") from None
    if not isinstance(data, dict):
        raise ScenarioError(f'{_WHERE}: a JSON object such as {{"uavs": 5}}, not {text[:40]}')
    try:
        return Changes.model_validate_json(text)
    except ValidationError as error:
        raise ScenarioError(describe_validation_error(error, _WHERE, Changes, data)) from None


def apply(scenario: Scenario, changes: Changes) -> Scenario:
    """Returns the scenario with the changes, validated; raises `ScenarioError` for invalid ones."""
    data: dict[str, Any] = scenario.model_dump(exclude_unset=True)
    if changes.seconds is not None:
        data["duration_s"] = changes.seconds
    if changes.seed is not None:
        data["seed"] = changes.seed
    if changes.uavs is not None:
        data["uavs"] = resized(data["uavs"], changes.uavs, name=scenario.name, where=_WHERE)
    data["types"] = {name: _type(kind, changes) for name, kind in data["types"].items()}
    forest = _forest(scenario, changes)
    if forest:
        data["world"]["forest"] = {**data["world"]["forest"], **forest}
    return parse_scenario(data, where=scenario.name, access=scenario.access)


def _type(data: Any, changes: Changes) -> dict[str, Any]:
    changed = dict(data)
    if changes.airframe is not None:
        changed = with_airframe(changed, changes.airframe)
    if changes.sensors is not None:
        changed["sensors"] = fit(data.get("sensors", ()), changes.sensors)
    return changed


def _forest(scenario: Scenario, changes: Changes) -> dict[str, Any]:
    """Returns the keys to set in the forest's table."""
    forest, density = scenario.world.forest, changes.tree_density_per_ha
    if density is not None:
        if not isinstance(forest, ProceduralForest):
            raise ScenarioError(
                f"{_WHERE}: key 'tree_density_per_ha': scenario '{scenario.name}' has no "
                f"procedural forest{_hint(forest, 'tree_share')}"
            )
        x0, y0, x1, y1 = forest.region_m
        return {"trees": math.floor(density * (x1 - x0) * (y1 - y0) / _M2_A_HA + 0.5)}
    if changes.tree_share is not None:
        if not isinstance(forest, InventoryForest):
            raise ScenarioError(
                f"{_WHERE}: key 'tree_share': scenario '{scenario.name}' has no forest of an "
                f"inventory{_hint(forest, 'tree_density_per_ha')}"
            )
        return {"fraction": changes.tree_share}
    return {}


def _hint(forest: object, key: str) -> str:
    return "" if forest is None else f"; use '{key}'"
