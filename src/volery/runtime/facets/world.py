"""The world of a simulation: terrain, trees, city, grid map, actors and weather."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from volery.control.setpoints import checked, checked_attitude
from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.engine.engine import Engine
from volery.graph.graph import Graph
from volery.runtime.construction.worlds import BuiltWorld
from volery.runtime.grid_map_manager import GridMapManager
from volery.runtime.services.weather_messages import WeatherTopics
from volery.scenario.schema import World
from volery.world.actors import MovingActors
from volery.world.city import City
from volery.world.forest import Forest
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.weather import Weather

_MAX_POSITION_M, _MAX_SPEED_M_S = 1e5, 100.0
"""Limits of poses and velocities of actors."""


class SimulationWorld:
    """Describes the world of a simulation, and changes what moves in it.

    settings: the world of the scenario. check_open: raises `CommandError` once the simulation is
    closed.
    """

    terrain: Terrain
    """Ground."""
    city: City | None
    """Buildings and streets; None: there are none."""
    forest: Forest | None
    """Trees; None: there are none."""
    scene: Scene
    """Surfaces that rays hit and UAVs touch."""

    def __init__(
        self,
        settings: World,
        built: BuiltWorld,
        grid_map: GridMapManager,
        engine: Engine,
        graph: Graph,
        check_open: Callable[[], None],
    ) -> None:
        self.terrain, self.city, self.forest, self.scene = built
        self.grid_map = grid_map
        """The grid map of the world, and its changes."""
        self._settings = settings
        self._engine = engine
        self._check_open = check_open
        self._topics = WeatherTopics(graph, settings, lambda: self.weather, self.set_weather)
        self._topics.publish(self.weather)

    def __repr__(self) -> str:
        parts = []
        if self._settings.grid_map is not None:
            parts.append("grid map")
        if self._settings.meshes:
            parts.append(counted(len(self._settings.meshes), "mesh", "meshes"))
        if self.forest is not None:
            parts.append(counted(len(self.forest), "tree"))
        if self.city is not None:
            parts.append(counted(len(self.city.buildings), "building"))
        if self.actors is not None:
            parts.append(counted(len(self.actors.names), "actor"))
        ground = "open ground" if self._settings.terrain.kind == "flat" else "terrain"
        return f"<world: {', '.join(parts) or ground}>"

    @property
    def weather(self) -> Weather:
        """Wind, precipitation, fog, dust and hour of the day."""
        return self._engine.fleet.weather

    def set_weather(self, weather: Weather) -> None:
        """Changes the weather, from the next guidance tick and the next measurement on."""
        self._engine.set_weather(weather)
        self._topics.publish(weather)

    def gust_now(
        self, amplitude_map: tuple[float, float, float], rise_s: float, lasts_s: float = math.inf
    ) -> None:
        """Starts a 1-cosine gust of `amplitude_map` (3,) m/s that ends after `lasts_s`."""
        self._check_open()
        self._engine.gust_now(amplitude_map, rise_s, lasts_s)
        self._topics.publish(self.weather)

    @property
    def actors(self) -> MovingActors | None:
        """People, vehicles and birds of the scenario; None: there are none."""
        return self.scene.actors

    def set_actor_pose(
        self,
        name: str,
        position_map: ArrayLike,
        attitude: ArrayLike | None = None,
        velocity_map: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Moves an external actor to (3,) m with (4,) x y z w, map from body.

        The actor moves on at `velocity_map` (3,) m/s; without an attitude it keeps its own. Raises
        `CommandError` for an unknown actor, one with a motion of its own, or a bad pose.
        """
        self._check_open()
        if self.actors is None or name not in self.actors.names:
            known = "none" if self.actors is None else ", ".join(self.actors.names)
            raise CommandError(f"there is no actor '{name}'; known: {known}")
        row = self.actors.names.index(name)
        if attitude is None:
            attitude = self.actors.poses_at(self._engine.time_ns)[row, 3:]
        position = checked("position", position_map, (3,), _MAX_POSITION_M)
        velocity = checked("velocity", velocity_map, (3,), _MAX_SPEED_M_S)
        pose = np.concatenate([position, checked_attitude(attitude)])
        self._engine.set_actor_pose(row, pose, velocity)
