"""Builds the plant of each UAV type."""

from __future__ import annotations

from volery.core.errors import DataFileError
from volery.scenario.schema import Scenario
from volery.vehicle.airframe import Airframe
from volery.vehicle.identified import load_identified
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import Plant, RigidBody


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
