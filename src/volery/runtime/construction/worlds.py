"""Builds terrain, forest, city, solids and weather of a scenario."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from volery.core.errors import DataFileError, ScenarioError, VoleryError
from volery.core.geodesy import LocalFrame
from volery.core.plurals import counted
from volery.runtime.construction.actors import build_actors
from volery.runtime.construction.geometry import Geometry
from volery.runtime.construction.grid_map import starting_blocks
from volery.runtime.construction.user_meshes import mesh_solids
from volery.scenario import wind as schema
from volery.scenario.schema import (
    GridTerrain,
    InventoryForest,
    ProceduralForest,
    Scenario,
    World,
)
from volery.world.city import City, FurnitureRule, HeightRule, StreetRule
from volery.world.city import build_city as city_of_outlines
from volery.world.forest import Forest, forest_from_inventory, procedural_forest
from volery.world.forest_joining import joined
from volery.world.ground_cover import BARE_GROUND
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain
from volery.world.weather import (
    W20_M_S,
    Gust,
    LogProfile,
    Particles,
    PowerProfile,
    Weather,
    WindField,
)
from volery.world.weather.sun import sun_angles

if TYPE_CHECKING:
    from volery.sensors.cameras.weather_light import LightOfTheHour


def build_terrain(scenario: Scenario) -> Terrain:
    """Returns the ground of the scenario. Raises `DataFileError`."""
    terrain = scenario.world.terrain
    if isinstance(terrain, GridTerrain):
        try:
            path = scenario.access.find_file(terrain.file)
            return Terrain.from_csv(path, terrain.spacing_m, origin=terrain.origin_m)
        except DataFileError as error:
            raise DataFileError(f"{scenario.name}: world.terrain: {error}") from None
    extent_m = terrain.extent_m
    return Terrain.flat(2.0 * extent_m, terrain.height_m, origin=(-extent_m, -extent_m))


def build_city(scenario: Scenario, terrain: Terrain) -> City | None:
    """Returns the city of the scenario; None without one. Raises `DataFileError`."""
    city, origin = scenario.world.city, scenario.world.origin
    if city is None:
        return None
    streets = city.streets
    try:
        return city_of_outlines(
            scenario.access.find_file(city.file),
            LocalFrame.from_degrees(origin.latitude_deg, origin.longitude_deg, origin.altitude_m),
            terrain,
            seed=scenario.world_seed,
            region=city.region_m,
            heights=HeightRule(city.storey_m, city.default_height_m),
            streets=StreetRule(streets.max_width_m, streets.pavement_m),
            furniture=FurnitureRule(
                streets.lamp_spacing_m, streets.tree_spacing_m, streets.tree_fraction
            ),
        )
    except DataFileError as error:
        raise DataFileError(f"{scenario.name}: world.city: {error}") from None


def build_forest(scenario: Scenario, terrain: Terrain, city: City | None = None) -> Forest | None:
    """Returns the trees of the scenario, those of city streets last; None without a forest.

    Raises `ScenarioError` if the forest cannot grow, has no trees or exceeds the terrain.
    """
    try:
        forest = _grow(scenario, terrain)
    except VoleryError as error:
        raise ScenarioError(f"{scenario.name}: world.forest: {error}") from None
    if isinstance(scenario.world.forest, InventoryForest) and not forest:
        raise ScenarioError(f"{scenario.name}: world.forest: the inventory has no tree there")
    if forest:
        x0, y0, x1, y1 = terrain.bounds
        x, y = forest.position_map[:, 0], forest.position_map[:, 1]
        outside = int(((x < x0) | (x > x1) | (y < y0) | (y > y1)).sum())
        if outside:
            raise ScenarioError(
                f"{scenario.name}: world.forest: {counted(outside, 'tree')} beyond the "
                f"terrain, which extends from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m; "
                f"region_m crops an inventory{_shift_of(forest, scenario)}"
            )
    return joined(forest, _street_trees(scenario, terrain, city))


def _shift_of(forest: Forest, scenario: Scenario) -> str:
    """Returns advice for an inventory whose origin is far away; empty for others."""
    settings = scenario.world.forest
    low, high = forest.position_map[:, :2].min(axis=0), forest.position_map[:, :2].max(axis=0)
    middle = (low + high) / 2.0
    if not isinstance(settings, InventoryForest) or (abs(middle) <= high - low).all():
        return ""
    x, y = (middle - settings.position_m).tolist()
    return f", position_m = [{-x:.0f}, {-y:.0f}] moves its middle to the map's origin"


def _street_trees(scenario: Scenario, terrain: Terrain, city: City | None) -> Forest | None:
    settings = scenario.world.city
    if city is None or settings is None or not len(city.trees):
        return None
    species, seed = settings.streets.tree_species, scenario.world_seed
    try:
        return forest_from_inventory(city.trees, species=species, seed=seed, terrain=terrain)
    except VoleryError as error:
        raise ScenarioError(f"{scenario.name}: world.city.streets: {error}") from None


def _grow(scenario: Scenario, terrain: Terrain) -> Forest | None:
    forest = scenario.world.forest
    if isinstance(forest, InventoryForest):
        return forest_from_inventory(
            scenario.access.find_file(forest.file),
            position=forest.position_m,
            region=forest.region_m,
            fraction=forest.fraction,
            species=forest.species,
            species_map=forest.species_map,
            seed=scenario.world_seed,
            terrain=terrain,
        )
    if isinstance(forest, ProceduralForest):
        return procedural_forest(
            forest.region_m,
            trees=forest.trees,
            minimum_spacing_m=forest.minimum_spacing_m,
            species=forest.species,
            seed=scenario.world_seed,
            terrain=terrain,
        )
    return None


def build_solids(
    scenario: Scenario, terrain: Terrain, city: City | None = None
) -> tuple[Solid, ...]:
    """Returns all solids of the world except trees: buildings, meshes, grid-map blocks."""
    buildings = city.solids if city is not None else ()
    blocks = starting_blocks(scenario, terrain)  # last: they can change, others keep their index
    return (*buildings, *mesh_solids(scenario), *blocks)


def build_scene(
    scenario: Scenario,
    terrain: Terrain,
    forest: Forest | None,
    city: City | None = None,
    *,
    threads: int = 1,
) -> Scene:
    """Returns all that sensors can see except the UAVs."""
    scene = Scene(
        terrain,
        forest,
        solids=build_solids(scenario, terrain, city),
        cover=BARE_GROUND if city is None else city.cover,
        threads=threads,
    )
    actors = build_actors(scenario, terrain)
    if actors is not None:
        scene.set_actors(actors)
    return scene


class BuiltWorld(NamedTuple):
    """The static world of a scenario, and the scene that rays are cast into."""

    terrain: Terrain
    city: City | None
    forest: Forest | None
    scene: Scene


def build_world(scenario: Scenario, threads: int) -> BuiltWorld:
    """Returns the world of a scenario. Raises `ScenarioError`, `DataFileError`."""
    terrain = build_terrain(scenario)
    city = build_city(scenario, terrain)
    forest = build_forest(scenario, terrain, city)
    scene = build_scene(scenario, terrain, forest, city, threads=threads)
    return BuiltWorld(terrain, city, forest, scene)


def geometry_of(scenario: Scenario) -> Geometry:
    """Returns the geometry of a scenario's world at its start."""
    terrain = build_terrain(scenario)
    city = build_city(scenario, terrain)
    forest = build_forest(scenario, terrain, city)
    cover = BARE_GROUND if city is None else city.cover
    return Geometry(terrain, forest, tuple(build_solids(scenario, terrain, city)), cover)


