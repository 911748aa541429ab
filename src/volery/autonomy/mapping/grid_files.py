"""Writes occupancy grids for ROS' map_server: an image `.pgm` and a `.yaml` beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.errors import DataFileError
from volery.core.whole_files import write_whole

_FREE, _UNKNOWN, _OCCUPIED = 254, 205, 0
"""Grey values that map_saver writes and map_server reads in mode trinary."""


def shades(values: NDArray[np.int8]) -> NDArray[np.uint8]:
    """Returns nav_msgs/OccupancyGrid values (rows, columns) as grey, first row at the top."""
    image_path = np.full(values.shape, _UNKNOWN, np.uint8)
    image_path[values == 0] = _FREE
    image_path[values > 50] = _OCCUPIED
    return image_path[::-1]


def write_grid(stem: Path, values: NDArray[np.int8], origin: Array, cell_m: float) -> list[Path]:
    """Writes `stem`.pgm and `stem`.yaml; `origin` (2,) m is the lower left corner in the map.

    Raises
    ------
    DataFileError
        They cannot be written.

    """
    image_path, metadata_path = stem.with_suffix(".pgm"), stem.with_suffix(".yaml")
    rows, columns = values.shape
    text = (
        f"image: {image_path.name}\nmode: trinary\nresolution: {cell_m:g}\n"
        f"origin: [{origin[0]:.6g}, {origin[1]:.6g}, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"  # with .25 unknown cells are free
    )
    try:
        head = f"P5\n# written by Volery\n{columns} {rows}\n255\n".encode()
        write_whole(image_path, head + shades(values).tobytes())
        write_whole(metadata_path, text)
    except OSError as error:
        raise DataFileError(f"{stem}: the grid cannot be written: {error.strerror}") from None
    return [image_path, metadata_path]
