"""Entities of the standard: the UAVs, what is known of them, and where they may be put."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.errors import PlacementError
from volery.graph.messages import Point, Pose, Quaternion, Twist, Vector3, header, message_type
from volery.runtime.services.filters import (
    BoundsType,
    Category,
    bounds_filter,
    name_filter,
    tag_filter,
)
from volery.runtime.services.offering import Code, Fields, RefusedError, filled, offer_result
from volery.runtime.uav import Uav
from volery.vehicle.body_shape import body_shape

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

Array = NDArray[np.float64]

_MSG = "simulation_interfaces/msg"
_SRV = "simulation_interfaces/srv"
_INVALID_POSE = 101
_FASTEST = 100.0
"""m/s or rad/s that can be set."""


class Entities:
    """Answers questions about the UAVs of a simulation, and moves them."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def offer(self) -> None:
        """Offer the services of entities."""
        graph = self._simulation.graph
        for name, srvtype, handler in (
            ("get_entities", "GetEntities", self._names),
            ("get_entities_states", "GetEntitiesStates", self._states),
            ("get_entity_state", "GetEntityState", self._state),
            ("get_entity_info", "GetEntityInfo", self._info),
            ("get_entity_bounds", "GetEntityBounds", self._bounds),
            ("set_entity_state", "SetEntityState", self._set_state),
        ):
            offer_result(graph, f"/{name}", f"{_SRV}/{srvtype}", handler)

    # ---------------------------------------------------------------------------------- questions

    def _names(self, request: Any) -> Fields:
        return {"entities": self._chosen(request.filters)}

    def _states(self, request: Any) -> Fields:
        names = self._chosen(request.filters)
        uavs = self._simulation.uavs
        return {"entities": names, "states": [self._state_of(uavs[name]) for name in names]}

    def _state(self, request: Any) -> Fields:
        return {"state": self._state_of(self._find(request.entity))}

    def _info(self, request: Any) -> Fields:
        uav = self._find(request.entity)
        kind = self._simulation.types[uav.type_name]
        category = filled(f"{_MSG}/EntityCategory", {"category": int(Category.ROBOT)})
        info = {
            "category": category,
            "description": f"UAV of type {uav.type_name}: {kind.airframe}, {kind.plant}",
            "tags": tags_of(uav),
        }
        return {"info": filled(f"{_MSG}/EntityInfo", info)}

    def _bounds(self, request: Any) -> Fields:
        shape = body_shape(self._find(request.entity).airframe)
        corners = np.vstack([mesh.vertices for mesh, _material in shape.parts])
        points = [_vector(corners.max(axis=0)), _vector(corners.min(axis=0))]
        return {"bounds": filled(f"{_MSG}/Bounds", {"type": BoundsType.BOX, "points": points})}

    def _chosen(self, filters: Any) -> list[str]:
        """Names of the UAVs that pass all filters, in fleet order."""
        is_named, is_tagged = name_filter(filters.filter), tag_filter(filters.tags)
        is_inside = bounds_filter(filters.bounds)
        categories = {int(c.category) for c in filters.categories}
        if categories and Category.ROBOT not in categories:
            return []
        return [
            name
            for name, uav in self._simulation.uavs.items()
            if is_named(name)
            and is_tagged(tags_of(uav))
            and is_inside(uav.position_map, uav.airframe.body.collision_radius_m)
        ]

    def _state_of(self, uav: Uav) -> Any:
        attitude = uav.attitude
        turn, spin = (
            rotations.rotate(attitude, v) for v in (uav.omega_body, uav.angular_acceleration_body)
        )
        accel = message_type("geometry_msgs/msg/Accel")
        state = {
            "header": header(self._simulation.time_ns, "map"),
            "pose": pose_message(uav.position_map, attitude),
            "twist": Twist(_vector(uav.velocity_map), _vector(turn)),
            "acceleration": accel(_vector(uav.acceleration_map), _vector(spin)),
        }
        return filled(f"{_MSG}/EntityState", state)

    def _find(self, name: str) -> Uav:
        uav = self._simulation.uavs.get(name)
        if uav is None:
            raise RefusedError(Code.NOT_FOUND, f"there is no entity '{name}'")
        return uav

    # ------------------------------------------------------------------------------------ changes

    def _set_state(self, request: Any) -> None:
        uav, state = self._find(request.entity), request.state
        if state.header.frame_id not in ("", "map"):
            reason = f"states are set in 'map', not in '{state.header.frame_id}'"
            raise RefusedError(Code.OPERATION_FAILED, reason)
        if request.set_acceleration:
            reason = "accelerations follow from forces and cannot be set"
            raise RefusedError(Code.FEATURE_UNSUPPORTED, reason)
        if not (request.set_pose or request.set_twist):
            raise RefusedError(
                Code.OPERATION_FAILED, "nothing to set: set_pose or set_twist must be true"
            )
        if request.set_twist:
            twist = [_numbers(state.twist.linear), _numbers(state.twist.angular)]
            if not np.isfinite(twist).all() or np.abs(twist).max() > _FASTEST:
                reason = f"a twist is up to {_FASTEST:g} m/s or rad/s"
                raise RefusedError(Code.OPERATION_FAILED, reason)
        if request.set_pose:
            self._place(uav.name, state.pose)
        if request.set_twist:
            self._simulation.push_uav(uav.name, *twist)

    def _place(self, name: str, pose: Any) -> None:
        turn = pose.orientation
        try:
            attitude = [turn.x, turn.y, turn.z, turn.w]
            self._simulation.place_uav(name, _numbers(pose.position), attitude)
        except PlacementError as error:
            raise RefusedError(_INVALID_POSE, str(error)) from None


def tags_of(uav: Uav) -> list[str]:
    """What a UAV can be found by: `uav`, its type in the scenario, its airframe."""
    return list(dict.fromkeys(["uav", uav.type_name, uav.airframe.name]))


def pose_message(position: Array, attitude: Array) -> Pose:
    """Pose of (3,) m and (4,) x y z w."""
    return Pose(Point(*position.tolist()), Quaternion(*attitude.tolist()))


def _vector(values: Array) -> Vector3:
    x, y, z = (float(v) for v in values)
    return Vector3(x, y, z)


def _numbers(message: Any) -> list[float]:
    return [message.x, message.y, message.z]
