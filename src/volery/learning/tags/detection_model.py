"""Detections of tags by geometry, as fast as the flight: calibrated by rendered images.

A tag is detected where its corners lie in the image, by chance that depends on the size of its
cells. Errors of its centre, side and direction in the image become those of its pose: a side that
looks too small is a tag that seems too far. `detection.toml` holds the measured numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.data_tables import read_table
from volery.learning.draws import Draws
from volery.learning.tags.camera import TagCamera, TagView
from volery.learning.tags.detections import TagDetections
from volery.world.actors.tags import CELLS

_ROWS = read_table(__file__, "detection.toml")["rows"]
_TABLE = {name: np.array([row[name] for row in _ROWS]) for name in _ROWS[0]}
_NUMBERS_PER_IMAGE = np.uint64(16)
_LOG_CELL = np.log(_TABLE["cell_px"])


def detected_fraction(cell_px: Array) -> Array:
    """Returns the measured fractions (K,) of detections of whole tags, by size of a cell."""
    found = _at(cell_px, "detected")
    return np.where(np.nan_to_num(cell_px) < _TABLE["cell_px"][0], 0.0, found)


def model_detections(
    camera: TagCamera, view: TagView, keys: NDArray[np.uint64], image: NDArray[np.int64]
) -> TagDetections:
    """Returns detections of the tags in a `view` (K,).

    keys: (K,) streams of random numbers. image: (K,) number of the image in its stream.
    """
    envs, draws = np.arange(len(keys)), Draws(len(keys))
    draws.set_state((keys, _NUMBERS_PER_IMAGE * image.astype(np.uint64)))
    chance = draws.uniform(envs)
    errors = draws.normal(envs, 1.0, (4,))
    cell = np.where(view.is_whole, view.cell_px, np.nan)
    is_detected = view.is_whole & (chance < detected_fraction(cell))
    side = CELLS * np.where(is_detected, cell, 1.0)
    off = errors[:, :2] * _at(cell, "centre")[:, None] / camera.model.focal_px
    wrong = _at(cell, "side_mean") + errors[:, 2] * _at(cell, "side_sigma")
    turn = errors[:, 3] * _at(cell, "turn") / side
    ray = view.position_optical / view.position_optical[:, 2:]
    ray[:, :2] += off
    depth = view.position_optical[:, 2] * side / np.maximum(side + wrong, 1.0)
    about = np.zeros((len(envs), 3))
    about[:, 2] = turn
    return TagDetections(
        is_detected,
        np.where(is_detected[:, None], ray * depth[:, None], 0.0),
        rotations.multiply(rotations.exponential(about), view.attitude_optical),
    )


def _at(cell_px: Array, name: str) -> Array:
    """Returns a column of the table, interpolated over the logarithm of the cells' size."""
    log = np.log(np.nan_to_num(cell_px, nan=_TABLE["cell_px"][0]))
    return np.asarray(np.interp(log, _LOG_CELL, _TABLE[name]))
