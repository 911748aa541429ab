"""Computes with one short vector without numpy, whose calls cost more than the arithmetic.

Some numpy functions, such as `numpy.linalg.norm`, also release the GIL, which threads then pass on
needlessly.
"""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray


def norm(vector: NDArray[Any]) -> float:
    """Returns the Euclidean length of a vector (n,), n small: squares are summed in order."""
    total = 0.0
    for number in vector.tolist():
        total += number * number
    return math.sqrt(total)
