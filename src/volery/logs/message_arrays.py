"""Returns images, point clouds and scan angles of ROS messages as arrays."""

from __future__ import annotations

import re
import struct
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import VoleryError
from volery.graph.nodes.point_cloud2 import cloud_rows
from volery.logs.rvl import decode_rvl

_ENCODINGS: dict[str, tuple[str, int]] = {
    "mono8": ("u1", 1),
    "mono16": ("u2", 1),
    "rgb8": ("u1", 3),
    "bgr8": ("u1", 3),
    "rgba8": ("u1", 4),
    "bgra8": ("u1", 4),
    "rgb16": ("u2", 3),
    "bgr16": ("u2", 3),
    **{f"bayer_{order}16": ("u2", 1) for order in ("rggb", "bggr", "gbrg", "grbg")},
    **{f"bayer_{order}8": ("u1", 1) for order in ("rggb", "bggr", "gbrg", "grbg")},
}
"""Types of numbers and channels by encoding (sensor_msgs/image_encodings.hpp)."""
_CV_TYPES = {
    "8U": "u1",
    "8S": "i1",
    "16U": "u2",
    "16S": "i2",
    "32S": "i4",
    "32F": "f4",
    "64F": "f8",
}
_CV_ENCODING = re.compile(r"(8[US]|16[US]|32[SF]|64F)C([1-9]\d?)")
"""Encodings of OpenCV's types: `32FC1`."""
_POINT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Types of numbers by `PointField.datatype`."""
_DEPTH_HEADER = struct.Struct("<i2f")


def image_array(message: Any) -> NDArray[Any]:
    """Returns the pixels (height, width) or (height, width, channels) of an Image.

    Also of a CompressedImage (JPEG, PNG, `compressedDepth` of PNG or RVL). Colours are in the order
    red, green, blue. Depth is in m (floats, nan where unknown) or in mm (uint16), as recorded.
    Raises `VoleryError` for an unknown encoding or damaged data.
    """
    try:
        return _compressed(message) if hasattr(message, "format") else _raw(message)
    except (OSError, ValueError, TypeError, struct.error, SyntaxError) as error:
        raise VoleryError(f"the image cannot be decoded: {error}") from None


def _raw(message: Any) -> NDArray[Any]:
    encoding = message.encoding
    code, channels = _encoding(encoding)
    dtype = np.dtype((">" if message.is_bigendian else "<") + code)
    height, width = int(message.height), int(message.width)
    row_bytes = width * channels * dtype.itemsize
    step = int(message.step) or row_bytes
    rows = np.asarray(message.data).view(np.uint8)[: height * step].reshape(height, step)
    pixels = np.ascontiguousarray(rows[:, :row_bytes]).view(dtype).reshape(height, width, channels)
    pixels = pixels.astype(dtype.newbyteorder("="), copy=False)
    return pixels[:, :, 0] if channels == 1 else _red_first(pixels, encoding)


def _encoding(name: str) -> tuple[str, int]:
    """Returns the type of numbers and the channels; raises `VoleryError` if it is unknown."""
    if name in _ENCODINGS:
        return _ENCODINGS[name]
    found = _CV_ENCODING.fullmatch(name)
    if found is None:
        raise VoleryError(f"images of encoding '{name}' cannot be read: use the message's data")
    return _CV_TYPES[found[1]], int(found[2])


def _red_first(pixels: NDArray[Any], encoding: str) -> NDArray[Any]:
    if not encoding.startswith("bgr"):
        return pixels
    order = [2, 1, 0, 3][: pixels.shape[2]]
    return np.ascontiguousarray(pixels[:, :, order])


def _compressed(message: Any) -> NDArray[Any]:
    from PIL import Image

    data = np.asarray(message.data).tobytes()
    if "compressedDepth" not in message.format:
        with Image.open(BytesIO(data)) as image:
            return np.array(image)
    inverse, a, b = _DEPTH_HEADER.unpack_from(data)
    if message.format.rstrip().endswith("rvl"):
        coded = decode_rvl(data[_DEPTH_HEADER.size :])
    else:
        with Image.open(BytesIO(data[_DEPTH_HEADER.size :])) as image:
            coded = np.array(image).astype(np.uint16)
    if message.format.startswith("16UC1") or inverse != 0 or a == 0.0:
        return coded
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.float32(a) / (coded.astype(np.float32) - np.float32(b))
    return np.where(coded > 0, depth, np.float32(np.nan))


def cloud_array(message: Any) -> NDArray[Any]:
    """Returns the points (N,) of a PointCloud2 as a structured array with the cloud's fields.

    `points["x"]` is a field of all points. Raises `VoleryError` for damaged data.
    """
    order = ">" if message.is_bigendian else "<"
    # fields without a name are padding
    fields = [field for field in message.fields if field.name]
    try:
        formats = [(order + _point_type(field), _shape_of(field)) for field in fields]
        dtype = np.dtype(
            {
                "names": [field.name for field in fields],
                "formats": formats,
                "offsets": [field.offset for field in fields],
                "itemsize": message.point_step,
            }
        )
        points: NDArray[Any] = np.ascontiguousarray(cloud_rows(message, dtype)).reshape(-1)
    except (ValueError, TypeError) as error:
        raise VoleryError(f"the point cloud cannot be decoded: {error}") from None
    return points


def _point_type(field: Any) -> str:
    if field.datatype not in _POINT_TYPES:
        raise ValueError(f"field '{field.name}' has the unknown datatype {field.datatype}")
    return _POINT_TYPES[field.datatype]


def _shape_of(field: Any) -> tuple[int, ...]:
    return (field.count,) if field.count > 1 else ()


def scan_angles(message: Any) -> NDArray[np.float64]:
    """Returns the angles (K,), rad, of the beams of a LaserScan."""
    number = np.arange(len(message.ranges), dtype=np.float64)
    angles: NDArray[np.float64] = message.angle_min + message.angle_increment * number
    return angles
