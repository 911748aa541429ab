"""Validation of the estimator's arguments; all functions raise `EstimatorError`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.core.errors import EstimatorError

Rows = NDArray[np.int64]


def checked_rows(rows: ArrayLike, count: int) -> Rows:
    """Returns rows (S,) of UAVs, each checked to be below `count`."""
    checked = np.ascontiguousarray(np.atleast_1d(rows), np.int64)
    if len(checked) and not (checked.min() >= 0 and checked.max() < count):
        raise EstimatorError(f"rows {checked.tolist()} are not all in 0 to {count - 1}")
    return checked


def each_of(given: Any, kind: type[Any], count: int, what: str) -> list[Any]:
    """Returns `given`, one `kind` for all or a sequence, as a list with one for each of `count`."""
    each = [given] * count if isinstance(given, kind) else list(given)
    if len(each) != count:
        raise EstimatorError(f"{what}: give one for all or {count}, not {len(each)}")
    return each


def shaped(what: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Returns `value` as contiguous floats of `shape`."""
    array = np.ascontiguousarray(value, np.float64)
    if array.shape != shape:
        raise EstimatorError(f"{what} must have shape {shape}, not {array.shape}")
    return array
