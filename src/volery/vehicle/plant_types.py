"""The plants of UAVs: models that turn commands into motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from volery.vehicle.identified import IdentifiedModel
from volery.vehicle.kinematic import Kinematic


@dataclass(frozen=True)
class RigidBody:
    """Rotors, air and a rigid body; all parameters follow from the airframe."""


Plant: TypeAlias = RigidBody | IdentifiedModel | Kinematic

RIGID_BODY, IDENTIFIED_LOOPS, KINEMATIC_MOTION = 0, 1, 2
"""Numbers of the plants in the kernels of the step."""


def kind_of(plant: Plant) -> int:
    """Returns the number of a plant."""
    if isinstance(plant, IdentifiedModel):
        return IDENTIFIED_LOOPS
    return KINEMATIC_MOTION if isinstance(plant, Kinematic) else RIGID_BODY
