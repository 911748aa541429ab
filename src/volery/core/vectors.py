"""One short vector, without numpy: for a few numbers its calls cost more than their arithmetic.

Some of them, `numpy.linalg.norm` among them, also give up Python's lock, which threads then hand to
each other for nothing.
"""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray


def norm(vector: NDArray[Any]) -> float:
    """Euclidean length of a vector (n,), n small: its squares are summed up in their order."""
    total = 0.0
    for number in vector.tolist():
        total += number * number
    return math.sqrt(total)
