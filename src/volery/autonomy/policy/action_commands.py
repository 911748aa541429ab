"""Publishes the actions of a policy as commands of their level.

| kind | topic | message |
|---|---|---|
| `velocity`, `limited_velocity`, `discrete_velocity` | `cmd_vel` | Twist, level heading frame |
| `position` | `setpoint_raw/local` | mavros_msgs PositionTarget, map frame |
| `choices` | as the action that they are of | |
| `attitude_thrust`, `rates_thrust` | `setpoint_raw/attitude` | mavros_msgs AttitudeTarget |
| `rotor_speeds` | `rotor_speeds` | Float32MultiArray, fractions of full speed |
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.policy import action_terms
from volery.autonomy.policy.description import ActionPart
from volery.core.arrays import Array
from volery.core.errors import NodeError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Point, Quaternion, Twist, Vector3, header, message_type
from volery.graph.nodes.node import Node
from volery.graph.nodes.service_client import Client

_POSITION_TARGET = "mavros_msgs/msg/PositionTarget"
_MAP_FRAME, _IGNORE_ACCELERATION, _IGNORE_YAW = 1, 64 | 128 | 256, 1024
_TARGET, _SPEEDS = "mavros_msgs/msg/AttitudeTarget", "std_msgs/msg/Float32MultiArray"
_IGNORE_RATES, _IGNORE_ATTITUDE = 1 | 2 | 4, 128


class ActionCommands(Protocol):
    """Commands of one kind of action."""

    def send(self, action: Array, pose: OdometrySample) -> None:
        """Commands an action (A,)."""

    def hold(self) -> bool:
        """Stops the UAV; called at each decision without an action until it returns True.

        Returns whether the UAV holds without further commands.
        """


def action_commands(part: ActionPart, node: Node, decision_rate_hz: float) -> ActionCommands:
    """Returns the commands of a policy's action on the topics of `node`.

    Raises `NodeError` for an unknown kind, and for parameters that are missing or no numbers.
    """
    make = COMMANDS.get(part.kind)
    if make is None:
        raise NodeError(
            f"the policy acts by '{part.kind}', which no node commands; known: "
            f"{', '.join(sorted(COMMANDS))}"
        )
    return make(part, node, decision_rate_hz)


class _Velocities:
    """Velocities on `cmd_vel`."""

    def __init__(self, part: ActionPart, node: Node, _rate_hz: float) -> None:
        self._kind = part.kind
        size = {"velocity": 4, "limited_velocity": 3, "discrete_velocity": 1, "level_velocity": 2}[
            part.kind
        ]
        choices = action_terms.DISCRETE_VELOCITIES if part.kind == "discrete_velocity" else None
        _check_size(part, size, choices)
        level = ("forward_m_s", "lateral_m_s", "keep_height_m", "climb_m_s")
        self._level = (
            {name: _number(part, name) for name in level} if part.kind == "level_velocity" else {}
        )
        self._speed = 0.0 if self._level else _number(part, "speed_m_s")
        self._yaw_rate = _number(part, "yaw_rate_rad_s") if part.kind == "velocity" else 0.0
        self._publisher = node.create_publisher(Twist, "cmd_vel", 1)

    def send(self, action: Array, pose: OdometrySample) -> None:
        if self._kind == "level_velocity":
            level = action_terms.level_velocity(action, pose.position[2], **self._level)
            self._publish(level.tolist(), 0.0)
        elif self._kind == "limited_velocity":
            limited = action_terms.limited_velocity(action, self._speed)
            self._publish(limited.tolist(), 0.0)
        elif self._kind == "discrete_velocity":
            velocity = action_terms.discrete_velocity(action[0].astype(np.int64), self._speed)
            self._publish(velocity.tolist(), 0.0)
        else:
            velocity, yaw_rate = action_terms.velocity(action, self._speed, self._yaw_rate)
            self._publish(velocity.tolist(), float(yaw_rate))

    def hold(self) -> bool:
        self._publish([0.0, 0.0, 0.0], 0.0)
        return False

    def _publish(self, velocity: list[float], yaw_rate: float) -> None:
        self._publisher.publish(Twist(Vector3(*velocity), Vector3(0.0, 0.0, yaw_rate)))


class _Positions:
    """Positions near the present one, on `setpoint_raw/local`."""

    def __init__(self, part: ActionPart, node: Node, _rate_hz: float) -> None:
        _check_size(part, 4)
        self._range = _number(part, "range_m")
        self._yaw_rate = _number(part, "yaw_rate_rad_s")
        self._node = node
        self._service = node.create_client("std_srvs/srv/Trigger", "hold")
        self._publisher = node.create_publisher(
            message_type(_POSITION_TARGET), "setpoint_raw/local", 1
        )

    def send(self, action: Array, pose: OdometrySample) -> None:
        target = zero_message(_POSITION_TARGET)
        target.header = header(self._node.get_clock().now_ns(), "map")
        target.coordinate_frame = _MAP_FRAME
        target.type_mask = _IGNORE_ACCELERATION | _IGNORE_YAW
        goal = action_terms.position(action, pose.position, pose.yaw, self._range)
        target.position = Point(*goal.tolist())
        target.yaw_rate = float(self._yaw_rate * action[3])
        self._publisher.publish(target)

    def hold(self) -> bool:
        return _hold(self._service)


class _Choices:
    """Rows of a table of another action."""

    def __init__(self, part: ActionPart, node: Node, rate_hz: float) -> None:
        table = np.asarray(part.parameters.get("table"), np.float64)
        inner = part.parameters.get("action")
        if table.ndim != 2 or len(table) != part.choices or not isinstance(inner, dict):
            raise NodeError(
                "the policy's action 'choices' needs the parameters table, a row of numbers for "
                "each choice, and action, the parameters of the action that they are of"
            )
        self._table = table
        of = ActionPart(kind=str(part.parameters.get("of")), size=table.shape[1], parameters=inner)
        self._commands = action_commands(of, node, rate_hz)

    def send(self, action: Array, pose: OdometrySample) -> None:
        self._commands.send(self._table[int(action[0])], pose)

    def hold(self) -> bool:
        return self._commands.hold()


class _Attitudes:
    """Attitudes or rates, with thrust, on `setpoint_raw/attitude`."""

    def __init__(self, part: ActionPart, node: Node, rate_hz: float) -> None:
        _check_size(part, 4)
        self._by_attitude = part.kind == "attitude_thrust"
        if self._by_attitude:
            self._tilt = _number(part, "tilt_rad")
            self._yaw_rate = _number(part, "yaw_rate_rad_s")
        else:
            self._rate = _number(part, "rate_rad_s")
        self._hover = _number(part, "hover_thrust_fraction")
        self._ahead_s = 1.0 / rate_hz
        self._node = node
        self._service = node.create_client("std_srvs/srv/Trigger", "hold")
        self._publisher = node.create_publisher(message_type(_TARGET), "setpoint_raw/attitude", 1)

    def send(self, action: Array, pose: OdometrySample) -> None:
        target = zero_message(_TARGET)
        target.header = header(self._node.get_clock().now_ns(), "base_link")
        if self._by_attitude:
            attitude = action_terms.attitude(
                action,
                pose.attitude,
                tilt_rad=self._tilt,
                yaw_rate_rad_s=self._yaw_rate,
                ahead_s=self._ahead_s,
            )
            target.type_mask = _IGNORE_RATES
            target.orientation = Quaternion(*attitude.tolist())
        else:
            target.type_mask = _IGNORE_ATTITUDE
            target.orientation = Quaternion(0.0, 0.0, 0.0, 1.0)
            target.body_rate = Vector3(*(self._rate * action[:3]).tolist())
        target.thrust = float(action_terms.thrust(action[3], self._hover, 1.0))
        self._publisher.publish(target)

    def hold(self) -> bool:
        return _hold(self._service)


class _RotorSpeeds:
    """Fractions of full speed on `rotor_speeds`."""

    def __init__(self, part: ActionPart, node: Node, _rate_hz: float) -> None:
        self._hover = _numbers(part, "hover_speed_fractions")
        self._service = node.create_client("std_srvs/srv/Trigger", "hold")
        self._publisher = node.create_publisher(message_type(_SPEEDS), "rotor_speeds", 1)

    def send(self, action: Array, pose: OdometrySample) -> None:  # noqa: ARG002
        message = zero_message(_SPEEDS)
        speeds = action_terms.rotor_speeds(action, self._hover, 1.0)
        message.data = speeds.astype(np.float32)
        self._publisher.publish(message)

    def hold(self) -> bool:
        return _hold(self._service)


COMMANDS: dict[str, Callable[[ActionPart, Node, float], ActionCommands]] = {
    "velocity": _Velocities,
    "discrete_velocity": _Velocities,
    "limited_velocity": _Velocities,
    "level_velocity": _Velocities,
    "position": _Positions,
    "choices": _Choices,
    "attitude_thrust": _Attitudes,
    "rates_thrust": _Attitudes,
    "rotor_speeds": _RotorSpeeds,
}
"""Commands by the kind of action."""


def _hold(service: Client) -> bool:
    """Calls the service `hold`, if there is one; returns whether it was called."""
    if service.service_is_ready():
        service.call_async()
        return True
    return False


def _check_size(part: ActionPart, size: int, choices: int | None = None) -> None:
    if part.size != size or part.choices != choices:
        raise NodeError(
            f"an action of kind '{part.kind}' has {size} numbers, not {part.size}"
            f", and {choices or 'no'} choices, not {part.choices or 'none'}"
        )


def _number(part: ActionPart, name: str) -> float:
    value: Any = part.parameters.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 1e6:
        raise NodeError(
            f"the policy's action '{part.kind}' needs the parameter {name}, a number from 0 on, "
            f"not {value!r}"
        )
    return float(value)


def _numbers(part: ActionPart, name: str) -> Array:
    values: Any = part.parameters.get(name)
    if (
        not isinstance(values, list)
        or len(values) != part.size
        or not all(isinstance(v, int | float) and 0.0 <= v <= 1.0 for v in values)
    ):
        raise NodeError(
            f"the policy's action '{part.kind}' needs the parameter {name}, {part.size} numbers "
            f"from 0 to 1"
        )
    return np.array(values, np.float64)