def build_weather(scenario: Scenario) -> Weather:
    """Returns the weather of the scenario. Raises `DataFileError` if the wind field is invalid."""
    wind = scenario.world.wind
    return Weather(
        wind.velocity_m_s,
        _profile_of(wind),
        _read_field(scenario),
        W20_M_S[wind.turbulence] if wind.w20_m_s is None else wind.w20_m_s,
        tuple(_gust_of(gust, wind) for gust in wind.gusts),
        _particles_of(scenario),
        scenario.world.light.hour_of_day,
    )


def sun_in(world: World, weather: Weather) -> tuple[float, float]:
    """Returns the sun's elevation and azimuth in a weather, deg."""
    if weather.hour_of_day is None:
        return world.light.sun_elevation_deg, world.light.sun_azimuth_deg
    return sun_angles(world.origin.latitude_deg, world.light.date, weather.hour_of_day)


def light_of(world: World) -> LightOfTheHour:
    """Returns the light for cameras, by weather and hour."""
    from volery.sensors.cameras.weather_light import LightOfTheHour

    return LightOfTheHour(partial(sun_in, world), world.light.visibility_m)


def _particles_of(scenario: Scenario) -> Particles:
    given = scenario.world.weather
    return Particles(**{k: v for k, v in given.model_dump().items() if v is not None})


def _profile_of(wind: schema.Wind) -> LogProfile | PowerProfile | None:
    profile = wind.profile
    if isinstance(profile, schema.LogProfile):
        return LogProfile(profile.reference_height_m, profile.roughness_m)
    if isinstance(profile, schema.PowerProfile):
        return PowerProfile(profile.reference_height_m, profile.exponent)
    return None


def _read_field(scenario: Scenario) -> WindField | None:
    name = scenario.world.wind.field
    if name is None:
        return None
    try:
        return WindField.from_file(scenario.access.find_file(name))
    except DataFileError as error:
        raise DataFileError(f"{scenario.name}: world.wind.field: {error}") from None


def _gust_of(gust: schema.Gust, wind: schema.Wind) -> Gust:
    end_s = math.inf if gust.end_s is None else gust.end_s
    if gust.rise_m is None:
        return Gust(gust.amplitude_m_s, gust.start_s, gust.rise_s or 0.0, end_s)
    rise_s = gust.rise_m / wind.speed_m_s
    return Gust(gust.amplitude_m_s, gust.start_s, rise_s, end_s, wind.velocity_m_s)
