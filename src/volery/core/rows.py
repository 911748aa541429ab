"""Rows of arrays: their numbers, or a slice where they lie in one piece.

numpy gives up Python's lock for each array that is indexed by numbers, and threads hand it to each
other for nothing; a slice costs a tenth, too. What a slice takes is a view: copy what is kept.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.int64]


def in_one_piece(rows: Rows) -> Rows | slice:
    """A slice that takes the same rows in the same order, if there is one; else `rows` (S,)."""
    first = int(rows[0]) if len(rows) else 0
    end = first + len(rows)
    return slice(first, end) if rows.tolist() == list(range(first, end)) else rows
