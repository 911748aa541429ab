"""Merges the maps that several UAVs publish."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from volery.autonomy.mapping.merging import PlacedMap, merged
from volery.autonomy.mapping.messages import OCTOMAP, octomap_message, voxels_of
from volery.autonomy.perception.map_frame import MAP
from volery.autonomy.perception.motion_history import Pose
from volery.autonomy.status import publish_status
from volery.core.errors import DataFileError, PlanError
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import String, TFMessage, frame_name, frame_of
from volery.graph.nodes.node import Node


class MapMerging(SavedAttributes, Node):
    """Publishes `~/octomap_binary` (latched, `map`) of all `topics`, and `~/status` (JSON).

    A map in a frame other than `map` is placed by the transform between both in `/tf`; without it
    the map is left out, and the status reports it. Service `~/merge`: merge now.

    Parameters
    ----------
    topics: of the maps, such as `/uav1/octomap_binary`.
    resolution_m: size of their cells; maps of another one are refused.
    period_s: period of merging, after a change.
    max_cells: bound of all maps' known cells together.

    """

    STATE = ("_maps", "_placements", "_changed", "_last_status", "_reasons")

    WARMUP_TASKS = (
        "volery.autonomy.mapping.warmup:read_maps",
        "volery.autonomy.mapping.warmup:merged_maps",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("map_merging", **options)
        self._topics = list(self.declare_parameter("topics", ["/uav1/octomap_binary"]).value)
        self._resolution = float(self.declare_parameter("resolution_m", 0.2, min_value=0.01).value)
        self._max_cells = int(self.declare_parameter("max_cells", 20_000_000, min_value=1).value)
        self._maps: dict[str, Any] = {}
        self._placements: dict[str, Pose] = {}
        self._changed = False
        self._last_status = ""
        self._reasons: dict[str, str] = {}
        self._merged = self.create_publisher(OCTOMAP, "~/octomap_binary", 1, latched=True)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        for topic in self._topics:
            self.create_subscription(OCTOMAP, topic, self._listener(topic), 1)
        self.create_subscription(TFMessage, "/tf", self._on_tf, 50)
        self.create_service("std_srvs/srv/Trigger", "~/merge", self._on_merge)
        self.create_timer(
            float(self.declare_parameter("period_s", 20.0, min_value=0.01).value), self._on_timer
        )

    def _listener(self, topic: str) -> Callable[[Any], None]:
        def on_map(message: Any) -> None:
            self._reasons.pop(topic, None)
            if abs(float(message.resolution) - self._resolution) > 1e-6:
                self._reasons[topic] = (
                    f"cells of {message.resolution:g} m; {self._resolution:g} m are merged"
                )
                self._maps.pop(topic, None)
                return
            self._maps[topic], self._changed = message, True

        return on_map

    def _on_tf(self, message: TFMessage) -> None:
        for stamped in message.transforms:
            if frame_of(stamped) != MAP:
                continue
            p, q = stamped.transform.translation, stamped.transform.rotation
            position, attitude = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
            if np.isfinite(position).all() and abs(norm(attitude) - 1.0) < 0.01:
                self._placements[frame_name(stamped.child_frame_id)] = Pose(position, attitude)

    def _on_timer(self) -> None:
        if self._changed:
            self._merge()

    def _on_merge(self, _request: Any, response: Any) -> Any:
        response.message = self._merge()
        response.success = not response.message
        return response

    def _merge(self) -> str:
        """Merges and publishes; returns the reason of a failure, or ""."""
        self._changed = False
        placed = [found for topic in sorted(self._maps) if (found := self._placed(topic))]
        reason = ""
        try:
            data = merged(placed, self._resolution, self._max_cells)
        except PlanError as error:
            reason = str(error)
        else:
            now = self.get_clock().now_ns()
            self._merged.publish(octomap_message(data, self._resolution, MAP, now))
        self._publish_status(len(placed), reason)
        return reason

    def _placed(self, topic: str) -> PlacedMap | None:
        message = self._maps[topic]
        frame = frame_of(message)
        placement = self._placements.get(frame)
        if frame not in ("", MAP) and placement is None:
            self._reasons[topic] = f"/tf holds no transform of '{frame}' in '{MAP}'"
            return None
        try:
            voxels = voxels_of(message)
        except DataFileError as error:
            self._reasons[topic] = str(error)
            return None
        self._reasons.pop(topic, None)
        return PlacedMap(voxels, placement if frame not in ("", MAP) else None)

    def _publish_status(self, count: int, reason: str) -> None:
        status = {
            "merged": count,
            "reason": reason,
            "left_out": dict(sorted(self._reasons.items())),
        }
        self._last_status = publish_status(self._status, status, self._last_status)
