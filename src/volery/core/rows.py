"""Converts row numbers of arrays to a slice where the rows are contiguous.

numpy releases the GIL for each array that is indexed by numbers, and threads pass it on
needlessly; a slice also costs a tenth. A slice yields a view: copy what must persist.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.int64]


def in_one_piece(rows: Rows) -> Rows | slice:
    """Returns a slice of the same rows in the same order, if possible; else `rows` (S,)."""
    first = int(rows[0]) if len(rows) else 0
    end = first + len(rows)
    return slice(first, end) if rows.tolist() == list(range(first, end)) else rows
