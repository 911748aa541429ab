"""Receives scans and images that policies observe, and the line that they follow."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.depth_projection import depth_of
from volery.autonomy.perception.list_parameters import declare_numbers
from volery.autonomy.perception.map_frame import MAP
from volery.autonomy.policy.node_inputs import NodeInput
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import GraphError
from volery.core.vectors import norm
from volery.graph.messages import Image, LaserScan, PoseStamped, frame_of
from volery.graph.nodes.node import Node

_MAX_BEAMS, _MAX_PIXELS = 100_000, 4_000_000


class ScanInput(NodeInput):
    """The last scan of a planar LIDAR on the topic of the parameter `scan`."""

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "ranges", "angles")
    what = "scan"

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        self.ranges: NDArray[np.float32] = np.zeros(0, np.float32)
        """(B,) m; +inf: no echo."""
        self.angles: Array = np.zeros(0)
        """(B,) rad, counter-clockwise from ahead."""
        topic = str(node.declare_parameter("scan", "laser/horizontal/scan").value)
        node.create_subscription(LaserScan, topic, self._on_scan, 1)

    def _on_scan(self, scan: LaserScan) -> None:
        count = len(scan.ranges)
        angles: Array = scan.angle_min + scan.angle_increment * np.arange(count, dtype=np.float64)
        if not 0 < count <= _MAX_BEAMS or not scan.angle_increment > 0.0:
            self._refuse("has no beams, or angles that do not increase")
        elif not np.isfinite(angles).all() or np.isnan(scan.ranges).all():
            self._refuse("is not finite")
        else:
            self.ranges, self.angles = np.asarray(scan.ranges, np.float32), angles
            self._accept()


class DepthInput(NodeInput):
    """The last depth image on the topic of the parameter `depth`."""

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "depth")
    what = "depth image"

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        self.depth: NDArray[np.float32] = np.zeros((0, 0), np.float32)
        """(H, W) m; NaN: unknown."""
        topic = str(node.declare_parameter("depth", "camera/depth").value)
        node.create_subscription(Image, topic, self._on_image, 1)

    def _on_image(self, image: Image) -> None:
        if not 0 < image.height * image.width <= _MAX_PIXELS:
            self._refuse("has no pixels, or too many")
            return
        try:
            self.depth = np.array(depth_of(image))
        except (GraphError, ValueError) as error:
            self._refuse(f"cannot be read: {error}")
        else:
            self._accept()


class ColourInput(NodeInput):
    """The last colour image, rgb8 or bgr8, on the topic of the parameter `image`."""

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "colour")
    what = "colour image"

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        self.colour: NDArray[np.uint8] = np.zeros((0, 0, 3), np.uint8)
        """(H, W, 3) red, green, blue."""
        topic = str(node.declare_parameter("image", "camera/image_raw").value)
        node.create_subscription(Image, topic, self._on_image, 1)

    def _on_image(self, image: Image) -> None:
        size = image.height * image.width * 3
        if image.encoding not in ("rgb8", "bgr8"):
            self._refuse(f"must be rgb8 or bgr8, not '{image.encoding[:40]}'")
        elif not 0 < size <= 3 * _MAX_PIXELS or len(image.data) != size:
            self._refuse("has another number of bytes than pixels")
        else:
            pixels = np.asarray(image.data, np.uint8).reshape(image.height, image.width, 3)
            self.colour = pixels[..., ::-1].copy() if image.encoding == "bgr8" else pixels.copy()
            self._accept()


class LineInput(NodeInput):
    """A straight course: the parameter `line`, [x, y, yaw] of its start in the map, m and rad.

    Poses on `~/line_pose` replace it.
    """

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "start", "yaw")
    what = "line"
    expires = False

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        x, y, self.yaw = declare_numbers(node, "line", [0.0, 0.0, 0.0], "[x, y, yaw]")
        self.start: Array = np.array([x, y])
        """(2,) m, map."""
        self._accept()
        node.create_subscription(PoseStamped, "~/line_pose", self._on_pose, 1)

    def _on_pose(self, message: PoseStamped) -> None:
        p, q = message.pose.position, message.pose.orientation
        attitude, frame = np.array([q.x, q.y, q.z, q.w]), frame_of(message)
        start = np.array([p.x, p.y], np.float64)
        if frame not in ("", MAP):
            self._refuse(f"must be in '{MAP}', not in '{frame[:80]}'")
        elif not np.isfinite(start).all() or not 0.9 < norm(attitude) < 1.1:
            self._refuse("is no pose")
        else:
            self.start, self.yaw = start, float(rotations.yaw_of(attitude))
            self._accept()

    def lateral_m(self, position: Array) -> float:
        """Returns the distance of a position (3,) from the line, m, positive to its left."""
        x, y = (position[:2] - self.start).tolist()
        return float(math.cos(self.yaw) * y - math.sin(self.yaw) * x)
