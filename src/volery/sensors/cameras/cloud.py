"""Point clouds from depth images: one point per pixel, in the rows and columns of the image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import kernel
from volery.sensors.cameras.model import CameraModel

PLAIN = ("x", "y", "z")
COLOURED = (*PLAIN, "rgb")
"""Fields of a point, four bytes each; `rgb` is 0x00RRGGBB, which PCL and RViz read as a float."""


def organised_points(
    model: CameraModel, depth: NDArray[np.float32], colour: NDArray[np.uint8] | None
) -> NDArray[np.float32]:
    """Returns points (height, width, 3 or 4) of an image in the optical frame, m, with colours.

    depth: (height, width) m along the optical axis; where it is not finite, the point is NaN.
    colour: (height, width, 3) sRGB; None: points without `rgb`.
    """
    fields = PLAIN if colour is None else COLOURED
    points = np.empty((*depth.shape, len(fields)), np.float32)
    colours = np.zeros((0, 0, 3), np.uint8) if colour is None else colour
    _fill(model.ideal, depth, colours, points, points.view(np.uint32))
    return points


@kernel
def _fill(
    ideal: NDArray[np.float32],
    depth: NDArray[np.float32],
    colour: NDArray[np.uint8],
    points: NDArray[np.float32],
    words: NDArray[np.uint32],
) -> None:
    """Writes all points; `words` are the same memory as `points`."""
    nothing = np.float32(np.nan)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if not abs(z) < np.inf:
                z = nothing
            points[v, u, 0] = ideal[v, u, 0] * z
            points[v, u, 1] = ideal[v, u, 1] * z
            points[v, u, 2] = z
            if colour.shape[0] > 0:
                red, green = np.uint32(colour[v, u, 0]), np.uint32(colour[v, u, 1])
                blue = np.uint32(colour[v, u, 2])
                words[v, u, 3] = (red << np.uint32(16)) | (green << np.uint32(8)) | blue
