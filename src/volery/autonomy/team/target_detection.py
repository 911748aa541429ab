"""Detects targets of a colour by the camera; estimates their positions and covariances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.autonomy.perception.map_frame import MapFrame
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.search.colour_blob import ColourRange, colour_mask, largest_blob, pixels_of
from volery.autonomy.search.ground_view import GroundView, Intrinsics, pose_at
from volery.autonomy.team.observations import PositionUncertainty, Tracks, sighting_of
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    CameraInfo,
    Image,
    Odometry,
    Range,
    TFMessage,
    header,
    message_type,
    stamp_of,
)
from volery.graph.nodes.node import Node

_TYPE = "volery_interfaces/msg/Targets"
_MATE_S, _MATE_M = 2.0, 1.0
"""Max age of a teammate's report, s, and radius of the ball around it. Modelling choice."""
_STALE_S = 0.5
"""Max age of odometry and range at the time of an image."""


class TargetDetection(SavedAttributes, Node):
    """Detects patches of a colour, projects them to the ground, publishes `~/targets`.

    Subscribes to `CAMERA/image_raw`, its `camera_info`, odometry, and `range`, the distance to the
    ground below. A target is published once it has been observed several times with a small enough
    covariance, and with each further observation. Image regions that show a teammate, by
    `radio/team`, are excluded.

    Parameters
    ----------
    camera: name of the camera.
    mount_m, mount_rpy_deg: of the camera in the body, as in a scenario.
    odometry: topic of the pose; use_map_tf: whether `/tf` holds the pose of its frame in the map.
    hue_deg: [first, last]; min_saturation, min_value: minimums; see `search.colour_blob`.
    min_fraction: min fraction of the image.
    object_height_m: height of the targets' centre above the ground.
    max_range_m: max horizontal distance of a target.
    min_observations, max_sigma_m: number of observations and standard deviation that confirm a
        target.

    """

    STATE = ("_mates", "_frame", "_pose", "_range", "_intrinsics", "_tracks")
    """Names of the attributes that a snapshot stores."""

    WARMUP_TASKS = ("volery.autonomy.search.warmup:colours",)

    def __init__(self, **options: Any) -> None:
        super().__init__("target_detection", **options)
        declare = self.declare_parameter
        camera = str(declare("camera", "camera").value)
        self._mount = np.array(declare("mount_m", [0.0, 0.0, 0.0]).value, dtype=np.float64)
        self._turn = [float(a) for a in declare("mount_rpy_deg", [0.0, 0.0, 0.0]).value]
        odometry = str(declare("odometry", "odom").value)
        if declare("use_map_tf", False).value:
            self.create_subscription(TFMessage, "/tf", self._on_tf, 50)
        first, last = (float(hue) for hue in declare("hue_deg", list(ColourRange()[:2])).value)
        self._colours = ColourRange(
            first,
            last,
            float(declare("min_saturation", 0.5).value),
            float(declare("min_value", 0.2).value),
        )
        self._min_fraction = float(declare("min_fraction", 0.0005).value)
        self._object_height_m = float(declare("object_height_m", 0.5).value)
        self._max_range_m = float(declare("max_range_m", 20.0).value)
        self._tracks = Tracks(
            int(declare("min_observations", 4).value),
            spread_m=float(declare("max_sigma_m", 2.0).value),
        )
        self._uncertainty = PositionUncertainty()
        self._frame = MapFrame()
        self._mates: dict[str, tuple[int, Array]] = {}
        """Receive time, ns, and position of each teammate's last report."""
        self._pose: OdometrySample | None = None
        self._range: tuple[int, float] | None = None
        self._intrinsics: Intrinsics | None = None

        self._type = message_type(_TYPE)
        self._targets = self.create_publisher(self._type, "~/targets", 1, latched=True)
        self.create_subscription(Odometry, odometry, self._on_odometry, 5)
        self.create_subscription(Range, "range", self._on_range, 5)
        self.create_subscription(CameraInfo, f"{camera}/camera_info", self._on_info, 1)
        self.create_subscription(Image, f"{camera}/image_raw", self._on_image, 1)
        report = message_type("volery_interfaces/msg/TeamReport")
        self.create_subscription(report, "radio/team", self._on_report, 20)

    def _on_tf(self, message: TFMessage) -> None:
        self._frame.on_tf(message)

    def _on_odometry(self, message: Odometry) -> None:
        pose = self._frame.pose_in_map(message)
        self._pose = None if self._frame.is_lost else pose

    def _on_range(self, message: Range) -> None:
        if math.isfinite(message.range):
            self._range = (stamp_of(message), float(message.range))

    def _on_info(self, info: CameraInfo) -> None:
        self._intrinsics = Intrinsics.from_message(info)

    def _on_report(self, report: Any) -> None:
        p = report.position
        position = np.array([p.x, p.y, p.z])
        if np.isfinite(position).all():
            self._mates[report.name] = (self.get_clock().now_ns(), position)

    def _on_image(self, image: Image) -> None:
        taken = stamp_of(image)
        ground = self._ground_z(taken)
        if ground is None or self._pose is None or self._intrinsics is None:
            return
        pose = pose_at(self._pose, taken)
        view = GroundView(self._intrinsics, self._mount.tolist(), self._turn)
        hidden = self._teammates_in(view, pose)
        blob = largest_blob(colour_mask(pixels_of(image), self._colours, hidden))
        if blob is None or blob.fraction < self._min_fraction:
            return
        position = view.position_of(blob.u, blob.v, pose, ground + self._object_height_m)
        if position is None or np.hypot(*(position - pose.position)[:2]) > self._max_range_m:
            return
        eye = pose.position + rotations.rotate(pose.attitude, self._mount)
        track = self._tracks.add(sighting_of(taken, eye, position, self._uncertainty))
        if track.number:
            self._publish_targets(taken)

    def _teammates_in(self, view: GroundView, pose: OdometrySample) -> Array:
        """Returns the image discs (K, 3) of teammates, which may have the colour."""
        since = pose.time_ns - round(_MATE_S * NS_PER_S)
        near = [position for received_ns, position in self._mates.values() if received_ns >= since]
        discs = [view.disc_of(position, _MATE_M, pose) for position in near]
        return np.array([disc for disc in discs if disc is not None]).reshape(-1, 3)

    def _ground_z(self, time_ns: int) -> float | None:
        """Returns the height in the map of the ground below; None if pose or range are too old."""
        if self._pose is None or self._range is None:
            return None
        stale = _STALE_S * NS_PER_S
        range_ns, distance = self._range
        if abs(time_ns - self._pose.time_ns) > stale or abs(time_ns - range_ns) > stale:
            return None
        down = -rotations.rotate(self._pose.attitude, np.array([0.0, 0.0, -1.0]))[2]
        return float(self._pose.position[2] - distance * down)

    def _publish_targets(self, time_ns: int) -> None:
        finder = self.get_namespace().strip("/")
        detections = [detection.message() for detection in self._tracks.detections(finder)]
        self._targets.publish(self._type(header(time_ns, "map"), detections))
