"""Detects AprilTags in the images of a camera and publishes their poses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.tags.detector import DetectedTag, TagDetector, grey_of
from volery.autonomy.perception.tags.tag_messages import DETECTIONS_TYPE, detection, transform
from volery.autonomy.perception.tags.tag_pose import TagPose, position_covariance, tag_pose
from volery.core.arrays import Array
from volery.core.errors import GraphError, NodeError
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import CameraInfo, Image, TFMessage, message_type
from volery.graph.nodes.node import Node

_MAX_ID = 586


class TagDetection(SavedAttributes, Node):
    """Detects tags of family 36h11 and publishes `~/detections` for every image.

    Subscribes to `CAMERA/image_raw` (rgb8, bgr8 or mono8) and `CAMERA/camera_info`. Poses are in
    the optical frame of the camera: see `tag_pose`. An image without tags is an empty array.

    Parameters
    ----------
    camera: name of the camera.
    size_m: side of the tags' black border.
    ids: numbers of the tags to publish; empty: all.
    min_side_px: min side of a tag in the image.
    max_error_px: max reprojection error of a pose.
    corner_sigma_px: standard deviation of a corner, for covariances.
    publish_tf: whether transforms to frames `UAV/tag_ID` are published on `/tf`.

    """

    STATE = ("_matrix", "_distortion")
    """Names of the attributes that a snapshot stores."""

    def __init__(self, **options: Any) -> None:
        super().__init__("tag_detection", **options)
        declare = self.declare_parameter
        camera = str(declare("camera", "camera").value)
        self._size_m = declare("size_m", 0.5, min_value=0.01, max_value=20.0)
        self._ids = _numbers(declare("ids", []).value)
        self._min_side_px = declare("min_side_px", 8.0, min_value=0.0, max_value=1e4)
        self._max_error_px = declare("max_error_px", 2.0, min_value=0.01, max_value=100.0)
        self._sigma_px = declare("corner_sigma_px", 0.3, min_value=0.001, max_value=100.0)
        self._tf: Any = None
        if declare("publish_tf", False).value:
            self._tf = self.create_publisher(TFMessage, "/tf", 10)
        self._detector = TagDetector()
        self._matrix: Array | None = None
        self._distortion: Array | None = None
        self._type = message_type(DETECTIONS_TYPE)
        self._detections = self.create_publisher(self._type, "~/detections", 1)
        self.create_subscription(CameraInfo, f"{camera}/camera_info", self._on_info, 1)
        self.create_subscription(Image, f"{camera}/image_raw", self._on_image, 1)

    def _on_info(self, info: CameraInfo) -> None:
        matrix = np.array(info.k, np.float64).reshape(3, 3)
        lens = np.array(info.d, np.float64)
        if not (np.isfinite(matrix).all() and matrix[0, 0] > 0.0 and matrix[1, 1] > 0.0):
            raise GraphError("camera_info holds no focal length: the camera is not calibrated")
        if info.distortion_model not in ("", "plumb_bob") or len(lens) not in (0, 4, 5):
            raise GraphError(
                f"camera_info has the distortion model '{info.distortion_model}' with {len(lens)} "
                "coefficients; plumb_bob with 5 is needed"
            )
        if not np.isfinite(lens).all():
            raise GraphError("camera_info has distortion coefficients that are not finite")
        self._matrix, self._distortion = matrix, lens if len(lens) else None

    def _on_image(self, image: Image) -> None:
        if self._matrix is None:
            return
        found = []
        for tag in self._detector.detect(grey_image(image)):
            pose = self._pose_of(tag)
            if pose is None:
                continue
            covariance = position_covariance(
                pose, tag, float(self._matrix[0, 0]), float(self._sigma_px.value)
            )
            size_m = float(self._size_m.value)
            found.append(detection(image.header, tag.id, pose, covariance, size_m))
            if self._tf is not None:
                child = f"{self.get_namespace().strip('/')}/tag_{tag.id}"
                self._tf.publish(transform(image.header, child, pose))
        self._detections.publish(self._type(image.header, found))

    def _pose_of(self, tag: DetectedTag) -> TagPose | None:
        """Returns the pose of a tag that the parameters admit, None for another one."""
        assert self._matrix is not None
        if (self._ids and tag.id not in self._ids) or tag.side_px < self._min_side_px.value:
            return None
        pose = tag_pose(tag, float(self._size_m.value), self._matrix, self._distortion)
        is_good = pose is not None and pose.error_px <= self._max_error_px.value
        return pose if is_good else None


def grey_image(image: Image) -> NDArray[np.uint8]:
    """Returns the grey pixels (height, width) of an image.

    Raises GraphError for encodings other than rgb8, bgr8 and mono8, and for damaged images.
    """
    channels = {"rgb8": 3, "bgr8": 3, "mono8": 1}.get(image.encoding)
    if channels is None:
        raise GraphError(f"tags need images in rgb8, bgr8 or mono8, not '{image.encoding}'")
    data, wide = np.asarray(image.data, np.uint8), channels * image.width
    if not (image.height and image.width) or image.step < wide:
        raise GraphError(f"an image of {image.width} x {image.height} pixels, step {image.step}")
    if data.size != image.height * image.step:
        raise GraphError(f"an image of {data.size} bytes, not {image.height} rows of {image.step}")
    rows = data.reshape(image.height, image.step)[:, :wide]
    if channels == 1:
        return np.ascontiguousarray(rows)
    pixels = rows.reshape(image.height, image.width, 3)
    return grey_of(pixels if image.encoding == "rgb8" else pixels[:, :, ::-1])


def _numbers(ids: Any) -> frozenset[int]:
    """Returns the ids of a parameter. Raises NodeError for others than 0 to 586."""
    if not all(isinstance(k, int) and not isinstance(k, bool) and 0 <= k <= _MAX_ID for k in ids):
        raise NodeError(f"ids must be numbers of tags, 0 to {_MAX_ID}, not {ids!r}")
    return frozenset(ids)
