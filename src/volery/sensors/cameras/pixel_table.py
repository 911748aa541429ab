"""Rays of an image, ordered in packets of neighbouring pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.sensors.cameras.lens import undistort
from volery.world.embree import LANES

PIECE = 2048 // LANES
"""Packets of a piece of work for a kernel: a compact part of the image, 16 x 8 tiles."""
_PIECE_ACROSS, _PIECE_DOWN = 16, 8
_OFFSETS = {
    1: np.array([[0.0, 0.0]]),
    # A rotated grid covers four rows and four columns, which smooths edges of any slope.
    4: np.array([[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]]),
}
"""Offsets of a pixel's samples from its centre, pixels."""


class PixelTable(NamedTuple):
    """P packets of LANES rays, of tiles of 4 x 4 pixels, or of 2 x 2 with four samples each.

    A tile is a packet of 16 lanes, or two of 8. Samples of a pixel are neighbouring lanes. Lanes
    beyond the image's edge repeat one within.
    """

    direction: NDArray[np.float32]
    """(P, 3, LANES) unit vectors in the sensor's axes: x forward, y left, z up."""
    pixel: NDArray[np.int64]
    """(P, LANES) row * width + column; -1 for lanes that are not written."""
    blind: NDArray[np.bool_]
    """(P, LANES) whether the pixel lies outside the lens's image."""
    after_ns: NDArray[np.int64]
    """(P,) time of exposure, ns after the first row."""
    cone: NDArray[np.float64]
    """(pieces, 5) cone around all rays of a piece of PIECE packets: its axis in the sensor's axes,
    cosine and sine of its half angle; the full sphere with a rolling shutter, which may turn."""
    samples: int


def make_table(
    width: int,
    height: int,
    focal_px: float,
    centre_px: tuple[float, float],
    distortion: Sequence[float],
    samples: int,
    readout_ns: int,
) -> PixelTable:
    """Returns the rays of an image; the arguments are those of `CameraModel`."""
    side = 4 if samples == 1 else 2
    across, down = -(-width // side), -(-height // side)
    y, x = np.mgrid[0:side, 0:side].reshape(2, -1)
    tile_y, tile_x = np.mgrid[0:down, 0:across].reshape(2, -1, 1) * side
    rows, columns = tile_y[:, 0] // side, tile_x[:, 0] // side
    pieces = (columns, rows, columns // _PIECE_ACROSS, rows // _PIECE_DOWN)
    order = np.lexsort(pieces)
    tile_y, tile_x = tile_y[order], tile_x[order]
    u, v = tile_x + x, tile_y + y
    inside = (u < width) & (v < height)
    u, v = np.minimum(u, width - 1), np.minimum(v, height - 1)
    pixel = np.where(inside, v * width + u, -1)
    samples_px = np.stack([u, v], axis=-1)[:, :, None] + _OFFSETS[samples]
    ideal = undistort((samples_px - np.array(centre_px)) / focal_px, distortion)
    ideal = ideal.reshape(-1, LANES, 2)
    blind = np.isnan(ideal[..., 0]) | np.isnan(ideal[..., 1])
    ideal[blind] = 0.0
    rays = np.stack([np.ones(blind.shape), -ideal[..., 0], -ideal[..., 1]], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    packets_of_tile = len(rays) // len(tile_y)
    middle = np.minimum(tile_y[:, 0] + (side - 1) / 2.0, height - 1)
    fraction = middle / max(height - 1, 1)
    return PixelTable(
        np.ascontiguousarray(rays, dtype=np.float32),
        np.repeat(pixel, samples, axis=1).reshape(-1, LANES).astype(np.int64),
        blind,
        np.repeat(np.round(fraction * readout_ns).astype(np.int64), packets_of_tile),
        _cones(rays, readout_ns),
        samples,
    )


def _cones(rays: NDArray[np.float64], readout_ns: int) -> NDArray[np.float64]:
    """Returns the cones (pieces, 5) of `rays` (P, 3, LANES); see `PixelTable.cone`."""
    cones = []
    for first in range(0, len(rays), PIECE):
        own = np.moveaxis(rays[first : first + PIECE], 1, -1).reshape(-1, 3)
        axis = own.mean(axis=0)
        axis /= np.linalg.norm(axis)
        cosine = -1.0 if readout_ns else float((own @ axis).min()) - 1e-6
        cones.append([*axis, cosine, np.sqrt(max(1.0 - cosine**2, 0.0))])
    return np.array(cones)
