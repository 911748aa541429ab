"""Warns about inventories whose numbers are possible but most likely in another unit."""

from __future__ import annotations

import logging
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from volery.core.plurals import counted

_log = logging.getLogger(__name__)

_THINNEST_CM, _THICKEST_CM = 1.0, 400.0
"""Inventories begin at 1 cm (that of Barro Colorado) or more; few giants exceed 4 m."""
_SLENDEREST = 500.0
"""Height by diameter; the slenderest trees of dense stands reach about 200."""
_TOGETHER_M = 1.0


def warn_of_units(where: str, rows: NDArray[np.int64], table: NDArray[np.float64]) -> None:
    """Logs one warning for each doubtful column, once for each file.

    where: names the inventory. rows: (N,) of the file. table: (N, 4) x, y, diameter and height in
    m, NaN where not measured.
    """
    x, y, dbh, height = table.T
    with np.errstate(invalid="ignore", divide="ignore"):
        thin = (100.0 * dbh < _THINNEST_CM) | (height / dbh > _SLENDEREST)
        thick = 100.0 * dbh > _THICKEST_CM
    for doubtful, unit in ((thin, "m"), (thick, "mm")):
        if doubtful.any():
            first = int(np.argmax(doubtful))
            _warn(
                f"{where}: row {rows[first]}: dbh_cm is {100.0 * dbh[first]:.4g}"
                + (f", with a height of {height[first]:g} m" if height[first] > 0.0 else "")
                + f"; is it in {unit}? ({counted(int(doubtful.sum()), 'tree')} of {len(rows)})"
            )
    _, first_of = np.unique(table, axis=0, return_index=True, equal_nan=True)
    repeated = np.setdiff1d(np.arange(len(x)), first_of)
    if len(repeated):
        _warn(
            f"{where}: row {rows[repeated[0]]} repeats a row above it; does the file hold trees "
            f"twice? ({counted(len(repeated), 'tree')} of {len(rows)})"
        )
    in_degrees = len(first_of) > 1 and np.abs(x).max() <= 180.0 and np.abs(y).max() <= 90.0
    if in_degrees and max(np.ptp(x), np.ptp(y)) < _TOGETHER_M:
        _warn(f"{where}: all {len(rows)} trees are within 1 m; are x_m and y_m in degrees?")


@lru_cache(maxsize=100)
def _warn(text: str) -> None:
    """Logs a warning once, however often the same file is read."""
    _log.warning("%s", text)
