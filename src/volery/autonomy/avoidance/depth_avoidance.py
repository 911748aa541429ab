"""Avoidance by the whole depth image: every pixel becomes an obstacle in a rolling map.

The path leads through the gaps between the obstacles of the last seconds (`gap_steering`). If it
leaves the field of view, the UAV first turns towards it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.autonomy.avoidance.depth_course import DepthCourse
from volery.autonomy.avoidance.gap_steering import GapSteering, SpeedLimits
from volery.autonomy.avoidance.obstacle_memory import ObstacleMemory
from volery.autonomy.perception.depth_projection import DepthProjector
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.graph.messages import CameraInfo, Image

_MIN_HEIGHT_M = 0.5
"""Min height above the take-off position; lower points are ground and herbs."""
_SLAB_M = 0.9
"""Height difference to the UAV within which points are obstacles."""
_ASIDE_M_S = 0.15
"""Speed during a turn towards the path."""


class DepthAvoidance(DepthCourse):
    """Flies a course (see `DepthCourse`) around all obstacles that its camera has observed.

    Parameters
    ----------
    safe_radius_m: min distance between the UAV's centre and obstacles.
    deceleration_m_s2: braking that limits the speed.
    horizontal_fov_deg: usable horizontal field of view.

    """

    STATE = (*DepthCourse.STATE, "_obstacles", "_steering")

    WARMUP_TASKS = (
        "volery.autonomy.perception.warmup:depth_points",
        "volery.autonomy.avoidance.warmup:gaps",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("depth_avoidance", **options)
        radius = float(self.declare_parameter("safe_radius_m", 0.9).value)
        deceleration = float(self.declare_parameter("deceleration_m_s2", 1.5).value)
        view = math.radians(self.declare_parameter("horizontal_fov_deg", 70.0).value)
        self._steering = GapSteering(SpeedLimits(radius, deceleration, view / 2.0, _ASIDE_M_S))
        self._obstacles = ObstacleMemory(keep_s=20.0)
        self._projector = DepthProjector(self.mount)

    def look(self, image: Image, info: CameraInfo, pose: OdometrySample) -> None:
        """Stores the obstacles of an image at flight height."""
        points = self._projector.points(image, info, pose)
        height = points[:, 2]
        in_slab = np.abs(height - pose.position[2]) < _SLAB_M
        above_ground = height > self.ground_height + _MIN_HEIGHT_M
        self._obstacles.add(points[in_slab & above_ground], self.now_ns)

    def steer(self, pose: OdometrySample) -> tuple[Array, float]:
        """Steers through the best gap."""
        goal = self.to_goal(pose)
        return self._steering.steer(pose, goal, self._obstacles, self.now_ns, self.speed)
