"""The worlds that the environments of a vectorized simulation are in, and the starts there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.errors import ScenarioError
from volery.runtime.construction.fleet import build_fleet, place_fleet
from volery.runtime.construction.placement import StartPose
from volery.runtime.construction.worlds import build_city, build_forest, build_scene, build_terrain
from volery.scenario.schema import Scenario
from volery.world.city import City
from volery.world.forest import Forest
from volery.world.scene import Scene
from volery.world.world_scenes import WorldScenes


class EnvironmentWorld(NamedTuple):
    """One world, and the starts of the UAVs of one environment there."""

    city: City | None
    """Buildings and streets; None: there are none."""
    forest: Forest | None
    """Trees; None: there are none."""
    scene: Scene
    starts: tuple[StartPose, ...]


class EnvironmentWorlds:
    """The worlds of a scenario with the `seeds` (W,), built when they are first used.

    They share the ground. Raises `ScenarioError` if there is none, or the first cannot be built.
    """

    def __init__(self, scenario: Scenario, seeds: Sequence[int]) -> None:
        if not len(seeds):
            raise ScenarioError("worlds: at least one seed is needed")
        self._scenarios = [scenario.with_(world={"seed": int(seed)}) for seed in seeds]
        self.terrain = build_terrain(scenario)
        """Ground of all worlds."""
        self._built: dict[int, EnvironmentWorld] = {}
        self._start_states: dict[tuple[int, bool], dict[str, Any]] = {}
        self.scene: Scene = (
            self.world(0).scene
            if len(seeds) == 1
            else WorldScenes(len(seeds), lambda number: self.world(number).scene)
        )
        """Surfaces of all worlds."""

    def world(self, number: int) -> EnvironmentWorld:
        """Returns a world. Raises `ScenarioError` if it cannot be built."""
        if number not in self._built:
            scenario = self._scenarios[number]
            city = build_city(scenario, self.terrain)
            forest = build_forest(scenario, self.terrain, city)
            scene = build_scene(scenario, self.terrain, forest, city)
            starts = place_fleet(scenario, scene, self.terrain)
            self._built[number] = EnvironmentWorld(city, forest, scene, starts)
        return self._built[number]

    def has_own_start(self, number: int) -> bool:
        """Returns whether UAVs start elsewhere than in the first world."""
        return number > 0 and _differ(self.world(number).starts, self.world(0).starts)

    def dealt(self, first: int, count: int) -> NDArray[np.int64]:
        """Returns the worlds (count,) in which the environments `first`, ... begin, in turn."""
        return np.arange(first, first + count) % len(self._scenarios)

    def start_state(self, world: int, *, takes_off: bool) -> dict[str, Any]:
        """Returns the state at step 0 of the fleet of one environment in a world.

        takes_off: whether the UAVs that start with a take-off have its command.
        """
        key = world, takes_off
        if key not in self._start_states:
            starts, scenario = self.world(world).starts, self._scenarios[world]
            fleet = build_fleet(scenario, starts, [start.name for start in starts])
            for row, start in enumerate(starts):
                if takes_off and start.takes_off:
                    take_off(fleet, row, start, scenario)
            self._start_states[key] = fleet.get_state()
        return self._start_states[key]


def take_off(fleet: Fleet, row: int, start: StartPose, scenario: Scenario) -> None:
    """Takes off with the UAV `row` to the altitude of its type."""
    fleet.take_off(row, scenario.types[start.type_name].flight.take_off_altitude_m)


def _differ(starts: Sequence[StartPose], others: Sequence[StartPose]) -> bool:
    return any(
        a.on_ground != b.on_ground or not np.array_equal(a.position_map, b.position_map)
        for a, b in zip(starts, others, strict=True)
    )
