"""Follows the local planner's trajectories by velocity commands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.stuck_sensors import is_stuck
from volery.autonomy.planning.trajectory_messages import TrajectorySamples, samples_of
from volery.autonomy.status import publish_status
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import (
    Bool,
    MultiDOFJointTrajectory,
    Odometry,
    String,
    Twist,
    Vector3,
    frame_of,
)
from volery.graph.nodes.node import Node

_PERIOD_S = 0.04
_STALE_S = 0.5
"""Time without odometry after which the follower commands zero velocity."""
_TURN_GAIN, _TURN_RAD_S = 1.8, 1.2
_OFF_M = 2.0
"""Distance from the plan beyond which the follower stops and waits for another plan."""


class TrajectoryFollower(SavedAttributes, Node):
    """Publishes `cmd_vel` to follow `planning/trajectory`; publishes `~/status`.

    The node commands velocities rather than positions: positions would be in the autopilot's frame,
    and without GNSS the transform between the two frames is unknown. At the end of a plan, and
    without odometry, the command is zero velocity. `planning/pause` (std_msgs/Bool, true) stops the
    commands and drops the plan.

    Parameters
    ----------
    odometry: topic of the pose; plans are in its frame.
    gain: m/s for each m off the plan.
    lookahead_s: time by which the commanded velocity is ahead, to compensate for the vehicle's lag.

    """

    STATE = ("_pose", "_received_ns", "_frame", "_plan", "_next", "_last_status", "_paused")

    def __init__(self, **options: Any) -> None:
        super().__init__("follower", **options)
        odometry = str(self.declare_parameter("odometry", "odom").value)
        self._gain = float(self.declare_parameter("gain", 2.0, min_value=0.0).value)
        self._lookahead_ns = ns_from_s(
            float(self.declare_parameter("lookahead_s", 0.25, min_value=0.0, max_value=10.0).value)
        )
        self._pose: OdometrySample | None = None
        self._received_ns = 0
        self._frame = ""
        self._plan: TrajectorySamples | None = None
        self._next: TrajectorySamples | None = None
        self._last_status = ""
        self._paused = False
        self._command = self.create_publisher(Twist, "cmd_vel", 1)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        self.create_subscription(Odometry, odometry, self._on_odometry, 5, passive=True)
        self.create_subscription(
            MultiDOFJointTrajectory, "planning/trajectory", self._on_trajectory, 2
        )
        self.create_subscription(Bool, "planning/pause", self._on_pause, 1)
        self.create_timer(_PERIOD_S, self._on_timer)

    def _on_odometry(self, message: Odometry) -> None:
        pose = OdometrySample.from_odometry(message)
        values = (pose.position, pose.attitude, pose.velocity)
        if all(np.isfinite(v).all() for v in values) and not is_stuck(pose, self._pose):
            self._pose, self._frame = pose, frame_of(message)
            self._received_ns = self.get_clock().now_ns()

    def _on_trajectory(self, message: MultiDOFJointTrajectory) -> None:
        if frame_of(message) != self._frame:
            self._publish_status(
                "refused", f"plans are in '{self._frame}', not '{frame_of(message)}'"
            )
            return
        samples = samples_of(message)
        if samples is None:
            self._publish_status(
                "refused", "a plan without points, or with values that are not finite"
            )
            return
        self._next = samples

    def _on_pause(self, message: Bool) -> None:
        self._paused = bool(message.data)
        self._plan = self._next = None
        if self._paused:
            self._publish_status("paused", "")

    def _on_timer(self) -> None:
        if self._paused:
            return
        now = self.get_clock().now_ns()
        if self._next is not None and self._next.time_ns[0] <= now:
            self._plan, self._next = self._next, None
        if self._plan is None or self._pose is None:
            return
        if not 0 <= now - self._received_ns <= _STALE_S * NS_PER_S:
            self._publish_status("stopped", "no odometry")
            self._command.publish(Twist(Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
            return
        self._fly(self._plan, self._pose, now)

    def _fly(self, plan: TrajectorySamples, pose: OdometrySample, now: int) -> None:
        setpoint, _ = plan.at(now)
        _, velocity = plan.at(now + self._lookahead_ns)
        off = setpoint - pose.position_at(now)
        if norm(off) > _OFF_M:
            self._publish_status("stopped", "too far from the plan")
            velocity, off = np.zeros(3), np.zeros(3)
        else:
            self._publish_status("flying", "")
        x, y, z = (velocity + self._gain * off).tolist()
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        turn = math.remainder(plan.yaw - pose.yaw, 2.0 * math.pi)
        rate = max(-_TURN_RAD_S, min(_TURN_RAD_S, _TURN_GAIN * turn))
        self._command.publish(
            Twist(Vector3(c * x + s * y, c * y - s * x, z), Vector3(0.0, 0.0, rate))
        )

    def _publish_status(self, state: str, reason: str) -> None:
        status = {"state": state, "reason": reason}
        self._last_status = publish_status(self._status, status, self._last_status)
