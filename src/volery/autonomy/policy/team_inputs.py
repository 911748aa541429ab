"""Receives what policies of teams observe: the odometry of neighbours, and vertical posts."""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np

from volery.autonomy.perception.map_frame import MapFrame
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.policy.node_inputs import NodeInput, usable_pose
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import NodeError
from volery.graph.messages import Odometry, TFMessage
from volery.graph.nodes.node import Node

_MAX_DISTANCE_M = 1e6


class NeighboursInput(NodeInput):
    """Poses of other UAVs in the map; one whose odometry is too old is not there."""

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "_poses", "_times_ns")
    what = "neighbours"
    expires = False

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        names = node.declare_parameter("neighbours", ["uav2"]).value
        if not all(isinstance(name, str) and name.isidentifier() for name in names):
            raise NodeError(f"neighbours must be names of UAVs, not {names!r}")
        self._poses: dict[str, OdometrySample] = {}
        self._times_ns: dict[str, int] = {}
        self._frames = {name: MapFrame() for name in names}
        for name in names:
            node.create_subscription(Odometry, f"/{name}/odom", partial(self._on_odometry, name), 5)
        node.create_subscription(TFMessage, "/tf", self._on_tf, 50)
        self._accept()

    def present(self) -> list[OdometrySample]:
        """Returns the poses of those whose odometry is not too old."""
        now_ns = self._node.get_clock().now_ns()
        limit_ns = self._timeout_s * NS_PER_S
        return [
            pose
            for name, pose in self._poses.items()
            if 0 <= now_ns - self._times_ns[name] <= limit_ns
        ]

    def _on_odometry(self, name: str, message: Odometry) -> None:
        pose, problem = usable_pose(self._frames[name].pose_in_map(message))
        if pose is None:
            self._refuse(f"of {name}: odometry {problem}")
        else:
            self._poses[name] = pose
            self._times_ns[name] = self._node.get_clock().now_ns()
            self._accept()

    def _on_tf(self, message: TFMessage) -> None:
        for frame in self._frames.values():
            frame.on_tf(message)


class PostsInput(NodeInput):
    """Vertical posts, the parameter `posts`: [x, y, radius] in the map, m."""

    what = "posts"
    expires = False

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        value = node.declare_parameter("posts", []).value
        try:
            posts = np.asarray(value, np.float64).reshape(-1, 3)
        except (TypeError, ValueError):
            posts = np.full((1, 3), np.nan)
        if not np.isfinite(posts).all() or np.abs(posts).max(initial=0.0) > _MAX_DISTANCE_M:
            raise NodeError(f"posts must be a list of [x, y, radius], m, not {value!r}")
        self.posts: Array = posts
        """(P, 3) x, y and radius, m, map."""
        self._accept()
