"""Finds the largest patch of a colour in an image, by thresholds of hue, saturation and value."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.errors import GraphError
from volery.graph.messages import Image

Mask = NDArray[np.bool_]
Pixels = NDArray[np.uint8]
Discs = NDArray[np.float64]

NO_DISCS: Discs = np.zeros((0, 3))


class ColourRange(NamedTuple):
    """Colours of the hexcone model (A. R. Smith, Color gamut transform pairs, 1978)."""

    first_hue_deg: float = 345.0
    """Lower end of the hue range; 0 is red, 120 green."""
    last_hue_deg: float = 15.0
    """Upper end of the hue range; the range passes through 360 if this end is the smaller one."""
    min_saturation: float = 0.5
    """(max - min) / max of the three channels."""
    min_value: float = 0.2
    """The largest channel, 0 to 1."""


class Blob(NamedTuple):
    """Patch of connected pixels."""

    pixels: int
    fraction: float
    """Fraction of the image."""
    u: float
    """Column of its centroid, counted from the centre of the first pixel."""
    v: float
    """Row of its centroid."""


def pixels_of(image: Image) -> Pixels:
    """Returns pixels (height, width, 3) red, green, blue.

    Raises GraphError for encodings other than rgb8 and bgr8.
    """
    if image.encoding not in ("rgb8", "bgr8"):
        raise GraphError(f"the search needs images in rgb8 or bgr8, not '{image.encoding}'")
    rows = np.asarray(image.data).reshape(image.height, image.step)
    pixels = rows[:, : 3 * image.width].reshape(image.height, image.width, 3)
    return pixels if image.encoding == "rgb8" else pixels[:, :, ::-1]


def colour_mask(pixels: Pixels, colours: ColourRange, hidden: Discs = NO_DISCS) -> Mask:
    """Returns the mask (height, width) of pixels (height, width, 3) that have one of the colours.

    hidden: (K, 3) column, row and radius of discs that are excluded.
    """
    mask = np.empty(pixels.shape[:2], np.bool_)
    _fill_mask(np.ascontiguousarray(pixels), *colours, mask)
    _blot_out(hidden, mask)
    return mask


def largest_blob(mask: Mask) -> Blob | None:
    """Returns the largest 8-connected patch of a mask; None if the mask is empty.

    Among patches of equal size it returns the first, row by row.
    """
    pixels, sum_u, sum_v = _largest(mask)
    if pixels == 0:
        return None
    return Blob(pixels, pixels / mask.size, sum_u / pixels, sum_v / pixels)


@kernel
def _fill_mask(
    pixels: Pixels,
    first_hue: float,
    last_hue: float,
    min_saturation: float,
    min_value: float,
    mask: Mask,
) -> None:
    for v in range(pixels.shape[0]):
        for u in range(pixels.shape[1]):
            red, green, blue = pixels[v, u]
            maximum, minimum = max(red, green, blue), min(red, green, blue)
            spread = float(maximum) - float(minimum)
            coloured = spread > 0.0 and spread >= min_saturation * maximum
            mask[v, u] = False
            if coloured and maximum >= 255.0 * min_value:
                hue = _hue_deg(float(red), float(green), float(blue), spread)
                beyond, before = hue >= first_hue, hue <= last_hue
                around = first_hue > last_hue
                mask[v, u] = (beyond or before) if around else (beyond and before)


@inner_kernel
def _hue_deg(red: float, green: float, blue: float, spread: float) -> float:
    """Returns the hue, 0 to 360, of a colour whose channels span `spread`."""
    if red >= green and red >= blue:
        hue = 60.0 * (green - blue) / spread
        return hue if hue >= 0.0 else hue + 360.0
    if green >= blue:
        return 60.0 * (blue - red) / spread + 120.0
    return 60.0 * (red - green) / spread + 240.0


@kernel
def _blot_out(discs: Discs, mask: Mask) -> None:
    rows, columns = mask.shape
    for i in range(discs.shape[0]):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        for v in range(max(int(y - r), 0), int(min(y + r + 1.0, rows))):
            for u in range(max(int(x - r), 0), int(min(x + r + 1.0, columns))):
                if (u - x) ** 2 + (v - y) ** 2 <= r * r:
                    mask[v, u] = False


@kernel
def _largest(mask: Mask) -> tuple[int, float, float]:
    """Returns the pixel count of the largest patch, and the sums of their columns and rows."""
    rows, columns = mask.shape
    left = mask.copy()
    stack = np.empty((rows * columns, 2), np.int64)
    best, best_u, best_v = 0, 0.0, 0.0
    for row in range(rows):
        for column in range(columns):
            if not left[row, column]:
                continue
            left[row, column] = False
            stack[0, 0], stack[0, 1] = row, column
            waiting, count, sum_u, sum_v = 1, 0, 0.0, 0.0
            while waiting > 0:
                waiting -= 1
                v, u = stack[waiting, 0], stack[waiting, 1]
                count += 1
                sum_u += u
                sum_v += v
                for y in range(max(v - 1, 0), min(v + 2, rows)):
                    for x in range(max(u - 1, 0), min(u + 2, columns)):
                        if left[y, x]:
                            left[y, x] = False
                            stack[waiting, 0], stack[waiting, 1] = y, x
                            waiting += 1
            if count > best:
                best, best_u, best_v = count, sum_u, sum_v
    return best, best_u, best_v
