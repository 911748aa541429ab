"""Describes an entity of the standard: a UAV or an actor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.runtime.services.filters import Category
from volery.runtime.vehicles.uav import Uav
from volery.scenario.schema import UavType
from volery.vehicle.body_shape import body_shape
from volery.world.actors import MovingActor, MovingActors
from volery.world.scene_content import BodyShape

_CATEGORIES = {"person": Category.HUMAN}
"""Categories of actor kinds; all others are dynamic objects."""


@dataclass(frozen=True, eq=False)
class Entity:
    """Describes one entity at the present time; vectors are in the map frame, SI units."""

    name: str
    category: Category
    description: str
    tags: tuple[str, ...]
    make_shape: Callable[[], BodyShape]
    """Returns the surface in the body frame; takes half a millisecond for a UAV."""
    radius_m: float
    """Radius of the entity's bounding ball, m."""
    position: Array
    attitude: Array
    velocity: Array
    omega: Array
    acceleration: Array
    angular_acceleration: Array


def entity_of_uav(uav: Uav, types: Mapping[str, UavType]) -> Entity:
    """Returns a UAV as an entity."""
    kind = types[uav.type_name]
    turn, spin = (
        rotations.rotate(uav.attitude, v) for v in (uav.omega_body, uav.angular_acceleration_body)
    )
    return Entity(
        name=uav.name,
        category=Category.ROBOT,
        description=f"UAV of type {uav.type_name}: {kind.airframe}, {kind.plant}",
        tags=tuple(dict.fromkeys(["uav", uav.type_name, uav.airframe.name])),
        make_shape=partial(body_shape, uav.airframe),
        radius_m=uav.airframe.body.collision_radius_m,
        position=uav.position_map,
        attitude=uav.attitude,
        velocity=uav.velocity_map,
        omega=turn,
        acceleration=uav.acceleration_map,
        angular_acceleration=spin,
    )


def entities_of_actors(actors: MovingActors | None, time_ns: int) -> Iterator[Entity]:
    """Yields all actors as entities, in order."""
    if actors is None:
        return
    poses, still = actors.poses_at(time_ns), np.zeros(3)
    for row, actor in enumerate(actors.actors):
        yield Entity(
            name=actor.name,
            category=_CATEGORIES.get(actor.kind, Category.DYNAMIC_OBJECT),
            description=f"actor of kind {actor.kind}",
            tags=("actor", actor.kind, *actor.tags),
            make_shape=partial(_shape_of, actor),
            radius_m=actor.shape.radius,
            position=poses[row, :3],
            attitude=poses[row, 3:],
            velocity=actors.velocity_at(row, time_ns),
            omega=still,
            acceleration=still,
            angular_acceleration=still,
        )


def _shape_of(actor: MovingActor) -> BodyShape:
    return actor.shape
