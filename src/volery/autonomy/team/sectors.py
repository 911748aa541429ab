"""The search area as a grid of sectors, and the observed part of a sector."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.search.search_positions import Area
from volery.core.arrays import Array

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Sectors:
    """An area cut into equal rectangles of about `side_m`, numbered row by row from the south."""

    area: Area
    side_m: float

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows (along y) and columns (along x)."""
        a = self.area
        columns = max(round((a.x_max - a.x_min) / self.side_m), 1)
        rows = max(round((a.y_max - a.y_min) / self.side_m), 1)
        return rows, columns

    def __len__(self) -> int:
        """Returns the number of sectors."""
        rows, columns = self.shape
        return rows * columns

    def of(self, number: int) -> Area:
        """Returns the rectangle of a sector."""
        rows, columns = self.shape
        row, column = divmod(number, columns)
        wide = (self.area.x_max - self.area.x_min) / columns
        deep = (self.area.y_max - self.area.y_min) / rows
        x, y = self.area.x_min + column * wide, self.area.y_min + row * deep
        return Area(x, y, x + wide, y + deep)

    def centres(self) -> Array:
        """Returns the centres (S, 2) of the sectors, m."""
        corners = np.array([self.of(number) for number in range(len(self))])
        middles: Array = 0.5 * (corners[:, :2] + corners[:, 2:])
        return middles


@dataclass
class Coverage:
    """Marks which cells of one sector have been observed."""

    sector: Area
    cell_m: float
    seen: Mask = field(init=False)
    """(rows, columns)."""
    _middles: tuple[Array, Array] = field(init=False, repr=False, compare=False)
    """(columns,) x and (rows,) y of the cells' centres, m."""

    def __post_init__(self) -> None:
        wide, deep = self._size
        rows, columns = (max(math.ceil(side / self.cell_m), 1) for side in (deep, wide))
        self.seen = np.zeros((rows, columns), np.bool_)
        self._middles = (
            self.sector.x_min + (np.arange(columns) + 0.5) * wide / columns,
            self.sector.y_min + (np.arange(rows) + 0.5) * deep / rows,
        )

    @property
    def covered_fraction(self) -> float:
        """Observed fraction of the sector."""
        return float(self.seen.mean())

    def look(self, position: Array, sight_m: float) -> int:
        """Marks cells within `sight_m` of `position` (2,) m; returns the number of new cells."""
        x, y = self._middles
        near = np.hypot(x[None, :] - position[0], y[:, None] - position[1]) <= sight_m
        new = int((near & ~self.seen).sum())
        self.seen |= near
        return new

    @property
    def _size(self) -> tuple[float, float]:
        return self.sector.x_max - self.sector.x_min, self.sector.y_max - self.sector.y_min


def to_bits(flags: Mask) -> NDArray[np.uint8]:
    """Returns flags (S,) as the bits of a `TeamReport`."""
    return np.packbits(flags, bitorder="little")


def from_bits(data: NDArray[np.uint8], count: int) -> Mask:
    """Returns the first `count` flags of a report; missing ones are False."""
    flags = np.unpackbits(np.asarray(data, np.uint8), bitorder="little")[:count].astype(np.bool_)
    return np.pad(flags, (0, count - len(flags)))
