"""Connects the autopilot to a UAV of the graph.

All commands are service calls: they are processed in order, and a refusal is reported.
"""

from __future__ import annotations

import json
import math
from typing import Any

from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Point, Quaternion, Vector3
from volery.graph.nodes.node import Node
from volery.mavlink.autopilot.vehicle import FlightState, Vector, VehicleInfo
from volery.mavlink.autopilot.vehicle import Quaternion as Turn

_TRIGGER = "std_srvs/srv/Trigger"
_TAKE_OFF_TO = "volery_interfaces/srv/TakeOffTo"
_GET_VEHICLE_INFO = "volery_interfaces/srv/GetVehicleInfo"
_LANDING_SPEED = "volery_interfaces/srv/SetLandingSpeed"
_GO_TO = "volery_interfaces/srv/GoTo"
_SET_TARGET = "volery_interfaces/srv/SetPositionTarget"
_SET_ATTITUDE = "volery_interfaces/srv/SetAttitudeTarget"
_INJECT = "volery_interfaces/srv/InjectFault"
_END_FAULT = "volery_interfaces/srv/EndFault"
_TARGET = "mavros_msgs/msg/PositionTarget"
_ATTITUDE = "mavros_msgs/msg/AttitudeTarget"
_NO_POSITION, _NO_VELOCITY, _NO_PUSH = 7, 7 << 3, 7 << 6
_NO_YAW, _NO_YAW_RATE = 1024, 2048
_NO_RATES, _NO_ATTITUDE = 7, 128
_NOTHING = (0.0, 0.0, 0.0)


class GraphVehicle:
    """Commands the UAV in whose namespace `node` runs."""

    def __init__(self, node: Node) -> None:
        self._target = node.create_client(_SET_TARGET, "set_position_target")
        self._attitude = node.create_client(_SET_ATTITUDE, "set_attitude_target")
        self._clients = {
            name: node.create_client(_TRIGGER, name) for name in ("hold", "land", "kill")
        }
        self._take_off = node.create_client(_TAKE_OFF_TO, "take_off_to")
        self._sink = node.create_client(_LANDING_SPEED, "set_landing_speed")
        self._inject = node.create_client(_INJECT, "/volery/inject_fault")
        self._end_fault = node.create_client(_END_FAULT, "/volery/end_fault")
        self._uav = node.get_namespace().strip("/")
        self._go_to = node.create_client(_GO_TO, "go_to")

    def take_off(self, height_m: float) -> str:
        """Implements `Vehicle.take_off`."""
        request = zero_message(f"{_TAKE_OFF_TO}_Request")
        request.altitude = height_m
        return _call(self._take_off, request)

    def hold(self) -> str:
        """Implements `Vehicle.hold`."""
        return _call(self._clients["hold"])

    def land(self) -> str:
        """Implements `Vehicle.land`."""
        return _call(self._clients["land"])

    def sink(self, speed: float) -> str:
        """Implements `Vehicle.sink`."""
        request = zero_message(f"{_LANDING_SPEED}_Request")
        request.speed = speed
        return _call(self._sink, request)

    def stop(self) -> str:
        """Implements `Vehicle.stop`."""
        return _call(self._clients["kill"])

    def go_to(self, position: Vector, yaw: float | None) -> str:
        """Implements `Vehicle.go_to`."""
        request = zero_message(f"{_GO_TO}_Request")
        request.position = Point(*position)
        request.yaw, request.keep_heading = yaw or 0.0, yaw is None
        return _call(self._go_to, request)

    def steer(self, velocity: Vector, yaw: float | None, yaw_rate: float) -> None:
        """Implements `Vehicle.steer`."""
        self._steer(_NO_POSITION | _NO_PUSH, _NOTHING, velocity, _NOTHING, yaw, yaw_rate)

    def follow(
        self,
        position: Vector,
        velocity: Vector,
        acceleration: Vector,
        yaw: float | None,
        yaw_rate: float,
    ) -> None:
        """Implements `Vehicle.follow`."""
        self._steer(0, position, velocity, acceleration, yaw, yaw_rate)

    def push(self, acceleration: Vector, yaw: float | None, yaw_rate: float) -> None:
        """Implements `Vehicle.push`."""
        self._steer(_NO_POSITION | _NO_VELOCITY, _NOTHING, _NOTHING, acceleration, yaw, yaw_rate)

    def tilt(self, attitude: Turn, thrust: float) -> None:
        """Implements `Vehicle.tilt`."""
        message = zero_message(_ATTITUDE)
        message.type_mask = _NO_RATES
        message.orientation, message.thrust = Quaternion(*attitude), thrust
        self._turn(message)

    def spin(self, rates: Vector, thrust: float) -> None:
        """Implements `Vehicle.spin`."""
        message = zero_message(_ATTITUDE)
        message.type_mask = _NO_ATTITUDE
        message.body_rate, message.thrust = Vector3(*rates), thrust
        self._turn(message)

    def fail(self, fault: dict[str, Any]) -> str:
        """Implements `Vehicle.fail`."""
        request = zero_message(f"{_INJECT}_Request")
        request.fault = json.dumps({**fault, "uav": self._uav})
        return _call(self._inject, request)

    def end_fault(self, fault: dict[str, Any]) -> str:
        """Implements `Vehicle.end_fault`."""
        request = zero_message(f"{_END_FAULT}_Request")
        request.fault = json.dumps({**fault, "uav": self._uav})
        return _call(self._end_fault, request)

    def _steer(
        self,
        mask: int,
        position: Vector,
        velocity: Vector,
        acceleration: Vector,
        yaw: float | None,
        yaw_rate: float,
    ) -> None:
        message = zero_message(_TARGET)
        message.coordinate_frame = 1
        message.type_mask = mask | (_NO_YAW if yaw is None else _NO_YAW_RATE)
        message.position, message.velocity = Point(*position), Vector3(*velocity)
        message.acceleration_or_force = Vector3(*acceleration)
        message.yaw, message.yaw_rate = yaw or 0.0, yaw_rate
        request = zero_message(f"{_SET_TARGET}_Request")
        request.target = message
        _call(self._target, request)

    def _turn(self, message: Any) -> None:
        request = zero_message(f"{_SET_ATTITUDE}_Request")
        request.target = message
        _call(self._attitude, request)


