"""Serves the entities of the standard, UAVs and actors: states, properties, teleports."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import PlacementError
from volery.graph.graph import Graph
from volery.graph.messages import (
    Point,
    Pose,
    Quaternion,
    Twist,
    Vector3,
    frame_of,
    header,
    message_type,
)
from volery.runtime.facets.vehicles import SimulationVehicles
from volery.runtime.facets.world import SimulationWorld
from volery.runtime.services.entity_views import Entity, entities_of_actors, entity_of_uav
from volery.runtime.services.filters import (
    BoundsType,
    Category,
    bounds_filter,
    name_filter,
    tag_filter,
)
from volery.runtime.services.results import Fields, RefusedError, ResultCode, filled, offer_result
from volery.runtime.vehicles.uav import Uav

_MSG = "simulation_interfaces/msg"
_SRV = "simulation_interfaces/srv"
_INVALID_POSE = 101
_MAX_TWIST = 100.0
"""Max speed that can be set, m/s or rad/s."""


class Entities:
    """Serves the states and properties of UAVs and actors, and moves them."""

    def __init__(
        self,
        graph: Graph,
        uavs: Mapping[str, Uav],
        vehicles: SimulationVehicles,
        world: SimulationWorld,
    ) -> None:
        self._graph = graph
        self._uavs = uavs
        self._vehicles = vehicles
        self._world = world

    def offer(self) -> None:
        """Creates the services for entities."""
        for name, srvtype, handler in (
            ("get_entities", "GetEntities", self._names),
            ("get_entities_states", "GetEntitiesStates", self._states),
            ("get_entity_state", "GetEntityState", self._state),
            ("get_entity_info", "GetEntityInfo", self._info),
            ("get_entity_bounds", "GetEntityBounds", self._bounds),
            ("set_entity_state", "SetEntityState", self._set_state),
        ):
            offer_result(self._graph, f"/{name}", f"{_SRV}/{srvtype}", handler)

    # ------------------------------------------------------------------------------------ queries

    def _names(self, request: Any) -> Fields:
        return {"entities": [entity.name for entity in self._chosen(request.filters)]}

    def _states(self, request: Any) -> Fields:
        chosen = self._chosen(request.filters)
        states = [self._state_of(entity) for entity in chosen]
        return {"entities": [entity.name for entity in chosen], "states": states}

    def _state(self, request: Any) -> Fields:
        return {"state": self._state_of(self._find(request.entity))}

    def _info(self, request: Any) -> Fields:
        entity = self._find(request.entity)
        category = filled(f"{_MSG}/EntityCategory", {"category": int(entity.category)})
        info = {
            "category": category,
            "description": entity.description,
            "tags": list(entity.tags),
        }
        return {"info": filled(f"{_MSG}/EntityInfo", info)}

    def _bounds(self, request: Any) -> Fields:
        shape = self._find(request.entity).make_shape()
        corners = np.vstack([mesh.vertices for mesh, _material in shape.parts])
        points = [_vector(corners.max(axis=0)), _vector(corners.min(axis=0))]
        return {"bounds": filled(f"{_MSG}/Bounds", {"type": BoundsType.BOX, "points": points})}

    def _all(self) -> Iterator[Entity]:
        """Yields UAVs in fleet order, then actors."""
        for uav in self._uavs.values():
            yield entity_of_uav(uav, self._vehicles.types)
        yield from entities_of_actors(self._world.actors, self._graph.now_ns())

    def _chosen(self, filters: Any) -> list[Entity]:
        """Returns the entities that pass all filters."""
        is_named, is_tagged = name_filter(filters.filter), tag_filter(filters.tags)
        is_inside = bounds_filter(filters.bounds)
        categories = {int(c.category) for c in filters.categories}
        return [
            entity
            for entity in self._all()
            if (not categories or entity.category in categories)
            and is_named(entity.name)
            and is_tagged(entity.tags)
            and is_inside(entity.position, entity.radius_m)
        ]

    def _state_of(self, entity: Entity) -> Any:
        accel = message_type("geometry_msgs/msg/Accel")
        state = {
            "header": header(self._graph.now_ns(), "map"),
            "pose": pose_message(entity.position, entity.attitude),
            "twist": Twist(_vector(entity.velocity), _vector(entity.omega)),
            "acceleration": accel(
                _vector(entity.acceleration), _vector(entity.angular_acceleration)
            ),
        }
        return filled(f"{_MSG}/EntityState", state)

    def _find(self, name: str) -> Entity:
        found = next((entity for entity in self._all() if entity.name == name), None)
        if found is None:
            raise RefusedError(ResultCode.NOT_FOUND, f"there is no entity '{name}'")
        return found

    # ------------------------------------------------------------------------------------ changes

    def _set_state(self, request: Any) -> None:
        entity, state = self._find(request.entity), request.state
        if frame_of(state) not in ("", "map"):
            reason = f"states are set in 'map', not in '{frame_of(state)}'"
            raise RefusedError(ResultCode.OPERATION_FAILED, reason)
        if request.set_acceleration:
            reason = "accelerations follow from forces and cannot be set"
            raise RefusedError(ResultCode.FEATURE_UNSUPPORTED, reason)
        if not (request.set_pose or request.set_twist):
            raise RefusedError(
                ResultCode.OPERATION_FAILED, "nothing to set: set_pose or set_twist must be true"
            )
        if request.set_twist:
            twist = [_numbers(state.twist.linear), _numbers(state.twist.angular)]
            if not np.isfinite(twist).all() or np.abs(twist).max() > _MAX_TWIST:
                reason = f"a twist is up to {_MAX_TWIST:g} m/s or rad/s"
                raise RefusedError(ResultCode.OPERATION_FAILED, reason)
        if entity.category is not Category.ROBOT:
            self._set_actor(entity, request)
            return
        if request.set_pose:
            self._set_pose(entity.name, state.pose)
        if request.set_twist:
            self._vehicles.set_velocity(entity.name, *twist)

    def _set_actor(self, entity: Entity, request: Any) -> None:
        position, attitude = entity.position, entity.attitude
        velocity = np.zeros(3)
        if request.set_pose:
            pose = request.state.pose
            turn = pose.orientation
            position = np.array(_numbers(pose.position))
            attitude = np.array([turn.x, turn.y, turn.z, turn.w])
        if request.set_twist:
            if any(_numbers(request.state.twist.angular)):
                raise RefusedError(ResultCode.FEATURE_UNSUPPORTED, "actors do not turn by a twist")
            velocity = np.array(_numbers(request.state.twist.linear))
        self._world.set_actor_pose(entity.name, position, attitude, velocity)

    def _set_pose(self, name: str, pose: Any) -> None:
        turn = pose.orientation
        try:
            attitude = [turn.x, turn.y, turn.z, turn.w]
            self._vehicles.set_pose(name, _numbers(pose.position), attitude)
        except PlacementError as error:
            raise RefusedError(_INVALID_POSE, str(error)) from None


def pose_message(position: Array, attitude: Array) -> Pose:
    """Returns a Pose from (3,), m, and (4,), x y z w."""
    return Pose(Point(*position.tolist()), Quaternion(*attitude.tolist()))


def _vector(values: Array) -> Vector3:
    x, y, z = (float(v) for v in values)
    return Vector3(x, y, z)


def _numbers(message: Any) -> list[float]:
    return [message.x, message.y, message.z]
