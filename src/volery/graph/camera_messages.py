"""Pictures as messages, by the conventions of sensor_msgs and cv_bridge.

Colour is `rgb8`; depth `32FC1`, metres along the optical axis, NaN where nothing is known, -inf too
near, inf too far; labels `32SC1` (instance of the scene, -1 for none) and `mono8` (`Material`). The
frame is the optical one: z forward, x right, y down.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.graph.channels import Channel
from volery.graph.messages import CameraInfo, Header, Image, RegionOfInterest, header
from volery.sensors.samples import CameraFrames, SensorId

OPTICAL_ATTITUDE = np.array([-0.5, 0.5, -0.5, 0.5])
"""(4,) x y z w: the sensor's axes (x forward, y left, z up) from the optical ones."""


def optical_frame(sensor: SensorId) -> str:
    """Frame of a camera's pictures."""
    return f"{sensor.path}_optical"


def colour(frames: CameraFrames, row: int) -> Image | None:
    """`rgb8`."""
    return _image(frames, frames.colour, row, "rgb8")


def depth(frames: CameraFrames, row: int) -> Image | None:
    """`32FC1`."""
    return _image(frames, frames.depth, row, "32FC1")


def instance(frames: CameraFrames, row: int) -> Image | None:
    """`32SC1`."""
    return _image(frames, frames.instance, row, "32SC1")


def material(frames: CameraFrames, row: int) -> Image | None:
    """`mono8`."""
    return _image(frames, frames.material, row, "mono8")


def camera_info(frames: CameraFrames, row: int) -> CameraInfo:
    """Intrinsics; K and P are the same: nothing is rectified."""
    model = frames.model
    k = model.matrix
    return CameraInfo(
        _header(frames, row),
        model.height,
        model.width,
        "plumb_bob",
        _read_only(np.array(model.distortion)),
        _read_only(k.reshape(9)),
        _read_only(np.eye(3).reshape(9)),
        _read_only(np.hstack([k, np.zeros((3, 1))]).reshape(12)),
        0,
        0,
        RegionOfInterest(0, 0, 0, 0, False),
    )


CAMERA_CHANNELS = (
    Channel("/image_raw", Image, colour),
    Channel("/depth", Image, depth),
    Channel("/camera_info", CameraInfo, camera_info),
    Channel("/labels/instance", Image, instance),
    Channel("/labels/material", Image, material),
)
PART_OF_SUFFIX = {
    "/image_raw": "colour",
    "/depth": "depth",
    "/camera_info": "depth",
    "/labels/instance": "labels",
    "/labels/material": "labels",
}
"""What of a picture must be made for a topic; intrinsics come with the cheapest."""


def _image(frames: CameraFrames, pictures: NDArray[Any], row: int, encoding: str) -> Image | None:
    if not pictures[row].size:
        return None
    picture = np.ascontiguousarray(pictures[row])
    data = picture.view(np.uint8).reshape(-1)
    data.flags.writeable = False
    height, width = picture.shape[:2]
    return Image(_header(frames, row), height, width, encoding, 0, len(data) // height, data)


def _header(frames: CameraFrames, row: int) -> Header:
    return header(frames.stamp_ns, optical_frame(frames.sensors[row]))


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array = array.copy()
    array.flags.writeable = False
    return array
