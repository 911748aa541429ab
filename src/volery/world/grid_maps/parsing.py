"""Reads cells from files: selects the format and checks the size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.world.grid_maps.grid_map import MAX_CELLS
from volery.world.grid_maps.image_files import parse_image, parse_pgm
from volery.world.grid_maps.matrix import parse_matrix
from volery.world.grid_maps.moving_ai import parse_moving_ai

MAX_BYTES = 4 * MAX_CELLS
"""Maximum size of a file: a matrix of the most cells with separators and blanks."""

_SUFFIXES = (".csv", ".txt", ".png", ".pgm", ".map")


def read_cells(path: Path, threshold: float = 0.5) -> NDArray[np.bool_]:
    """Returns the blocked cells (rows, columns) of a grid map's file, row 0: lowest y.

    A .csv or .txt file is a matrix of 0 and 1, a .map file one of movingai.com, a .png or .pgm file
    an image in which a cell is blocked where it is darker than `threshold` (0 white, 1 black). The
    first row of a file is the top: it holds the highest y. Raises `DataFileError`, naming the file
    and, where there are lines, the line, for other input.
    """
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise DataFileError(
            f"{path}: unknown grid map format '{path.suffix}'; allowed are {', '.join(_SUFFIXES)} "
            "and .yaml of map_server"
        )
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise DataFileError(f"{path}: {size} bytes are too many; at most {MAX_BYTES}")
        data = path.read_bytes()
    except OSError as error:
        raise DataFileError(f"{path}: cannot be read: {error.strerror}") from None
    return parse_cells(data, suffix, str(path), threshold)


def parse_cells(data: bytes, suffix: str, where: str, threshold: float = 0.5) -> NDArray[np.bool_]:
    """Returns the same from the content of a file; errors begin with `where`."""
    if suffix == ".png":
        from_top = parse_image(data, where, threshold)
    elif suffix == ".pgm":
        from_top = parse_pgm(data, where, threshold)
    elif suffix == ".map":
        from_top = parse_moving_ai(data, where)
    else:
        from_top = parse_matrix(data, where)
    return np.ascontiguousarray(from_top[::-1])
