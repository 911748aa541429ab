"""What a client may have otherwise in a scenario that it loads."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from volery.core.errors import ScenarioError
from volery.scenario.base import Data, NonNegative
from volery.scenario.load import describe_validation_error, parse_scenario
from volery.scenario.schema import InventoryForest, ProceduralForest, Scenario
from volery.scenario.sensor_sets import SensorSet, fit

_WHERE = "changes"
_APART_M = 3.0
"""Between UAVs that are added to a scenario of one; their rotors' air stays apart."""
_M2_A_HA = 1e4


class Changes(Data):
    """Changes to a scenario; what is None stays as it is."""

    uavs: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """How many fly, of the scenario's only group."""
    airframe: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Of all types: the name of a shipped one."""
    sensors: tuple[SensorSet, ...] | None = None
    """Sets that all types carry; see `sensor_sets.fit`."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    seconds: Annotated[float, Field(gt=0.0, le=1_000_000.0)] | None = None
    tree_density_per_ha: NonNegative | None = None
    """Of a procedural forest."""
    tree_share: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    """Of the trees of an inventory."""
    speed: Annotated[float, Field(ge=0.0, lt=1e6)] | None = None
    """Factor of real time at which it is flown; 0: as fast as possible."""


@dataclass(frozen=True)
class WorldRequest:
    """A scenario that a client wants to see flown."""

    name: str
    changes: Changes = field(default_factory=Changes)


@dataclass(frozen=True)
class LogRequest:
    """A recorded log that a client wants to see played."""

    path: Path


def parse_changes(text: str) -> Changes:
    """Changes as JSON; empty: none. `ScenarioError` names what is wrong and what is allowed."""
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
    """The scenario with the changes, checked anew. Raises `ScenarioError` where one cannot be."""
    data: dict[str, Any] = scenario.model_dump(exclude_unset=True)
    if changes.seconds is not None:
        data["duration_s"] = changes.seconds
    if changes.seed is not None:
        data["seed"] = changes.seed
    if changes.uavs is not None:
        data["uavs"] = _groups(scenario, data["uavs"], changes.uavs)
    data["types"] = {
        name: _type(scenario, name, kind, changes) for name, kind in data["types"].items()
    }
    forest = _forest(scenario, changes)
    if forest:
        data["world"]["forest"] = {**data["world"]["forest"], **forest}
    return parse_scenario(data, where=scenario.name, access=scenario.access)


def _groups(scenario: Scenario, groups: Any, uavs: int) -> list[Any]:
    """The only group with another count.

    More of them stand on the old line, each where it finds room beside it; in the air, on a line of
    their own.
    """
    if uavs == scenario.uav_count:
        return list(groups)
    if len(groups) > 1:
        raise ScenarioError(
            f"{_WHERE}: key 'uavs': scenario '{scenario.name}' has {len(groups)} groups of UAVs, "
            f"{scenario.uav_count} in all, and says itself how many fly"
        )
    group, first = {**groups[0], "count": uavs}, scenario.uavs[0]
    if uavs < first.count or uavs == 1:
        return [group]
    in_air = len(first.position_m) == len("xyz")
    if in_air or first.last_position_m is None:
        x, y = first.position_m[:2]
        group["last_position_m"] = [x, y + _APART_M * (uavs - 1)]
    return [group if in_air else {**group, "placement": "nearest_free"}]


def _type(scenario: Scenario, name: str, data: Any, changes: Changes) -> dict[str, Any]:
    changed = dict(data)
    if changes.airframe is not None and changes.airframe != scenario.types[name].airframe:
        changed["airframe"] = changes.airframe
        changed.pop("wear", None)  # of the rotors of the other one
    if changes.sensors is not None:
        changed["sensors"] = fit(scenario.types[name], data, changes.sensors)
    return changed


def _forest(scenario: Scenario, changes: Changes) -> dict[str, Any]:
    """What is set in the table of the forest."""
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
