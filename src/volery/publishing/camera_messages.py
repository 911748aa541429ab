"""Converts images to messages, by the conventions of sensor_msgs, cv_bridge and image_transport.

Colour is `rgb8`; depth `32FC1`, metres along the optical axis, NaN for unknown, -inf too near, inf
too far, or `16UC1`, millimetres, 0 for unknown; labels `32SC1` (instance of the scene, -1 for none)
and `mono8` (`Material`). The frame is the optical one: z forward, x right, y down. Colour and
intrinsics of both cameras of a stereo pair are in the frame of the left camera, as image_geometry's
StereoCameraModel requires; depth, points and labels are in the camera's own.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import read_only
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
from volery.sensors.cameras.depth_units import millimetres
from volery.sensors.samples import CameraFrames, SensorId

OPTICAL_ATTITUDE = np.array([-0.5, 0.5, -0.5, 0.5])
"""(4,) x y z w: attitude of the optical frame in the sensor's frame (x forward, y left, z up)."""
_FIELDS = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate(COLOURED)]


class Camera(NamedTuple):
    """Description of a camera for its messages."""

    sensor: SensorId
    settings: CameraSensor
    left: SensorId | None = None
    """Left camera of the stereo pair if this camera is the right one."""

    @property
    def baseline_m(self) -> float:
        """Distance to the left camera of the pair if this is the right one, m; else 0."""
        stereo = self.settings.stereo
        return 0.0 if self.left is None or stereo is None else stereo.baseline_m


def optical_frame(sensor: SensorId) -> str:
    """Returns the frame of a camera's images."""
    return f"{sensor.path}_optical"


def colour(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """Returns the colour image, `rgb8`."""
    return _image(_pair_header(frames, camera), frames.colour[row], "rgb8")


def compressed(frames: CameraFrames, row: int, camera: Camera) -> CompressedImage:
    """Returns JPEG or PNG; `format` gives encoding, codec, and OpenCV's decoded encoding."""
    codec, image = camera.settings.compressed, frames.colour[row]
    quality = camera.settings.jpeg_quality
    data = codecs.jpeg(image, quality) if codec == "jpeg" else codecs.png(image)
    text = f"rgb8; {codec} compressed bgr8"
    return CompressedImage(_pair_header(frames, camera), text, read_only(data))


def depth(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """Returns the depth image, `32FC1` or `16UC1`."""
    encoding, seen = camera.settings.depth_encoding, frames.depth[row]
    image = seen if encoding == "32FC1" else millimetres(seen)
    return _image(_header(frames, camera), image, encoding)


def compressed_depth(frames: CameraFrames, row: int, camera: Camera) -> CompressedImage:
    """Returns compressed depth: a 12-byte header and a 16-bit PNG."""
    encoding, seen = camera.settings.depth_encoding, frames.depth[row]
    data = (
        codecs.packed_metres(seen, frames.model.far_m)
        if encoding == "32FC1"
        else codecs.packed_millimetres(millimetres(seen))
    )
    text = f"{encoding}; compressedDepth png"
    return CompressedImage(_header(frames, camera), text, read_only(data))


def points(frames: CameraFrames, row: int, camera: Camera) -> PointCloud2:
    """Returns an organized cloud with one point per pixel; NaN for unknown depth."""
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
        False,  # not dense: NaN for unknown depth
    )


def instance(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """Returns the instance labels, `32SC1`."""
    return _image(_header(frames, camera), frames.instance[row], "32SC1")


def material(frames: CameraFrames, row: int, camera: Camera) -> Image:
    """Returns the material labels, `mono8`."""
    return _image(_header(frames, camera), frames.material[row], "mono8")


def camera_info(frames: CameraFrames, row: int, camera: Camera) -> CameraInfo:  # noqa: ARG001
    """Returns the intrinsics; P is K, with P[0, 3] = -fx baseline for a right camera."""
    model = frames.model
    k = model.matrix
    beside = np.array([[-model.focal_px * camera.baseline_m], [0.0], [0.0]])
    return CameraInfo(
        _pair_header(frames, camera),
        model.height,
        model.width,
        "plumb_bob",
        read_only(np.array(model.distortion)),
        read_only(k.reshape(9)),
        read_only(np.eye(3).reshape(9)),
        read_only(np.hstack([k, beside]).reshape(12)),
        0,
        0,
        RegionOfInterest(0, 0, 0, 0, False),
    )


def _image(stamped: Header, image: NDArray[Any], encoding: str) -> Image:
    height, width = image.shape[:2]
    data = _bytes(image)
    return Image(stamped, height, width, encoding, 0, len(data) // height, data)


def _header(frames: CameraFrames, camera: Camera) -> Header:
    return header(frames.stamp_ns, optical_frame(camera.sensor))


def _pair_header(frames: CameraFrames, camera: Camera) -> Header:
    return header(frames.stamp_ns, optical_frame(camera.left or camera.sensor))


def _bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    """Returns the array's memory as bytes, in C order."""
    return read_only(np.ascontiguousarray(array).view(np.uint8).reshape(-1))