def _call(client: Any, request: Any = None) -> str:
    """Calls a service; returns why it failed, empty on success."""
    try:
        response = client.call(request)
    except GraphError as error:
        return str(error)
    return "" if response.success else str(response.message) or "refused"


def build_of(node: Node) -> VehicleInfo:
    """Returns the constant properties of the UAV. Raises `GraphError` if the service fails."""
    info = node.create_client(_GET_VEHICLE_INFO, "get_vehicle_info").call()
    if not info.success:
        raise GraphError(info.message)
    return VehicleInfo(
        info.airframe,
        info.rotors,
        info.hover_thrust,
        info.speed,
        info.climb,
        info.descent,
        info.tilt,
        info.battery_cells,
        info.battery_capacity,
        (info.latitude, info.longitude, info.altitude),
    )


def state_of(message: Any) -> FlightState:
    """Converts a FlightState message."""
    stamp, pose = message.header.stamp, message.pose
    position, turn = pose.position, pose.orientation
    v, w, a = message.velocity, message.angular_velocity, message.acceleration
    has_battery = math.isfinite(message.battery_charge)
    return FlightState(
        stamp.sec * 1_000_000_000 + stamp.nanosec,
        message.mode,
        message.airborne,
        message.crashed,
        (position.x, position.y, position.z),
        (turn.x, turn.y, turn.z, turn.w),
        (v.x, v.y, v.z),
        (w.x, w.y, w.z),
        (a.x, a.y, a.z),
        float(message.battery_charge),
        float(message.battery_voltage) if has_battery else math.nan,
        float(message.battery_current) if has_battery else math.nan,
        tuple(message.rotors.tolist()),
    )
