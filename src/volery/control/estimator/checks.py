"""What the estimator accepts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.errors import EstimatorError

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


def checked_rows(rows: ArrayLike, count: int) -> Rows:
    """Rows (S,) of UAVs, each below `count`."""
    checked = np.ascontiguousarray(np.atleast_1d(rows), np.int64)
    if len(checked) and not (checked.min() >= 0 and checked.max() < count):
        raise EstimatorError(f"rows {checked.tolist()} are not all in 0 to {count - 1}")
    return checked


def each_of(given: Any, kind: type[Any], count: int, what: str) -> list[Any]:
    """`given`, one `kind` for all or a sequence, as one for each of `count`."""
    each = [given] * count if isinstance(given, kind) else list(given)
    if len(each) != count:
        raise EstimatorError(f"{what}: one for all or {count} are needed, not {len(each)}")
    return each


def shaped(what: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """`value` as packed floats of `shape`."""
    array = np.ascontiguousarray(value, np.float64)
    if array.shape != shape:
        raise EstimatorError(f"{what} must have shape {shape}, not {array.shape}")
    return array
