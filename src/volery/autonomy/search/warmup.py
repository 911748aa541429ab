"""Compiles the colour kernels; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.search.colour_blob import ColourRange, colour_mask, largest_blob
from volery.core.arrays import read_only


def colours() -> None:
    """Compiles all kernels of the colour search."""
    largest_blob(colour_mask(read_only(np.zeros((2, 2, 3), np.uint8)), ColourRange()))
