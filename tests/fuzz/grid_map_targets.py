"""Grid maps: files of every format, and messages."""

from __future__ import annotations

import contextlib
import io
from functools import cache

import numpy as np
from PIL import Image

from volery.core.errors import CommandError, DataFileError
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.codecs.zero import zero_message
from volery.graph.typestore import typestore
from volery.runtime.services.grid_maps import grid_of
from volery.world.grid_maps import block_mesh
from volery.world.grid_maps.grid_map import MAX_CELLS
from volery.world.grid_maps.parsing import parse_cells

OCCUPANCY = "nav_msgs/msg/OccupancyGrid"
_MATRICES = [
    b"0,1,0\n1,1,0\n",
    b"0 1\n1 0\n\n",
    b"\xef\xbb\xbf0;1;\r\n1;0;\r\n",
    b"1.0,0e0\n0,1\n",
    b'sep=;\n# m\n"1,0";"0"\nTrue;False\n',
]
_MAPS = [
    b"type octile\nheight 2\nwidth 3\nmap\n.@T\nGSW\n",
    b"type octile\nwidth 1\nheight 1\nmap\nO",
]


@cache
def _images():
    grey = (np.indices((5, 7)).sum(axis=0) * 20).astype(np.uint8)
    seeds = []
    for mode in ("L", "1", "P", "RGB", "RGBA", "LA"):
        buffer = io.BytesIO()
        Image.fromarray(grey).convert(mode).save(buffer, format="PNG")
        seeds.append(buffer.getvalue())
    buffer = io.BytesIO()
    Image.fromarray(grey.astype(np.uint16) * 257).save(buffer, format="PNG")
    return [*seeds, buffer.getvalue()]


def matrix(mutator):
    """Matrices of 0 and 1."""
    return _parse(mutator.bytes(_MATRICES), ".csv")


def moving_ai(mutator):
    """Maps of movingai.com."""
    return _parse(mutator.bytes(_MAPS), ".map")


def image(mutator):
    """PNG images."""
    return _parse(mutator.bytes(_images()), ".png")


def occupancy(mutator):
    """Messages, with numbers as a client may send them."""
    message = zero_message(OCCUPANCY)
    message.info.width, message.info.height, message.info.resolution = 3, 2, 0.5
    message.info.origin.orientation.w = 1.0
    message.data = np.array([0, 100, -1, 50, 49, 7], dtype=np.int8)
    data = bytearray(encode_cdr(message, OCCUPANCY))
    for _ in range(mutator.random.randrange(4)):
        data[mutator.random.randrange(4, len(data))] = mutator.random.randrange(256)
    with contextlib.suppress(Exception):  # what cannot be decoded never gets here
        message = typestore().deserialize_cdr(bytes(data), OCCUPANCY)
    with contextlib.suppress(CommandError):
        grid = grid_of(message, 3.0, unknown_is_blocked=mutator.chance(0.5))
        assert np.isfinite(block_mesh(grid, 0.0, 3.0).vertices).all()
    return 1


def _parse(data, suffix):
    with contextlib.suppress(DataFileError):
        cells = parse_cells(data, suffix, "x")
        assert cells.ndim == 2
        assert 0 < cells.size <= MAX_CELLS
    return 1
