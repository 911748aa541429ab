"""The topics and services by which the graph commands UAVs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.control.flight_modes import FlightMode
from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.graph.messages import MultiDOFJointTrajectory, Published, Twist, message_type
from volery.runtime.trajectory_messages import follow_message
from volery.runtime.uav import Uav

_TRIGGER = "std_srvs/srv/Trigger"


def open_commands(graph: Graph, uav: Uav) -> None:
    """Listen to `/uavN/cmd_vel` and `/uavN/trajectory`, offer the services of one UAV.

    A Twist is taken in the level heading frame, a trajectory as `follow_message` says. During
    take-off and on the ground they are ignored, and so are those that are none: a refused command
    on a topic has nobody to tell. The services take_off, hold, land and return_home answer with
    `success` and a reason.
    """
    response_type = message_type(f"{_TRIGGER}_Response")

    def on_twist(published: Published) -> None:
        if uav.mode is FlightMode.TAKE_OFF:
            return
        linear, angular = published.message.linear, published.message.angular
        try:
            uav.command_velocity([linear.x, linear.y, linear.z], angular.z)
        except (CommandError, AttributeError):
            return

    def on_trajectory(published: Published) -> None:
        if uav.mode is FlightMode.TAKE_OFF:
            return
        try:
            follow_message(uav, published.message)
        except (CommandError, AttributeError):
            return

    def serve(action: Callable[[], None]) -> Callable[[Any], Any]:
        def handle(_request: Any) -> Any:
            try:
                action()
            except CommandError as error:
                return response_type(success=False, message=str(error))
            return response_type(success=True, message="")

        return handle

    graph.subscribe(f"/{uav.name}/cmd_vel", on_twist, Twist)
    graph.subscribe(f"/{uav.name}/trajectory", on_trajectory, MultiDOFJointTrajectory)
    actions: dict[str, Callable[[], None]] = {
        "take_off": uav.take_off,
        "hold": uav.hold,
        "land": uav.land,
        "return_home": uav.return_home,
    }
    for name, action in actions.items():
        graph.offer(f"/{uav.name}/{name}", _TRIGGER, serve(action))
