"""Receives what a policy observes: each input subscribes to its topic, checks messages and ages.

An input belongs to a node, declares its own parameters and says why it cannot be used (`fault`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from volery.autonomy.perception.list_parameters import declare_numbers
from volery.autonomy.perception.map_frame import MAP, UNKNOWN_POSE, MapFrame
from volery.autonomy.perception.odometry_topics import subscribe_odometry
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import Odometry, PoseStamped, frame_of
from volery.graph.nodes.node import Node

_MAX_DISTANCE_M = 1e6


class NodeInput(SavedAttributes):
    """What a policy receives; made with its node and the time after which it is too old."""

    STATE: ClassVar[tuple[str, ...]] = ("_received_ns", "_problem")
    what: ClassVar[str]
    """What it is, for status and errors."""
    expires: ClassVar[bool] = True
    """Whether values become too old."""

    def __init__(self, node: Node, timeout_s: float) -> None:
        self._node = node
        self._timeout_s = timeout_s
        self._received_ns: int | None = None
        self._problem = ""

    def fault(self, now_ns: int) -> str:
        """Returns why there is no usable value at present; empty: there is one."""
        if self._problem:
            return self._problem
        if self._received_ns is None:
            return f"no {self.what} yet"
        age_s = (now_ns - self._received_ns) / NS_PER_S
        if self.expires and not 0.0 <= age_s <= self._timeout_s:
            return f"no {self.what} for {self._timeout_s:g} s"
        return ""

    def _accept(self) -> None:
        self._received_ns, self._problem = self._node.get_clock().now_ns(), ""

    def _refuse(self, problem: str) -> None:
        self._problem = f"{self.what} {problem}"


class OdometryInput(NodeInput):
    """Pose and velocity in the map, from `odom` and, where it is published, `/tf`."""

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "pose")
    PARTS: ClassVar[tuple[str, ...]] = ("frame",)
    what = "odometry"

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        self.pose: OdometrySample | None = None
        """In the map frame."""
        self.frame = MapFrame()
        subscribe_odometry(node, self.frame, self._on_odometry, 5)

    def fault(self, now_ns: int) -> str:
        """Returns why there is no usable pose; see `NodeInput.fault`."""
        return super().fault(now_ns) or (UNKNOWN_POSE if self.frame.is_lost else "")

    def _on_odometry(self, message: Odometry) -> None:
        pose, problem = usable_pose(self.frame.pose_in_map(message))
        if pose is None:
            self._refuse(problem)
        else:
            self.pose = pose
            self._accept()


def usable_pose(pose: OdometrySample) -> tuple[OdometrySample | None, str]:
    """Returns the pose with a unit quaternion; None, and why, for one that is no motion."""
    length = norm(pose.attitude)
    vectors = (pose.position, pose.velocity, pose.omega_body)
    if not all(np.isfinite(v).all() for v in (*vectors, pose.attitude)):
        return None, "is not finite"
    if not 0.9 < length < 1.1 or float(np.abs(vectors).max()) > _MAX_DISTANCE_M:
        return None, "is impossible"
    return replace(pose, attitude=pose.attitude / length), ""


class GoalInput(NodeInput):
    """The goal in the map: the parameter `goal`, then the poses on `~/goal_pose`.

    A moving goal is odometry on `~/goal_odometry`, such as that of another UAV.
    """

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "position", "velocity")
    what = "goal"
    expires = False

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        goal = declare_numbers(node, "goal", [], "[x, y, z]", or_empty=True)
        self.position: Array = np.array(goal or [0.0, 0.0, 0.0])
        """(3,) m, map frame."""
        self.velocity: Array = np.zeros(3)
        """(3,) m/s, map frame; zero for poses."""
        if goal:
            self._accept()
        node.create_subscription(PoseStamped, "~/goal_pose", self._on_goal, 1)
        node.create_subscription(Odometry, "~/goal_odometry", self._on_goal_odometry, 1)

    def _on_goal(self, message: PoseStamped) -> None:
        p = message.pose.position
        position = np.array([p.x, p.y, p.z], np.float64)
        frame = frame_of(message)
        if frame not in ("", MAP):
            self._refuse(f"must be in '{MAP}', not in '{frame[:80]}'")
        elif not np.isfinite(position).all() or float(np.abs(position).max()) > _MAX_DISTANCE_M:
            self._refuse("is not finite")
        else:
            self.position, self.velocity = position, np.zeros(3)
            self._accept()

    def _on_goal_odometry(self, message: Odometry) -> None:
        pose, problem = usable_pose(OdometrySample.from_odometry(message))
        if pose is None:
            self._refuse(problem)
        else:
            self.position, self.velocity = pose.position, pose.velocity
            self._accept()
