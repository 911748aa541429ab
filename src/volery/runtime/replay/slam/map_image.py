"""Renders the map of a run as an image: walls, free space and the path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.errors import DataFileError
from volery.core.whole_files import whole_file

_FREE, _UNKNOWN, _WALL = (255, 255, 255), (226, 228, 230), (20, 24, 28)
_PATH, _START, _END = (214, 80, 48), (46, 140, 80), (40, 90, 190)
_MIN_SIDE = 900
"""Min side length, pixels; smaller maps are enlarged."""


def write_image(
    path: Path, values: NDArray[np.int8], origin: Array, cell_m: float, trajectory: Array
) -> None:
    """Writes a PNG of an occupancy grid (rows, columns) and a path (N, 2), m, map, y up.

    A green dot marks the start, a blue one the end. Raises `DataFileError` if the file cannot be
    written.
    """
    from PIL import Image, ImageDraw

    colours = np.empty((*values.shape, 3), np.uint8)
    colours[:] = _UNKNOWN
    colours[values == 0] = _FREE
    colours[values > 50] = _WALL
    zoom = max(1, round(_MIN_SIDE / max(values.shape)))
    pixels = np.repeat(np.repeat(colours[::-1], zoom, axis=0), zoom, axis=1)
    image = Image.fromarray(np.ascontiguousarray(pixels))
    pen = ImageDraw.Draw(image)
    scale = zoom / cell_m
    x = (trajectory[:, 0] - origin[0]) * scale
    y = values.shape[0] * zoom - (trajectory[:, 1] - origin[1]) * scale
    if len(trajectory) > 1:
        pen.line(list(zip(x.tolist(), y.tolist(), strict=True)), fill=_PATH, width=2)
    for k, colour in ((0, _START), (-1, _END)):
        pen.ellipse([x[k] - 5, y[k] - 5, x[k] + 5, y[k] + 5], fill=colour)
    try:
        with whole_file(path) as file:
            image.save(file, format="PNG")
    except OSError as error:
        raise DataFileError(f"{path}: the image cannot be written: {error.strerror}") from None
