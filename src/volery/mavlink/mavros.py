"""Offers MAVROS's topics and services for one autopilot, so that offboard programs run unchanged.

Names, types and frames are MAVROS's: ENU and FLU, positions from the autopilot's local origin.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.core.errors import CommandError
from volery.core.rotations import conjugate, heading_of, rotate
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import (
    BatteryState,
    NavSatFix,
    NavSatStatus,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Twist,
    TwistStamped,
    TwistWithCovariance,
    Vector3,
    header,
    message_type,
)
from volery.mavlink.autopilot.modes import mode_transitions, offboard
from volery.mavlink.autopilot.modes.modes import mode_named
from volery.mavlink.autopilot.modes.setpoints import OffboardSetpoint, from_body, from_heading
from volery.mavlink.autopilot.protocols import commands
from volery.mavlink.autopilot.protocols.command_protocol import Command
from volery.mavlink.autopilot.safety import arming

if TYPE_CHECKING:
    from volery.graph.nodes.node import Node
    from volery.mavlink.autopilot.context import AutopilotContext
    from volery.mavlink.autopilot.state import Source
    from volery.mavlink.autopilot.vehicle import Vector

_STATE, _EXTENDED = "mavros_msgs/msg/State", "mavros_msgs/msg/ExtendedState"
_TARGET, _ATTITUDE = "mavros_msgs/msg/PositionTarget", "mavros_msgs/msg/AttitudeTarget"
_BOOL, _MODE = "mavros_msgs/srv/CommandBool", "mavros_msgs/srv/SetMode"
_TOL, _LONG = "mavros_msgs/srv/CommandTOL", "mavros_msgs/srv/CommandLong"
_SLOW_NS, _FAST_NS = 1_000_000_000, 30_000_000
"""Periods of the state, sent with each heartbeat, and of the pose, at about the rate of PX4's
LOCAL_POSITION_NED."""
_SOURCE: Source = (-1, 1, 240)
"""System and component of MAVROS itself; the link belongs to no bridge."""
_log = logging.getLogger(__name__)
_NOTHING = (math.nan, math.nan, math.nan)


class Mavros:
    """Topics of an autopilot below `prefix`, on the graph of `node`."""

    def __init__(self, node: Node, context: AutopilotContext, prefix: str) -> None:
        self._context = context
        self._prefix = prefix if prefix.startswith("/") else f"{node.get_namespace()}/{prefix}"
        self._published_ns: dict[str, int] = {}
        self._last_state: tuple[Any, ...] = ()

        def publisher(name: str, kind: type[Any]) -> Any:
            return node.create_publisher(kind, f"{prefix}/{name}")

        self._state = publisher("state", message_type(_STATE))
        self._extended = publisher("extended_state", message_type(_EXTENDED))
        self._battery = publisher("battery", BatteryState)
        self._pose = publisher("local_position/pose", PoseStamped)
        self._velocity = publisher("local_position/velocity_local", TwistStamped)
        self._odom = publisher("local_position/odom", Odometry)
        self._global = publisher("global_position/global", NavSatFix)
        subscriptions: dict[str, tuple[type[Any], Callable[[Any], OffboardSetpoint]]] = {
            "setpoint_position/local": (PoseStamped, self._pose_setpoint),
            "setpoint_velocity/cmd_vel": (TwistStamped, lambda m: _velocity(m.twist)),
            "setpoint_velocity/cmd_vel_unstamped": (Twist, _velocity),
            "setpoint_raw/local": (message_type(_TARGET), self._raw),
            "setpoint_raw/attitude": (message_type(_ATTITUDE), _attitude),
        }
        moves = (node.get_namespace().split("/")[1],)
        for name, (kind, read) in subscriptions.items():
            topic = f"{prefix}/{name}"
            node.create_subscription(kind, topic, self._receiver(read), moves=moves)
        services: dict[str, tuple[str, Callable[[Any, Any], Any]]] = {
            "cmd/arming": (_BOOL, self._arm),
            "set_mode": (_MODE, self._set_mode),
            "cmd/takeoff": (_TOL, self._take_off),
            "cmd/land": (_TOL, self._land),
            "cmd/command": (_LONG, self._command),
        }
        for name, (srvtype, handler) in services.items():
            node.create_service(srvtype, f"{prefix}/{name}", handler, moves=moves)

    # --------------------------------------------------------------------------------------- out

    def publish(self) -> None:
        """Publishes what is due."""
        context, memory = self._context, self._context.memory
        state = (memory.armed, memory.mode)
        if self._is_due("slow", _SLOW_NS) or state != self._last_state:
            self._last_state = state
            for publisher, build in (
                (self._state, self._state_message),
                (self._extended, self._extended_message),
                (self._battery, self._battery_message),
            ):
                if publisher.has_subscribers:
                    publisher.publish(build(context))
        if self._is_due("fast", _FAST_NS):
            for publisher, build in (
                (self._pose, self._pose_message),
                (self._velocity, self._velocity_message),
                (self._odom, self._odom_message),
                (self._global, self._global_message),
            ):
                if publisher.has_subscribers:
                    publisher.publish(build(context))

    def _is_due(self, what: str, period_ns: int) -> bool:
        now_ns = self._context.memory.now_ns
        last_ns = self._published_ns.get(what, -period_ns)
        if 0 <= now_ns - last_ns < period_ns:
            return False
        self._published_ns[what] = now_ns
        return True

    def _header(self, frame: str = "map") -> Any:
        return header(self._context.memory.now_ns, frame)

    def _state_message(self, context: AutopilotContext) -> Any:
        memory = context.memory
        message = zero_message(_STATE)
        message.header = self._header("")
        message.connected, message.armed = True, memory.armed
        message.guided = not memory.mode.by_sticks
        message.manual_input = memory.mode.by_sticks
        message.mode = memory.mode.mavros
        message.system_status = 4 if memory.armed else 3
        return message

    def _extended_message(self, context: AutopilotContext) -> Any:
        message = zero_message(_EXTENDED)
        message.header = self._header("")
        landed = {"LANDED": 1, "CRASHED": 1, "TAKE_OFF": 3, "LAND": 4}
        message.landed_state = landed.get(context.state.mode, 2)
        return message

    def _battery_message(self, context: AutopilotContext) -> Any:
        message = zero_message("sensor_msgs/msg/BatteryState")
        message.header = self._header("")
        message.voltage, message.current = context.state.voltage, -context.state.current
        message.percentage, message.present = (
            context.state.charge,
            math.isfinite(context.state.charge),
        )
        return message

    def _local_pose(self, context: AutopilotContext) -> Any:
        origin = context.memory.origin
        x, y, z = (p - o for p, o in zip(context.state.position, origin, strict=True))
        return Pose(Point(x, y, z), Quaternion(*context.state.attitude))

    def _pose_message(self, context: AutopilotContext) -> Any:
        return PoseStamped(self._header(), self._local_pose(context))

    def _velocity_message(self, context: AutopilotContext) -> Any:
        twist = Twist(Vector3(*context.state.velocity), Vector3(*context.state.rates))
        return TwistStamped(self._header(), twist)

    def _odom_message(self, context: AutopilotContext) -> Any:
        turned = rotate(conjugate(context.state.attitude), context.state.velocity).tolist()
        twist = Twist(Vector3(*turned), Vector3(*context.state.rates))
        nothing = np.zeros(36)
        return Odometry(
            self._header(),
            "base_link",
            PoseWithCovariance(self._local_pose(context), nothing),
            TwistWithCovariance(twist, nothing),
        )

    def _global_message(self, context: AutopilotContext) -> Any:
        latitude, longitude, altitude = context.earth.geodetic(context.state.position)
        status: Any = NavSatStatus(-1 if context.memory.fix_lost else 0, 1)
        covariance = np.zeros(9)
        return NavSatFix(
            self._header("base_link"), status, latitude, longitude, altitude, covariance, 0
        )

    # ---------------------------------------------------------------------------------------- in

    def _receiver(self, read: Callable[[Any], OffboardSetpoint]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            try:
                setpoint = read(message)
            except CommandError as error:  # a topic has no response
                self._context.report_refusal(f"setpoint refused: {error}")
                return
            offboard.take(self._context, _SOURCE, setpoint)

        return take

    def _in_map(self, point: Any) -> Vector:
        x, y, z = self._context.memory.origin
        return x + point.x, y + point.y, z + point.z

    def _pose_setpoint(self, message: Any) -> OffboardSetpoint:
        q = message.pose.orientation
        yaw = heading_of((q.x, q.y, q.z, q.w))
        yaw = math.nan if yaw is None else yaw
        return _checked(OffboardSetpoint(position=self._in_map(message.pose.position), yaw=yaw))

    def _raw(self, message: Any) -> OffboardSetpoint:
        mask = int(message.type_mask)
        if message.coordinate_frame not in (1, 8):
            raise CommandError(f"frame {message.coordinate_frame} is not supported")
        position = self._in_map(message.position) if message.coordinate_frame == 1 else _NOTHING
        velocity = _masked(_parts(message.velocity), mask >> 3)
        push = _masked(_parts(message.acceleration_or_force), mask >> 6)
        if message.coordinate_frame == 8:
            attitude = self._context.state.attitude
            velocity, push = from_heading(velocity, attitude), from_body(push, attitude)
        if mask & 512 and any(map(math.isfinite, push)):
            raise CommandError("forces are not supported")
        return _checked(
            OffboardSetpoint(
                _masked(position, mask),
                velocity,
                push,
                math.nan if mask & 1024 else message.yaw,
                math.nan if mask & 2048 else message.yaw_rate,
            )
        )

    def _arm(self, request: Any, response: Any) -> Any:
        why = arming.obstacle(self._context) if request.value else "not landed"
        result = self._do(400, (1.0 if request.value else 0.0, 0.0))
        if result:
            _log.warning("%s: arming %s: %s", self._prefix, request.value, why)
        response.success, response.result = result == 0, result
        return response

    def _set_mode(self, request: Any, response: Any) -> Any:
        mode = mode_named(request.custom_mode)
        why = (
            "there is no such mode"
            if mode is None
            else mode_transitions.request_mode(self._context, mode)
        )
        if why:
            self._refuse(f"mode '{request.custom_mode}': {why}")
        response.mode_sent = not why
        return response

    def _refuse(self, what: str) -> None:
        """Reports why a request is refused; the responses have no field for the reason."""
        _log.warning("%s: %s", self._prefix, what)
        self._context.report(2, what)

    def _take_off(self, request: Any, response: Any) -> Any:
        params = (0.0, 0.0, 0.0, request.yaw, request.latitude, request.longitude)
        result = self._do(22, (*params, request.altitude))
        response.success, response.result = result == 0, result
        return response

    def _land(self, _request: Any, response: Any) -> Any:
        result = self._do(21, ())
        response.success, response.result = result == 0, result
        return response

    def _command(self, request: Any, response: Any) -> Any:
        params = tuple(float(getattr(request, f"param{k}")) for k in range(1, 8))
        result = self._do(int(request.command), params)
        response.success, response.result = result == 0, result
        return response

    def _do(self, number: int, params: tuple[float, ...]) -> int:
        filled = (*params, *(math.nan,) * (7 - len(params)))
        return commands.do(self._context, _SOURCE, Command(number, filled, None))


def _velocity(twist: Any) -> OffboardSetpoint:
    return _checked(OffboardSetpoint(velocity=_parts(twist.linear), yaw_rate=twist.angular.z))


def _attitude(message: Any) -> OffboardSetpoint:
    mask, thrust = int(message.type_mask), float(message.thrust)
    if mask & 64 or not 0.0 <= thrust <= 1.0:
        raise CommandError("an attitude needs a thrust from 0 to 1")
    if mask & 128:
        rates = _parts(message.body_rate)
        if mask & 7 or not all(map(math.isfinite, rates)):
            raise CommandError("three finite body rates are needed")
        return OffboardSetpoint(rates=rates, thrust=thrust)
    if not mask & 4 and math.isfinite(message.body_rate.z) and message.body_rate.z != 0.0:
        raise CommandError("a yaw rate with an attitude is not supported")
    q = message.orientation
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not 0.9 <= length <= 1.1:
        raise CommandError("an attitude must be a unit quaternion")
    x, y, z, w = (part / length for part in (q.x, q.y, q.z, q.w))
    return OffboardSetpoint(attitude=(x, y, z, w), thrust=thrust)


def _parts(vector: Any) -> Vector:
    return vector.x, vector.y, vector.z


def _masked(vector: Vector, mask: int) -> Vector:
    x, y, z = (math.nan if mask >> k & 1 else part for k, part in enumerate(vector))
    return x, y, z


def _checked(setpoint: OffboardSetpoint) -> OffboardSetpoint:
    parts = (*setpoint.position, *setpoint.velocity, *setpoint.acceleration)
    if all(map(math.isnan, parts)) or any(abs(part) > 1e6 for part in parts):
        raise CommandError("a setpoint without a number, or out of range")
    if math.isinf(setpoint.yaw) or math.isinf(setpoint.yaw_rate):
        raise CommandError("a heading is out of range")
    return setpoint
