"""Grid maps as PNG, PGM and BMP images: one pixel per cell, dark ones are blocked."""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.world.grid_maps.grid_map import MAX_CELLS

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEAD = struct.Struct(">8sI4sII")
"""Signature, then length, name, width and height of the first chunk."""
_MAX_BYTES = 8 * MAX_CELLS
_LUMA = (0.299, 0.587, 0.114)
"""Weights of red, green and blue: ITU-R BT.601."""
_MEAN = (1.0 / 3.0,) * 3


def parse_image(data: bytes, where: str, threshold: float = 0.5) -> NDArray[np.bool_]:
    """Returns blocked cells (rows, columns), row 0: the top.

    A pixel is blocked if darker than `threshold`, from 0 (white) to 1 (black); grey, colours, a
    palette, 1 to 16 bits. Pixels more than half transparent are free. Raises `DataFileError` for
    other input.
    """
    _check_size(data, where)
    grey, alpha = _decode(data, where, "PNG")
    return np.asarray((1.0 - grey > threshold) & (alpha >= 0.5))


def parse_pgm(data: bytes, where: str, threshold: float = 0.5) -> NDArray[np.bool_]:
    """Returns the same of a grey image in the formats P2 or P5, 8 or 16 bits."""
    grey, _ = _decode(data, where, "PPM")
    return np.asarray(1.0 - grey > threshold)


def read_image(path: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Returns lightness from 0 to 1 and whether a pixel is opaque (rows, columns), row 0: the top.

    The lightness of a colour is the mean of red, green and blue, as map_server computes it.

    The image is PGM, PNG or BMP. Raises `DataFileError` for other files.
    """
    try:
        size = path.stat().st_size
        if size > _MAX_BYTES:
            raise DataFileError(f"{path}: {size} bytes are too many; at most {_MAX_BYTES}")
        data = path.read_bytes()
    except OSError as error:
        raise DataFileError(f"{path}: cannot be read: {error.strerror}") from None
    grey, alpha = _decode(data, str(path), "PPM", "PNG", "BMP", weights=_MEAN)
    return grey, alpha >= 0.5


def _check_size(data: bytes, where: str) -> None:
    """Rejects other files and large images before memory is allocated."""
    if len(data) < _HEAD.size or data[: len(_SIGNATURE)] != _SIGNATURE:
        raise DataFileError(f"{where}: not a PNG image")
    _, _, name, width, height = _HEAD.unpack_from(data)
    if name != b"IHDR" or not 0 < width * height <= MAX_CELLS:
        raise DataFileError(
            f"{where}: a PNG image of {width} x {height} pixels; allowed are 1 to {MAX_CELLS}"
        )


def _decode(
    data: bytes, where: str, *formats: str, weights: tuple[float, ...] = _LUMA
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Returns grey and alpha (rows, columns), 0 to 1."""
    from PIL import Image, UnidentifiedImageError

    try:
        with (
            warnings.catch_warnings(action="ignore"),
            Image.open(io.BytesIO(data), formats=formats) as image,
        ):
            width, height = image.size
            if not 0 < width * height <= MAX_CELLS:
                raise DataFileError(
                    f"{where}: an image of {width} x {height} pixels; allowed are 1 to {MAX_CELLS}"
                )
            image.load()
            if image.mode.startswith("I"):  # 16 bits of grey
                grey = np.asarray(image, dtype=np.float32) / 65535.0
                return grey, np.ones_like(grey)
            colours = np.asarray(image.convert("RGBA"))
    except UnidentifiedImageError:
        raise DataFileError(
            f"{where}: the image is damaged, or not {' or '.join(formats)}"
        ) from None
    except Image.DecompressionBombError:
        raise DataFileError(f"{where}: too many pixels; allowed are 1 to {MAX_CELLS}") from None
    except (OSError, SyntaxError, ValueError, EOFError, struct.error, zlib.error) as error:
        raise DataFileError(f"{where}: the image is damaged: {error}") from None
    grey = np.zeros(colours.shape[:2], dtype=np.float32)
    for channel, weight in enumerate(weights):
        grey += np.float32(weight / 255.0) * colours[:, :, channel]
    return grey, colours[:, :, 3].astype(np.float32) / 255.0
