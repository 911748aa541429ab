"""Subscribes nodes that work in the map to their pose."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.autonomy.perception.map_frame import MapFrame
from volery.graph.messages import Odometry, TFMessage
from volery.graph.nodes.node import Node


def subscribe_odometry(
    node: Node, frame: MapFrame, on_odometry: Callable[[Odometry], Any], depth: int
) -> None:
    """Subscribes `node` to its odometry, and `frame` to `/tf`.

    Declares the parameters `odometry`, the topic, and `use_map_tf`: false if the odometry frame is
    the map's, so that `/tf` is not used.
    """
    topic = str(node.declare_parameter("odometry", "odom").value)
    node.create_subscription(Odometry, topic, on_odometry, depth)
    if node.declare_parameter("use_map_tf", True).value:
        node.create_subscription(TFMessage, "/tf", frame.on_tf, 50)
