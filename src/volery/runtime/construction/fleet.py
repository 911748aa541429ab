"""Builds the fleet and the bodies of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.control.gains import ControlRates
from volery.core.errors import CommandError, DataFileError, ScenarioError
from volery.core.plurals import counted
from volery.runtime.construction.placement import StartPose, place_uavs
from volery.runtime.construction.worlds import build_weather
from volery.scenario.schema import Scenario
from volery.vehicle.airframe import Airframe, load_airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.identified import load_identified
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import Plant, RigidBody
from volery.world.scene import Scene
from volery.world.terrain import Terrain


def place_fleet(scenario: Scenario, scene: Scene, terrain: Terrain) -> tuple[StartPose, ...]:
    """Returns the start pose of every UAV. Raises `ScenarioError` for invalid ones."""
    return place_uavs(scenario, airframes_of(scenario), scene, terrain)


def check_types(scenario: Scenario) -> None:
    """Raises `ScenarioError` if UAVs of some type cannot be built, in any world."""
    for name, airframe in airframes_of(scenario).items():
        plant_of_type(scenario, name, airframe)


def airframes_of(scenario: Scenario) -> dict[str, Airframe]:
    """Returns the airframe of each type. Raises `ScenarioError` if it, or its wear, is invalid."""
    airframes: dict[str, Airframe] = {}
    for name, kind in scenario.types.items():
        try:
            airframes[name] = load_airframe(scenario.access.find_model(kind.airframe))
        except DataFileError as error:
            key = f"{scenario.name}: types.{name}.airframe"
            raise DataFileError(f"{key}: {error}") from None
        rotors = len(airframes[name].rotors.places)
        if kind.wear and kind.plant != "rigid_body":
            raise ScenarioError(
                f'{scenario.name}: types.{name}.wear: rotors wear with plant = "rigid_body" alone'
            )
        if len(kind.wear) not in (0, rotors):
            raise ScenarioError(
                f"{scenario.name}: types.{name}.wear has "
                f"{counted(len(kind.wear), 'entry', 'entries')}; {kind.airframe} "
                f"has {rotors} rotors, and needs one for each, or none"
            )
    return airframes


def build_fleet(
    scenario: Scenario, starts: Sequence[StartPose], names: Sequence[str], *, num_envs: int = 1
) -> Fleet:
    """Returns the fleet at its start in the scenario's weather, with `names` in messages.

    `num_envs` is the number of environments in `starts`, one after the other.
    """
    physics = scenario.physics
    fleet = Fleet(
        [start.airframe for start in starts],
        np.array([start.position_map for start in starts]),
        np.array([start.attitude for start in starts]),
        dt_ns=1_000_000_000 // scenario.physics.rate_hz,
        on_contact=scenario.physics.on_contact,
        control=ControlRates(physics.guidance_rate_hz, max(250.0, physics.guidance_rate_hz)),
        names=names,
        mode=[FlightMode.LANDED if start.on_ground else FlightMode.HOLD for start in starts],
        plants=[plant_of_type(scenario, start.type_name, start.airframe) for start in starts],
        wear=[scenario.types[start.type_name].wear for start in starts],
        battery_charge=[scenario.types[start.type_name].battery_charge for start in starts],
        weather=build_weather(scenario),
        seed=scenario.seed,
        copies=np.repeat(np.arange(num_envs), len(starts) // num_envs),
    )
    for row, start in enumerate(starts):
        flight = scenario.types[start.type_name].flight
        fleet.set_command_timeout(flight.command_timeout_s, row)
        if start.at_rest:
            fleet.rest(row)
    return fleet


def check_free(fleet: Fleet, row: int, position_map: NDArray[np.float64]) -> None:
    """Raises `CommandError` if another UAV is too near to `position_map` (3,), m, for UAV `row`."""
    radius = np.array([airframe.body.collision_radius_m for airframe in fleet.airframes])
    apart = np.linalg.norm(fleet.state.position_map - position_map, axis=1)
    apart[row] = np.inf
    nearest = int(np.argmin(apart - radius))
    if apart[nearest] < radius[nearest] + radius[row]:
        raise CommandError(
            f"{fleet.names[row]} cannot go back to its start: {fleet.names[nearest]} is there"
        )


def add_bodies(scene: Scene, starts: Sequence[StartPose], *, num_envs: int = 1) -> None:
    """Makes the UAVs' bodies visible to the sensors of their own environment."""
    kinds: list[Airframe] = []
    for start in starts:
        if start.airframe not in kinds:  # files may give two airframes one name
            kinds.append(start.airframe)
    scene.set_bodies(
        [body_shape(airframe) for airframe in kinds],
        [kinds.index(start.airframe) for start in starts],
        num_envs=num_envs,
    )


def plant_of_type(scenario: Scenario, type_name: str, airframe: Airframe) -> Plant:
    """Returns the plant of a type. Raises `DataFileError` if its model is missing or invalid."""
    kind = scenario.types[type_name]
    if kind.plant == "rigid_body":
        return RigidBody()
    if kind.plant == "kinematic":
        return Kinematic(kind.kinematic.time_constant_s, kind.kinematic.limited)
    try:
        return load_identified(scenario.access.find_model(kind.identified_model or airframe.name))
    except DataFileError as error:
        key = f"{scenario.name}: types.{type_name}.identified_model"
        raise DataFileError(f"{key}: {error}") from None
