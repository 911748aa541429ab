"""Checks and publishes the commands that the ROS side sends over the sensor link."""

from __future__ import annotations

import math
from typing import Any

from volery.bridges.ros_tcp.incoming_queue import IncomingQueue
from volery.bridges.sensor_link.payloads import PAYLOADS, decode_payload
from volery.bridges.sensor_link.wire import SensorLinkFrame, SensorLinkKind
from volery.core.errors import BridgeError, GraphError
from volery.graph.messages import frame_of
from volery.graph.session import Session

COMMAND_TOPICS = {
    SensorLinkKind.POSE_COMMAND: "pose_command",
    SensorLinkKind.GOAL_POSE: "goal_pose",
}
"""Topics below the UAV's namespace."""

_DEPTH = 2
"""Queue depth: a pose replaces earlier ones, so that few need to wait."""
_UNIT_TOLERANCE = 0.01


class SensorLinkCommands:
    """Publishes one client's commands through its session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._inlets: dict[tuple[int, int], IncomingQueue] = {}

    def take(self, frame: SensorLinkFrame) -> None:
        """Publishes the command of a frame.

        Raises `BridgeError` with the reason if it is invalid.
        """
        topic = (
            COMMAND_TOPICS.get(SensorLinkKind(frame.kind))
            if frame.kind in list(SensorLinkKind)
            else None
        )
        if topic is None:
            known = ", ".join(f"{kind.name} ({int(kind)})" for kind in COMMAND_TOPICS)
            raise BridgeError(f"frames of type {frame.kind} are not accepted here, only {known}")
        kind = SensorLinkKind(frame.kind)
        _, pose = decode_payload(kind, frame.payload, frame.stamp_ns)
        _check_pose(pose, may_keep_heading=kind is SensorLinkKind.GOAL_POSE)
        inlet = self._inlets.get((kind, frame.uav))
        if inlet is None:
            inlet = self._inlets[kind, frame.uav] = self._inlet(kind, frame.uav, topic)
        inlet.put(pose)

    def _inlet(self, kind: SensorLinkKind, uav: int, topic: str) -> IncomingQueue:
        below = f"/uav{uav}/"
        if not any(found.name.startswith(below) for found in self._session.graph.topics()):
            raise BridgeError(f"there is no UAV {uav}")
        name, msgtype = f"{below}{topic}", PAYLOADS[kind].msgtype
        try:
            self._session.advertise(name, msgtype)
        except GraphError as error:
            raise BridgeError(str(error)) from None
        return IncomingQueue(self._session, name, msgtype, _DEPTH)


def _check_pose(stamped: Any, *, may_keep_heading: bool) -> None:
    if frame_of(stamped) not in ("", "map"):
        raise BridgeError(f"poses must be in 'map', not in '{frame_of(stamped)}'")
    turn = stamped.pose.orientation
    length = math.hypot(turn.x, turn.y, turn.z, turn.w)
    if abs(length - 1.0) > _UNIT_TOLERANCE and not (may_keep_heading and length == 0.0):
        raise BridgeError(f"a quaternion must have length 1, not {length:.3g}")
