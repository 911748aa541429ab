"""Flight through gaps: the common part of nodes that fly in a forest by LIDARs, sonar and odometry.

The level scan shows the surroundings at flight height 40 times a second, the nodding scan covers
the space above and below. Returns become points in the odometry frame. The ground's slope is fitted
to the lowest ones; points near the flight height become obstacles. The heading leads through the
best gap towards the goal, at a speed that allows the UAV to stop at the end of the gap. Unconfirmed
returns are removed: rain, snow, fog. Sonar and slope control the height above ground.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from volery.autonomy.avoidance.gap_steering import GapSteering, SpeedLimits
from volery.autonomy.avoidance.obstacle_memory import ObstacleMemory
from volery.autonomy.perception.ground_plane import GroundPlane
from volery.autonomy.perception.list_parameters import declare_mount
from volery.autonomy.perception.scan_points import OdometrySample, ScanProjector
from volery.autonomy.perception.speckle_filter import SpeckleFilter
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import JointState, LaserScan, Odometry, Range, Twist, Vector3
from volery.graph.nodes.node import Node

_SONAR_MEMORY_S = 0.5


class GapFlight(SavedAttributes, Node):
    """Subscribes to scans, range and odometry, and commands `cmd_vel`; a subclass sets the goal.

    Parameters
    ----------
    height_m: height above ground to fly at.
    speed_m_s: max speed.
    safe_radius_m: min distance between the UAV's centre and obstacles.
    deceleration_m_s2: braking that limits the speed.
    odometry: topic of the pose.
    nodding_mount, level_mount: [x, y, z] of the LIDARs in the body, m.

    `height_m` and `speed_m_s` may be set in flight.

    """

    STATE: ClassVar[tuple[str, ...]] = (
        "_pose",
        "_joint",
        "_range",
        "_ground",
        "_obstacles",
        "_steering",
        "_low_obstacles",
        "_level_filter",
        "_nodding_filter",
    )
    """Names of the attributes that a snapshot stores."""

    WARMUP_TASKS = (
        "volery.autonomy.perception.warmup:scan_points",
        "volery.autonomy.perception.warmup:ground",
        "volery.autonomy.avoidance.warmup:gaps",
    )

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        odometry = str(self.declare_parameter("odometry", "odom").value)
        self._height_m = self.declare_parameter("height_m", 3.0, min_value=0.1, read_only=False)
        self._speed_m_s = self.declare_parameter("speed_m_s", 3.0, min_value=0.1, read_only=False)
        radius = float(self.declare_parameter("safe_radius_m", 1.1, min_value=0.05).value)
        deceleration = float(self.declare_parameter("deceleration_m_s2", 2.0, min_value=0.1).value)
        self._steering = GapSteering(SpeedLimits(radius, deceleration))
        self._level = ScanProjector(declare_mount(self, "level"))
        self._nodding = ScanProjector(declare_mount(self, "nodding"))
        self._pose: OdometrySample | None = None
        self._joint: tuple[int, float, float] | None = None
        self._range: tuple[int, float] | None = None
        self._ground = GroundPlane()
        self._obstacles = ObstacleMemory()
        self._low_obstacles = ObstacleMemory(half_width_m=10.0, looks_needed=3)
        self._level_filter, self._nodding_filter = SpeckleFilter(), SpeckleFilter()

        for kind, topic, update in (
            (Odometry, odometry, self._on_odometry),
            (LaserScan, "laser/horizontal/scan", self._on_level_scan),
            (LaserScan, "laser/nodding/scan", self._on_nodding_scan),
            (JointState, "joint_states", self._on_joint),
            (Range, "range", self._on_range),
        ):
            self.create_subscription(kind, topic, update, 5, passive=True)
        self._command = self.create_publisher(Twist, "cmd_vel", 1)

    @property
    def _height(self) -> float:
        return float(self._height_m.value)

    # ------------------------------------------------------------------------------ subscriptions

    def _on_odometry(self, message: Odometry) -> None:
        self._pose = OdometrySample.from_odometry(message)

    def _on_joint(self, message: JointState) -> None:
        if message.name[0] != "laser_nodding":
            return
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        self._joint = (stamp, float(message.position[0]), float(message.velocity[0]))

    def _on_range(self, message: Range) -> None:
        if math.isfinite(message.range):
            self._range = (self.get_clock().now_ns(), message.range)

    def _on_level_scan(self, scan: LaserScan) -> None:
        scan = self._level_filter.left_out(scan)
        if self._pose is not None:
            self._remember(self._level.points(scan, self._pose))

    def _on_nodding_scan(self, scan: LaserScan) -> None:
        scan = self._nodding_filter.left_out(scan)
        if self._pose is not None and self._joint is not None:
            self._remember(self._nodding.points(scan, self._pose, self._joint))

    def _remember(self, points: Array) -> None:
        now = self.get_clock().now_ns()
        self._ground.add(points, now)
        above_ground = points[:, 2] - self._ground.height_at(points[:, :2])
        near_flight_height = np.abs(above_ground - self._height) < 1.1
        tall = above_ground > 0.7
        self._obstacles.add(points[near_flight_height & tall], now)
        below = tall & (above_ground < self._height)
        self._low_obstacles.add(points[below], now)

    # ----------------------------------------------------------------------------------- steering

    def _go_towards(self, pose: OdometrySample, to_goal: Array) -> None:
        now, top_speed = self.get_clock().now_ns(), float(self._speed_m_s.value)
        velocity, yaw_rate = self._steering.steer(pose, to_goal, self._obstacles, now, top_speed)
        self._publish(pose, velocity, yaw_rate)

    # ------------------------------------------------------------------------------ height control

    def _refit_ground(self, pose: OdometrySample) -> None:
        self._ground.fit(pose.position, self._ground_below(pose), self.get_clock().now_ns())

    def _ground_below(self, pose: OdometrySample) -> float | None:
        if self._range is None:
            return None
        time_ns, distance = self._range
        if self.get_clock().now_ns() - time_ns > _SONAR_MEMORY_S * 1e9:
            return None
        return float(pose.position[2]) - distance

    def _publish(self, pose: OdometrySample, velocity: Array, yaw_rate: float) -> None:
        """Commands a level velocity (odometry frame) and the climb rate that holds the height."""
        above = float(pose.position[2]) - float(self._ground.height_at(pose.position[:2]))
        climb = 1.2 * (self._height - above) + float(velocity @ self._ground.slope)
        climb = max(-1.0, min(2.0, climb))
        forward = rotations.rotate(rotations.from_yaw(-pose.yaw), [*velocity, 0.0])
        self._command.publish(
            Twist(Vector3(float(forward[0]), float(forward[1]), climb), Vector3(0.0, 0.0, yaw_rate))
        )
