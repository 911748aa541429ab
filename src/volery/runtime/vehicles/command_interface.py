"""Subscribes to the topics and creates the services that command UAVs over the graph."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from volery.control.flight_modes import DOWN_MODES, FlightMode
from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.graph.messages import (
    MultiDOFJointTrajectory,
    PoseStamped,
    Published,
    Twist,
    TwistStamped,
    frame_of,
    header,
)
from volery.runtime.services.results import Close, offer_command
from volery.runtime.vehicles.raw_setpoints import steer_to_message, turn_rotors, turn_to_message
from volery.runtime.vehicles.trajectory_messages import follow_message
from volery.runtime.vehicles.uav import Uav

_TRIGGER = "std_srvs/srv/Trigger"
_SPEEDS = "std_msgs/msg/Float32MultiArray"
_POSITION_TARGET = "mavros_msgs/msg/PositionTarget"
_ATTITUDE_TARGET = "mavros_msgs/msg/AttitudeTarget"
_BUSY = (FlightMode.TAKE_OFF, FlightMode.LAND, FlightMode.RETURN)
"""Modes that no topic ends: a landing continues while a stream of Twists arrives."""

_GOALS = ("goal_pose", "trajectory")
"""Topics of single commands; the others are streams."""

_log = logging.getLogger(__name__)


def open_commands(graph: Graph, uav: Uav, now_ns: Callable[[], int]) -> Iterator[Close]:
    """Subscribes to the command topics of one UAV and creates its Trigger services.

    Topics are `cmd_vel`, `goal_pose`, `trajectory`, `setpoint_raw/local` and
    `setpoint_raw/attitude` (`vehicles.raw_setpoints`), `rotor_speeds` (fractions of full speed)
    and, for an externally moved kinematic UAV, `pose_command`: its pose from the next step on.

    A Twist is in the level heading frame, a pose and a trajectory in the map frame. The UAV
    ignores all of them on the ground, during take-off, landing and return, and with its rotors
    stopped. An invalid message (nan, another frame) is discarded with a logged warning, once per
    topic. An external client learns of it, and of a goal or trajectory that is ignored
    (`Graph.refuse`). An accepted Twist is published on `cmd_vel/applied` with the simulated time
    from which it acts; clients measure round trips with it. The services take_off, hold, land and
    return_home respond with `success` and a reason. Yields the function that undoes each step
    once the step is made.
    """
    applied = graph.advertise(f"/{uav.name}/cmd_vel/applied", TwistStamped)
    yield applied.cancel

    def on_twist(twist: Any) -> None:
        linear, angular = twist.linear, twist.angular
        uav.command_velocity([linear.x, linear.y, linear.z], angular.z)
        if applied.has_subscribers:
            stamp = header(now_ns(), f"{uav.name}/base_link")
            applied.publish(TwistStamped(header=stamp, twist=twist))

    topics: dict[str, tuple[type[Any] | str, Callable[[Any], None]]] = {
        "cmd_vel": (Twist, on_twist),
        "goal_pose": (PoseStamped, lambda pose: go_to_message(uav, pose)),
        "trajectory": (MultiDOFJointTrajectory, lambda message: follow_message(uav, message)),
        "pose_command": (PoseStamped, lambda pose: stand_at_message(uav, pose)),
        "rotor_speeds": (_SPEEDS, lambda speeds: turn_rotors(uav, speeds)),
        "setpoint_raw/local": (_POSITION_TARGET, lambda target: steer_to_message(uav, target)),
        "setpoint_raw/attitude": (_ATTITUDE_TARGET, lambda target: turn_to_message(uav, target)),
    }
    for name, (message_class, take) in topics.items():
        topic = f"/{uav.name}/{name}"
        receive = _careful(graph, uav, take, topic, streamed=name not in _GOALS)
        yield graph.subscribe(topic, receive, message_class).cancel
    actions: dict[str, Callable[[], object]] = {
        "take_off": uav.take_off,
        "hold": uav.hold,
        "land": uav.land,
        "return_home": uav.return_home,
    }
    for name, action in actions.items():
        path = f"/{uav.name}/{name}"
        yield offer_command(graph, path, _TRIGGER, _without_request(action))


def go_to_message(uav: Uav, message: Any) -> None:
    """Sends `uav` to a PoseStamped in the map frame; a zero quaternion keeps the heading.

    Raises `CommandError` if the goal is invalid or in another frame.
    """
    if frame_of(message) not in ("", "map"):
        raise CommandError(f"goals are in 'map', not in '{frame_of(message)}'")
    position, turn = message.pose.position, message.pose.orientation
    q = np.array([turn.x, turn.y, turn.z, turn.w], dtype=np.float64)
    if not np.isfinite(q).all():
        raise CommandError("the rotation of a goal must be finite")
    uav.go_to([position.x, position.y, position.z], rotations.heading_of(q))


def stand_at_message(uav: Uav, message: Any) -> None:
    """Sets the pose of a kinematic `uav` from a PoseStamped in the map. Raises `CommandError`."""
    if frame_of(message) not in ("", "map"):
        raise CommandError(f"poses are in 'map', not in '{frame_of(message)}'")
    position, turn = message.pose.position, message.pose.orientation
    stamp = message.header.stamp
    uav.command_pose(
        [position.x, position.y, position.z],
        [turn.x, turn.y, turn.z, turn.w],
        stamp_ns=stamp.sec * NS_PER_S + stamp.nanosec,
    )


def _careful(
    graph: Graph, uav: Uav, take: Callable[[Any], None], topic: str, *, streamed: bool
) -> Callable[[Published], None]:
    """Returns a subscriber that refuses invalid messages.

    streamed: messages that a mode ignores are no news for a client, which repeats them.
    """
    has_warned = False

    def receive(published: Published) -> None:
        nonlocal has_warned
        if uav.mode in _BUSY or uav.rotors_stopped:
            if not streamed:
                state = f"is in mode {uav.mode.name}" if uav.mode in _BUSY else "was killed"
                graph.refuse(topic, f"{uav.name} {state}, which no goal ends")
            return
        try:
            take(published.message)
        except (CommandError, AttributeError) as error:
            if not (streamed and uav.mode in DOWN_MODES):
                graph.refuse(topic, str(error))
            if not has_warned and uav.mode not in DOWN_MODES:
                has_warned = True
                _log.warning("%s: a command is not obeyed: %s", topic, error)

    return receive


def _without_request(action: Callable[[], object]) -> Callable[[Any], None]:
    def handle(_request: Any) -> None:
        action()

    return handle
