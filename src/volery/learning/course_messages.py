"""Publishes the goal and the course of an episode to the node `policy` of a full simulation."""

from __future__ import annotations

import math

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, ns_from_s
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import (
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
    PathMessage,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    Twist,
    Vector3,
    header,
    message_type,
)
from volery.learning.flight import Flight
from volery.learning.task import Task
from volery.learning.terms.gates import GATES
from volery.learning.terms.lines import LINE
from volery.learning.terms.observations import GOAL
from volery.learning.terms.trajectories import CURVE, curve_motion
from volery.runtime.simulation import Simulation

_MAP = "map"
_SAMPLE_S = 0.02
"""Time between the samples of a trajectory."""


class CourseMessages:
    """The messages of one UAV's episodes; made with the simulation, used for all its episodes."""

    def __init__(self, simulation: Simulation, task: Task) -> None:
        self._simulation = simulation
        node = f"/{simulation.vehicles.names[0]}/policy"
        advertise = simulation.graph.advertise
        self._goal = advertise(f"{node}/goal_pose", PoseStamped)
        self._line = advertise(f"{node}/line_pose", PoseStamped)
        self._gates = advertise(f"{node}/gates", PathMessage)
        self._trajectory = advertise(f"{node}/trajectory", MultiDOFJointTrajectory)
        self._length_s = task.episode_s + _max_lookahead_s(task)

    def begin(self, flight: Flight) -> None:
        """Publishes the course of a new episode: line, gates or trajectory."""
        values, now_ns = flight.values, self._simulation.time_ns
        if LINE in values:
            x, y, c, s = values[LINE][0, 0].tolist()
            line = zero_message("geometry_msgs/msg/PoseStamped")
            line.header.frame_id = _MAP
            line.pose = _pose(np.array([x, y, 0.0, math.atan2(s, c)]))
            self._line.publish(line)
        if GATES in values:
            self._gates.publish(path_of(values[GATES][0], now_ns))
        if CURVE in values:
            message = trajectory_of(values[CURVE][:1], self._length_s, now_ns)
            self._trajectory.publish(message)

    def publish_goal(self, flight: Flight) -> None:
        """Publishes the present goal, if the task has one."""
        if GOAL in flight.values:
            message = zero_message("geometry_msgs/msg/PoseStamped")
            message.header.frame_id = _MAP
            message.pose.position = Point(*flight.values[GOAL][0, 0].tolist())
            self._goal.publish(message)


def path_of(gates: Array, time_ns: int) -> PathMessage:
    """Returns gates (G, 4), x, y, z and yaw, as a path."""
    own = header(time_ns, _MAP)
    return PathMessage(own, [PoseStamped(own, _pose(gate)) for gate in gates])


def trajectory_of(curve: Array, length_s: float, begins_ns: int) -> MultiDOFJointTrajectory:
    """Returns samples of a curve (1, 4, 3) (`terms.trajectories.CURVE`) as a trajectory."""
    count = math.ceil(length_s / _SAMPLE_S) + 1
    time_s: Array = _SAMPLE_S * np.arange(count, dtype=np.float64)
    position, velocity = curve_motion(curve, time_s[None])
    duration = message_type("builtin_interfaces/msg/Duration")
    nothing, level = Vector3(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)
    points = [
        MultiDOFJointTrajectoryPoint(
            [Transform(Vector3(*p), level)],
            [Twist(Vector3(*v), nothing)],
            [],
            duration(*divmod(ns_from_s(float(time)), NS_PER_S)),
        )
        for time, p, v in zip(time_s, position[0].tolist(), velocity[0].tolist(), strict=True)
    ]
    return MultiDOFJointTrajectory(header(begins_ns, _MAP), ["base_link"], points)


def _max_lookahead_s(task: Task) -> float:
    ahead = (part.parameters.get("ahead_s", [0.0]) for part in task.observations)
    return float(max(max(times) for times in ahead))


def _pose(waypoint: Array) -> Pose:
    """Returns the pose of (x, y, z, yaw)."""
    attitude = rotations.from_yaw(math.remainder(float(waypoint[3]), math.tau))
    return Pose(Point(*waypoint[:3].tolist()), Quaternion(*attitude.tolist()))
