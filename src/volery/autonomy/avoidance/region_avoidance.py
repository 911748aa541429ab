"""Avoidance by the mean depth of one image region, a machine of four states.

As described by the ROS + Unity3D platform of 2025: fly FORWARD until the mean depth of the region
of interest falls below a threshold, be STOPPED, AVOID until the path is free, RETURN to the course.
Its example threshold, .03, is of normalised depth, without its far plane. Here depth is normalised
by `max_depth_m`; the defaults are the best of five, see docs/avoidance.md.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Any

import numpy as np

from volery.autonomy.avoidance.depth_course import DepthCourse
from volery.autonomy.avoidance.gaps import wrap
from volery.autonomy.perception.depth_projection import depth_of, mean_depth, region_of
from volery.autonomy.perception.list_parameters import declare_numbers
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.core.errors import NodeError
from volery.graph.messages import CameraInfo, Image

_STILL_M_S = 0.2
_BACK_M = 0.3
"""Distance to the course at which the UAV has returned."""
_GIVE_UP_S = 15.0
"""Time on one side after which it tries the other."""


class RegionAvoidanceState(StrEnum):
    """States of the machine."""

    FORWARD = "forward"
    STOPPED = "stopped"
    AVOID = "avoid"
    RETURN = "return"


class RegionAvoidance(DepthCourse):
    """Flies a course (see `DepthCourse`); sidesteps obstacles in the region of interest.

    Parameters
    ----------
    max_depth_m: depth that counts 1, m; larger depths count 1 too.
    threshold: mean of the region, as a fraction of `max_depth_m`, below which it is blocked.
    region: [width, height] of the region of interest, fractions of the image, in its centre.
    lateral_speed_m_s: lateral speed.
    margin_s: time for which the sidestep continues after the path is free.

    """

    STATE = (
        *DepthCourse.STATE,
        "_state",
        "_mean",
        "_sides",
        "_side",
        "_since_ns",
        "_free_ns",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("region_avoidance", **options)
        self._far = float(
            self.declare_parameter("max_depth_m", 10.0, min_value=0.1, max_value=1e4).value
        )
        self._threshold = float(
            self.declare_parameter("threshold", 0.6, min_value=0.0, max_value=1.0).value
        )
        self._region = declare_numbers(self, "region", [0.3, 0.2], "[width, height]")
        if not all(0.0 < fraction <= 1.0 for fraction in self._region):
            raise NodeError(
                f"region must be [width, height], each above 0 and at most 1, not {self._region}"
            )
        self._sidestep = float(
            self.declare_parameter("lateral_speed_m_s", 0.8, min_value=0.0, max_value=100.0).value
        )
        self._margin_ns = round(
            1e9 * self.declare_parameter("margin_s", 1.0, min_value=0.0, max_value=1e4).value
        )
        self._state = RegionAvoidanceState.FORWARD
        self._mean = 1.0
        self._sides = (1.0, 1.0)
        self._side = 1.0
        self._since_ns = 0
        self._free_ns = 0

    @property
    def doing(self) -> str:
        """State of the machine."""
        return str(self._state)

    def look(self, image: Image, info: CameraInfo, pose: OdometrySample) -> None:  # noqa: ARG002
        """Computes the mean depth of the region, and of the halves of the image."""
        depth = depth_of(image)
        width, height = self._region
        self._mean = mean_depth(region_of(depth, width, height), self._far)
        left, right = region_of(depth, 0.5, height, -0.25), region_of(depth, 0.5, height, 0.25)
        self._sides = mean_depth(left, self._far), mean_depth(right, self._far)

    def steer(self, pose: OdometrySample) -> tuple[Array, float]:
        """Runs one step of the machine."""
        blocked = self._mean < self._threshold
        self._change(blocked, pose)
        aside = self.aside(pose)
        ahead, left = {
            RegionAvoidanceState.FORWARD: (self.speed, 0.0),
            RegionAvoidanceState.STOPPED: (0.0, 0.0),
            RegionAvoidanceState.AVOID: (0.0, self._side * self._sidestep),
            RegionAvoidanceState.RETURN: (
                self.speed,
                -math.copysign(min(abs(aside), self._sidestep), aside),
            ),
        }[self._state]
        c, s = math.cos(self.course), math.sin(self.course)
        turn = float(wrap(np.array(self.course - pose.yaw)))
        return np.array([c * ahead - s * left, s * ahead + c * left]), max(-1.0, min(1.0, turn))

    def _change(self, blocked: bool, pose: OdometrySample) -> None:
        now = self.now_ns
        if self._state in (RegionAvoidanceState.FORWARD, RegionAvoidanceState.RETURN):
            if blocked:
                self._enter(RegionAvoidanceState.STOPPED)
            elif abs(self.aside(pose)) < _BACK_M:
                self._state = RegionAvoidanceState.FORWARD
        elif self._state is RegionAvoidanceState.STOPPED:
            if float(np.hypot(*pose.velocity[:2])) < _STILL_M_S:
                self._side = 1.0 if self._sides[0] >= self._sides[1] else -1.0
                self._enter(RegionAvoidanceState.AVOID)
        elif blocked:
            self._free_ns = now
            if now - self._since_ns > _GIVE_UP_S * 1e9:
                self._side = -self._side
                self._since_ns = now
        elif now - self._free_ns > self._margin_ns:
            self._enter(RegionAvoidanceState.RETURN)

    def _enter(self, state: RegionAvoidanceState) -> None:
        self._state, self._since_ns, self._free_ns = state, self.now_ns, self.now_ns
