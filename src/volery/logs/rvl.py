"""Decodes depth compressed by RVL (run lengths, variable lengths).

Source: A. D. Wilson, "Fast Lossless Depth Image Compression", ISS 2017; the sizes before the codes
are those of `compressed_depth_image_transport`.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

_SIZES = struct.Struct("<2I")
_MAX_PIXELS = 1 << 26
_MAX_HALF_BYTE = 10
"""Largest index of a half byte of a number of 32 bits."""


def decode_rvl(data: bytes) -> NDArray[np.uint16]:
    """Returns the image (height, width). Raises `ValueError` if the data are damaged."""
    if len(data) < _SIZES.size:
        raise ValueError("the RVL data are cut off")
    width, height = _SIZES.unpack_from(data)
    if width * height > _MAX_PIXELS:
        raise ValueError(f"an RVL image of {width} x {height} pixels is too large")
    pixels = np.zeros(width * height, np.uint16)
    values = _values(data[_SIZES.size :])
    index = read = previous = 0
    while index < len(pixels):
        if read + 2 > len(values):
            raise ValueError("the RVL data are cut off")
        index += int(values[read])
        count = int(values[read + 1])
        codes = values[read + 2 : read + 2 + count]
        if index + count > len(pixels) or len(codes) < count:
            raise ValueError("the RVL data do not fit the size of the image")
        if count:
            depths = previous + np.cumsum((codes >> 1) ^ -(codes & 1))
            pixels[index : index + count] = depths & 0xFFFF
            previous = int(depths[-1])
        index, read = index + count, read + 2 + count
    return pixels.reshape(height, width)


def _values(data: bytes) -> NDArray[np.int64]:
    """Returns the numbers: three bits in each half byte, the lowest first; the fourth continues."""
    words = np.frombuffer(data[: len(data) // 4 * 4], "<u4")
    halves = (words[:, None] >> np.arange(28, -1, -4, dtype=np.uint32) & 15).reshape(-1)
    halves = halves.astype(np.int64)
    ends = np.flatnonzero(halves < 8)
    if not len(ends):
        return np.zeros(0, np.int64)
    starts = np.concatenate([[0], ends[:-1] + 1])
    index = np.arange(ends[-1] + 1) - np.repeat(starts, ends - starts + 1)
    if index.max() > _MAX_HALF_BYTE:
        raise ValueError("the RVL data have a number of more than 32 bits")
    parts = (halves[: ends[-1] + 1] & 7) << 3 * index
    return np.add.reduceat(parts, starts)
