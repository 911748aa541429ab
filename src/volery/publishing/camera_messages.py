"""Pictures as messages, by the conventions of sensor_msgs, cv_bridge and image_transport.

Colour is `rgb8`; depth `32FC1`, metres along the optical axis, NaN where nothing is known, -inf too
near, inf too far, or `16UC1`, millimetres, 0 where nothing is known; labels `32SC1` (instance of
the scene, -1 for none) and `mono8` (`Material`). The frame is the optical one: z forward, x right,
y down. Colour and intrinsics of both cameras of a stereo pair are in that of the left one, as
image_geometry's StereoCameraModel demands; depth, points and labels are in the camera's own.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.graph.messages import (
    CameraInfo,
    CompressedImage,
    Header,
    Image,
    PointCloud2,
    PointField,
    RegionOfInterest,
    header,
)
from volery.publishing import image_codecs as codecs
from volery.scenario.camera import CameraSensor
from volery.sensors.cameras.cloud import COLOURED, organised_points
from volery.sensors.samples import CameraFrames, SensorId

OPTICAL_ATTITUDE = np.array([-0.5, 0.5, -0.5, 0.5])
"""(4,) x y z w: the sensor's axes (x forward, y left, z up) from the optical ones."""
_FIELDS = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate(COLOURED)]


class Camera(NamedTuple):
    """A camera as its messages tell of it."""

    sensor: SensorId
    settings: CameraSensor
    left: SensorId | None = None
    """The left camera of a stereo pair, of which this is the right one."""

    @property
    def baseline_m(self) -> float:
        """From the left camera of the pair to this, which is the right one; else 0."""
        stereo = self.settings.stereo
        return 0.0 if self.left is None or stereo is None else stereo.baseline_m


def optical_frame(sensor: SensorId) -> str:
    """Frame of a camera's pictures."""
    return f"{sensor.path}_optical"


def colour(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """`rgb8`."""
    return _image(_pair_header(frames, camera), frames.colour[row], "rgb8")


def compressed(frames: CameraFrames, row: int, camera: Camera) -> CompressedImage:
    """JPEG or PNG; `format` tells encoding, codec, and what OpenCV makes of it."""
    codec, picture = camera.settings.compressed, frames.colour[row]
    quality = camera.settings.jpeg_quality
    data = codecs.jpeg(picture, quality) if codec == "jpeg" else codecs.png(picture)
    text = f"rgb8; {codec} compressed bgr8"
    return CompressedImage(_pair_header(frames, camera), text, _read_only(data))


def depth(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """`32FC1` or `16UC1`."""
    encoding, seen = camera.settings.depth_encoding, frames.depth[row]
    picture = seen if encoding == "32FC1" else codecs.millimetres(seen)
    return _image(_header(frames, camera), picture, encoding)


def compressed_depth(frames: CameraFrames, row: int, camera: Camera) -> CompressedImage:
    """PNG of 16 bits after a header of 12 bytes."""
    encoding, seen = camera.settings.depth_encoding, frames.depth[row]
    data = (
        codecs.packed_metres(seen, frames.model.far_m)
        if encoding == "32FC1"
        else codecs.packed_millimetres(codecs.millimetres(seen))
    )
    text = f"{encoding}; compressedDepth png"
    return CompressedImage(_header(frames, camera), text, _read_only(data))


def points(frames: CameraFrames, row: int, camera: Camera) -> PointCloud2:
    """A point a pixel, in rows and columns; NaN where nothing is seen."""
    own_colour = frames.colour[row] if camera.settings.points == "xyzrgb" else None
    cloud = organised_points(frames.model, frames.depth[row], own_colour)
    height, width, fields = cloud.shape
    return PointCloud2(
        _header(frames, camera),
        height,
        width,
        _FIELDS[:fields],
        False,  # little-endian
        cloud.itemsize * fields,
        cloud.itemsize * fields * width,
        _bytes(cloud),
        False,  # not dense: NaN stands for nothing
    )


def instance(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """`32SC1`."""
    return _image(_header(frames, camera), frames.instance[row], "32SC1")


def material(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """`mono8`."""
    return _image(_header(frames, camera), frames.material[row], "mono8")


def camera_info(frames: CameraFrames, row: int, camera: Camera) -> CameraInfo:  # noqa: ARG001
    """Intrinsics; P is K, but for the right camera's place in a pair: P[0, 3] = -fx baseline."""
    model = frames.model
    k = model.matrix
    beside = np.array([[-model.focal_px * camera.baseline_m], [0.0], [0.0]])
    return CameraInfo(
        _pair_header(frames, camera),
        model.height,
        model.width,
        "plumb_bob",
        _read_only(np.array(model.distortion)),
        _read_only(k.reshape(9)),
        _read_only(np.eye(3).reshape(9)),
        _read_only(np.hstack([k, beside]).reshape(12)),
        0,
        0,
        RegionOfInterest(0, 0, 0, 0, False),
    )


def _image(stamped: Header, picture: NDArray[Any], encoding: str) -> Image:
    height, width = picture.shape[:2]
    data = _bytes(picture)
    return Image(stamped, height, width, encoding, 0, len(data) // height, data)


def _header(frames: CameraFrames, camera: Camera) -> Header:
    return header(frames.stamp_ns, optical_frame(camera.sensor))


def _pair_header(frames: CameraFrames, camera: Camera) -> Header:
    return header(frames.stamp_ns, optical_frame(camera.left or camera.sensor))


def _bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    """The array's memory, in its order."""
    return _read_only(np.ascontiguousarray(array).view(np.uint8).reshape(-1))


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array
