"""Avoidance by the whole depth picture: every pixel becomes an obstacle that is remembered.

The way leads through the gaps between what was seen in the last seconds (`gap_steering`); where
that way lies beyond the picture's edge the UAV first turns and looks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.avoidance.depth_course import DepthCourse
from volery.autonomy.avoidance.gap_steering import GapSteering, SpeedLimits
from volery.autonomy.avoidance.obstacle_memory import ObstacleMemory
from volery.autonomy.perception.depth_projection import DepthProjector
from volery.autonomy.perception.scan_points import OdometrySample
from volery.graph.messages import CameraInfo, Image

Array = NDArray[np.float64]

_LEAST_HEIGHT_M = 0.5
"""Above the place of take-off; what is lower is ground and herbs."""
_SLAB_M = 0.9
"""So far above and below the UAV things are in its way."""
_ASIDE_M_S = 0.15
"""Speed while it looks to where it wants to go."""


class DepthAvoidance(DepthCourse):
    """Flies a course (see `DepthCourse`) around all that its camera has seen.

    Parameters
    ----------
    safe_radius_m: distance to keep between the UAV's centre and obstacles.
    deceleration_m_s2: braking that the speed counts on.
    view_deg: horizontal field of view that may be trusted.

    """

    STATE = ("_obstacles", "_steering")

    @classmethod
    def warmup_tasks(cls) -> Sequence[Callable[[], None]]:
        """Returns the tasks that compile its kernels."""
        from volery.autonomy.avoidance.warmup import gaps
        from volery.autonomy.perception import warmup

        return warmup.depth_points, gaps

    def __init__(self, **options: Any) -> None:
        super().__init__("depth_avoidance", **options)
        radius = float(self.declare_parameter("safe_radius_m", 0.9).value)
        deceleration = float(self.declare_parameter("deceleration_m_s2", 1.5).value)
        view = math.radians(self.declare_parameter("view_deg", 70.0).value)
        self._steering = GapSteering(SpeedLimits(radius, deceleration, view / 2.0, _ASIDE_M_S))
        self._obstacles = ObstacleMemory(keep_s=20.0)
        self._projector = DepthProjector(self.mount)

    def look(self, image: Image, info: CameraInfo, pose: OdometrySample) -> None:
        """Remember what the picture shows at the height of flight."""
        points = self._projector.points(image, info, pose)
        height = points[:, 2]
        in_the_way = np.abs(height - pose.position[2]) < _SLAB_M
        above_ground = height > self.ground_height + _LEAST_HEIGHT_M
        self._obstacles.add(points[in_the_way & above_ground], self.now_ns)

    def steer(self, pose: OdometrySample) -> tuple[Array, float]:
        """Through the best gap."""
        goal = self.to_goal(pose)
        return self._steering.steer(pose, goal, self._obstacles, self.now_ns, self.speed)
