"""Encodes images as JPEG, PNG, and depth as image_transport's `compressedDepth`.

The formats are those of `compressed_image_transport` and `compressed_depth_image_transport`
(image_transport_plugins, ros-perception), whose subscribers decode them.
"""

from __future__ import annotations

import struct
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

_PNG_LEVEL = 3
"""Compression level; default of image_transport and OpenCV."""
_QUANTIZATION = 100.0
"""m: depth at which a step of the encoded depth is 1 m; image_transport's default."""
_INVERSE_DEPTH = 0
_HEADER = struct.Struct("<i2f")
"""Encoding and its two parameters, as in the plugin's memory: 12 bytes."""
_MAX_UINT16 = 65535


def jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Encodes (height, width, 3) sRGB as JPEG; quality 1 to 100 on libjpeg's scale."""
    return _encoded(image, format="JPEG", quality=quality)


def png(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Encodes (height, width, 3) sRGB, or (height, width) 16-bit grey, as PNG."""
    return _encoded(image, format="PNG", compress_level=_PNG_LEVEL)


def packed_millimetres(depth: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Encodes depth (height, width), mm, as lossless `compressedDepth`."""
    return _with_header(0.0, 0.0, depth)


def packed_metres(depth: NDArray[np.float32], far_m: float) -> NDArray[np.uint8]:
    """Encodes depth (height, width), m, as `compressedDepth`: `A / depth + B` in 16 bits.

    A = q (q + 1) and B = 1 - A / far with q = 100 m: steps are z^2 / A, 1 cm at 10 m. Depth that is
    unknown, beyond `far_m`, or below the range of 16 bits (.15 m) is 0, which is decoded as NaN.
    """
    a = _QUANTIZATION * (_QUANTIZATION + 1.0)
    b = 1.0 - a / far_m
    with np.errstate(invalid="ignore", divide="ignore"):
        coded = np.floor(np.float32(a) / depth + np.float32(b))
        known = (depth > 0.0) & (depth < far_m) & (coded <= _MAX_UINT16)
    return _with_header(a, b, np.where(known, coded, 0.0).astype(np.uint16))


def _with_header(a: float, b: float, depth: NDArray[np.uint16]) -> NDArray[np.uint8]:
    header = np.frombuffer(_HEADER.pack(_INVERSE_DEPTH, a, b), np.uint8)
    return np.concatenate([header, png(depth)])


def _encoded(image: NDArray[Any], **options: Any) -> NDArray[np.uint8]:
    from PIL import Image

    file = BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(file, **options)
    return np.frombuffer(file.getbuffer(), np.uint8)
