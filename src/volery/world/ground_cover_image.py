"""The ground cover as an image, for texturing the terrain in exported worlds.

PNG (ISO/IEC 15948): one byte per cell, an index into a palette; rows from south to north.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from volery.world.ground_cover import GroundCover
from volery.world.materials import Material

_RIM = 1
"""Cells of bare earth around the cover: viewers repeat the outermost cells beyond the image."""


def cover_png(cover: GroundCover, colours: Mapping[Material, tuple[float, float, float]]) -> bytes:
    """Returns a PNG with one pixel per cell and a rim of earth.

    colours: linear (r, g, b) of each material.
    """
    cells = np.pad(cover.material, _RIM, constant_values=Material.GROUND)
    rows, columns = cells.shape
    linear = np.array([colours[material] for material in Material])
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 3, 0, 0, 0)
    lines = np.pad(cells, ((0, 0), (1, 0)))  # each row begins with its filter: none
    return b"".join(
        [
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", header),
            _chunk(b"PLTE", np.round(255.0 * coded.clip(0.0, 1.0)).astype(np.uint8).tobytes()),
            _chunk(b"IDAT", zlib.compress(lines.tobytes(), 9)),
            _chunk(b"IEND", b""),
        ]
    )


def cover_coordinates(cover: GroundCover, points: NDArray[np.floating]) -> NDArray[np.float32]:
    """Returns image coordinates (n, 2), fractions of width and height, of points (n, 3), m, map."""
    rows, columns = cover.material.shape
    low = np.array([cover.origin_x, cover.origin_y]) - _RIM * cover.spacing
    size = np.array([columns + 2 * _RIM, rows + 2 * _RIM]) * cover.spacing
    return np.asarray((points[:, :2] - low) / size, dtype=np.float32)


def _chunk(kind: bytes, data: bytes) -> bytes:
    check = zlib.crc32(kind + data)
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)
