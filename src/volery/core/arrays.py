"""Types of arrays, and arrays that must not change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Makes an array of any shape read-only and returns it."""
    array.flags.writeable = False
    return array
