"""A straight course with a depth camera: the common part of its nodes, without avoidance."""

from __future__ import annotations

import math
from abc import abstractmethod
from enum import StrEnum
from typing import Any, ClassVar

import numpy as np

from volery.autonomy.avoidance.stop import Stop
from volery.autonomy.perception.list_parameters import declare_numbers
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import CameraInfo, Image, Odometry, String, Twist, Vector3
from volery.graph.nodes.node import Node

_PERIOD_S = 0.05
_BLIND_AFTER_S = 0.5
"""Time without an image after which the UAV stops."""


class DepthCoursePhase(StrEnum):
    """Phase of the course."""

    START = "start"
    CLIMB = "climb"
    FLY = "fly"
    LAND = "land"


class DepthCourse(SavedAttributes, Node):
    """Takes off, flies `distance_m` ahead at a height, stops and lands.

    It uses a depth camera and odometry.

    Parameters
    ----------
    distance_m: length of the course, along the heading at take-off.
    height_m: height above the take-off position.
    speed_m_s: speed along the course.
    camera: name of the depth camera, whose topics are `CAMERA/depth` and `CAMERA/camera_info`.
    mount: [x, y, z] of the camera in the body, m; it faces forward.

    """

    STATE: ClassVar[tuple[str, ...]] = (
        *("phase", "pose", "_home", "_course", "_image_ns", "_info", "_stop"),
    )

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self._distance = float(
            self.declare_parameter("distance_m", 50.0, min_value=0.0, max_value=1e5).value
        )
        self._height = float(
            self.declare_parameter("height_m", 2.0, min_value=0.1, max_value=1e4).value
        )
        self.speed = float(
            self.declare_parameter("speed_m_s", 2.0, min_value=0.01, max_value=100.0).value
        )
        camera = self.declare_parameter("camera", "camera").value
        self.mount = declare_numbers(self, "mount", [0.0, 0.0, 0.0], "[x, y, z]")

        self.phase = DepthCoursePhase.START
        self.pose: OdometrySample | None = None
        self._home = np.zeros(3)
        self._course = 0.0
        self._stop = Stop()
        self._image_ns: int | None = None
        self._info: CameraInfo | None = None

        self.create_subscription(Odometry, "odom", self._on_odometry, 5, passive=True)
        info, depth = f"{camera}/camera_info", f"{camera}/depth"
        self.create_subscription(CameraInfo, info, self._on_info, 1, passive=True)
        self.create_subscription(Image, depth, self._on_image, 1, passive=True)
        self._command = self.create_publisher(Twist, "cmd_vel", 1)
        self._status = self.create_publisher(String, "~/phase", 1)
        self._take_off = self.create_client("std_srvs/srv/Trigger", "take_off")
        self._land = self.create_client("std_srvs/srv/Trigger", "land")
        self.create_timer(_PERIOD_S, self._on_timer)

    @abstractmethod
    def look(self, image: Image, info: CameraInfo, pose: OdometrySample) -> None:
        """Processes a depth image; publishes and calls nothing."""

    @abstractmethod
    def steer(self, pose: OdometrySample) -> tuple[Array, float]:
        """Returns velocity (2,) m/s in the odometry frame and yaw rate, rad/s, on the course."""

    @property
    def doing(self) -> str:
        """Value of `~/phase` on the course."""
        return str(self.phase)

    # --------------------------------------------------------------------------------- the course

    @property
    def now_ns(self) -> int:
        """Time of the node's clock, ns."""
        return self.get_clock().now_ns()

    @property
    def ground_height(self) -> float:
        """Height of the take-off position, m in the odometry frame."""
        return float(self._home[2])

    @property
    def course(self) -> float:
        """Heading of the course, rad in the odometry frame."""
        return self._course

    def to_goal(self, pose: OdometrySample) -> Array:
        """Returns the end of the course, (2,) m from the UAV, odometry frame."""
        end = self._home[:2] + self._distance * self._ahead
        return np.asarray(end - pose.position[:2])

    def aside(self, pose: OdometrySample) -> float:
        """Returns the distance of the UAV to the left of the course, m."""
        offset = pose.position[:2] - self._home[:2]
        return float(self._ahead[0] * offset[1] - self._ahead[1] * offset[0])

    @property
    def _ahead(self) -> Array:
        return np.array([math.cos(self._course), math.sin(self._course)])

    # ------------------------------------------------------------------------------------ behaviour

    def _on_odometry(self, message: Odometry) -> None:
        self.pose = OdometrySample.from_odometry(message)

    def _on_info(self, message: CameraInfo) -> None:
        self._info = message

    def _on_image(self, image: Image) -> None:
        if self.pose is not None and self._info is not None:
            self._image_ns = self.now_ns
            self.look(image, self._info, self.pose)

    def _on_timer(self) -> None:
        pose = self.pose
        if pose is None:
            return
        if self.phase is DepthCoursePhase.START:
            if self._take_off.service_is_ready() and self._take_off.call().success:
                self._home, self._course = pose.position.copy(), pose.yaw
                self.phase = DepthCoursePhase.CLIMB
        elif self.phase is DepthCoursePhase.CLIMB:
            climbed = float(pose.position[2] - self._home[2])
            if climbed > 1.0 and (abs(pose.velocity[2]) < 0.1 or climbed > self._height - 0.3):
                self.phase = DepthCoursePhase.FLY
        elif self.phase is DepthCoursePhase.FLY:
            self._fly(pose)
        if self._status.has_subscribers:
            self._status.publish(
                String(self.doing if self.phase is DepthCoursePhase.FLY else str(self.phase))
            )

    def _fly(self, pose: OdometrySample) -> None:
        if float(self.to_goal(pose) @ self._ahead) < 0.0:
            self._stop.begin(self.now_ns)
        if self._stop.is_over(pose, self.now_ns) and self._land.call().success:
            self.phase = DepthCoursePhase.LAND
            return
        sees = self._image_ns is not None and self.now_ns - self._image_ns < _BLIND_AFTER_S * 1e9
        flies_on = sees and not self._stop.has_begun
        velocity, yaw_rate = self.steer(pose) if flies_on else (np.zeros(2), 0.0)
        climb = 1.2 * (self._home[2] + self._height - float(pose.position[2]))
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        forward, left = c * velocity[0] + s * velocity[1], c * velocity[1] - s * velocity[0]
        linear = Vector3(float(forward), float(left), float(max(-1.0, min(1.0, climb))))
        self._command.publish(Twist(linear, Vector3(0.0, 0.0, float(yaw_rate))))
