"""Search area: which of its cells have been observed, and the gain of viewpoints."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.errors import PlanError

Mask = NDArray[np.bool_]
Grid = NDArray[np.int8]

_MAX_CELLS = 4_000_000
_BLOCKED = 50
"""Values of an occupancy grid from which cells are obstacles."""


class SearchArea:
    """Represents a polygon in the map by cells of `cell_m`."""

    def __init__(self, corners: Array, cell_m: float) -> None:
        """Creates the area of `corners` (K, 2) m. Raises PlanError if they enclose no cell."""
        if len(corners) < 3 or not np.isfinite(corners).all():
            raise PlanError("an area needs three corners or more, all of them finite")
        self.cell_m = cell_m
        self.low = np.floor(corners.min(axis=0) / cell_m) * cell_m
        shape = np.ceil((corners.max(axis=0) - self.low) / cell_m).astype(np.int64)
        if int(shape.prod()) > _MAX_CELLS:
            raise PlanError(
                f"an area of {int(shape.prod())} cells; at most {_MAX_CELLS} are allowed"
            )
        self.inside = _inside(corners, self.middles(tuple(shape.tolist())))
        if not self.inside.any():
            raise PlanError("the area holds no cell")
        self.corners = corners
        self.seen: Mask = np.zeros(self.inside.shape, np.bool_)

    def middles(self, shape: tuple[int, ...]) -> Array:
        """Returns the centres (nx, ny, 2) of the cells, m."""
        x = self.low[0] + (np.arange(shape[0]) + 0.5) * self.cell_m
        y = self.low[1] + (np.arange(shape[1]) + 0.5) * self.cell_m
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)

    @property
    def size_m2(self) -> float:
        """Returns the area, m^2."""
        return float(np.count_nonzero(self.inside)) * self.cell_m**2

    @property
    def seen_m2(self) -> float:
        """Returns the observed area, m^2."""
        return float(np.count_nonzero(self.seen & self.inside)) * self.cell_m**2

    @property
    def covered_fraction(self) -> float:
        """Returns the observed fraction of the area."""
        return self.seen_m2 / self.size_m2

    def look(
        self, position: Array, grid: Grid, grid_low: Array, grid_cell: float, view_m: float
    ) -> None:
        """Marks all cells within `view_m` of `position` (2+,) m without an obstacle between."""
        _look(
            float(position[0]), float(position[1]), grid, grid_low, grid_cell, view_m,
            self.low, self.cell_m, self.seen,
        )  # fmt: skip

    def gains(self, positions: Array, view_m: float) -> tuple[Array, Array]:
        """Returns the unobserved area (K,) m^2 within `view_m` of positions (K, 2), and its worth.

        Cells between the border and observed cells are worth up to three times as much as cells in
        the open: the UAV would have to return for them.
        """
        new = self.inside & ~self.seen
        worth = np.where(new, 1.0 + 2.0 * _blurred(~new, round(view_m / self.cell_m)), 0.0)
        gains, worths = np.empty(len(positions)), np.empty(len(positions))
        _gains(positions, worth, self.low, self.cell_m, view_m, gains, worths)
        return gains, worths


def _inside(corners: Array, positions: Array) -> Mask:
    """Returns whether positions (..., 2) lie in a polygon, by ray casting to the east."""
    x, y = positions[..., 0], positions[..., 1]
    odd = np.zeros(x.shape, np.bool_)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay == by:
            continue
        crosses = (ay > y) != (by > y)
        odd ^= crosses & (x < ax + (y - ay) / (by - ay) * (bx - ax))
    return odd


def _blurred(mask: Mask, radius: int) -> Array:
    """Returns the fraction (nx, ny) of set cells within `radius` cells; cells outside are set."""
    wide = np.pad(mask, radius + 1, constant_values=True)
    total = np.cumsum(np.cumsum(wide, axis=0, dtype=np.float64), axis=1)
    width = 2 * radius + 1
    box = total[width:, width:] - total[:-width, width:]
    box += total[:-width, :-width] - total[width:, :-width]
    nx, ny = mask.shape
    return np.asarray(box[:nx, :ny] / width**2)


@kernel
def _look(
    x: float,
    y: float,
    grid: Grid,
    grid_low: Array,
    grid_cell: float,
    view: float,
    low: Array,
    cell: float,
    seen: Mask,
) -> None:
    rays = math.ceil(2.0 * math.pi * view / grid_cell)
    steps = math.ceil(view / (0.5 * grid_cell))
    for ray in range(rays):
        angle = 2.0 * math.pi * ray / rays
        dx, dy = math.cos(angle), math.sin(angle)
        for step in range(steps + 1):
            away = step * 0.5 * grid_cell
            px, py = x + away * dx, y + away * dy
            column = math.floor((px - grid_low[0]) / grid_cell)
            row = math.floor((py - grid_low[1]) / grid_cell)
            if not (0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]):
                break
            i, j = math.floor((px - low[0]) / cell), math.floor((py - low[1]) / cell)
            inside = 0 <= i < seen.shape[0] and 0 <= j < seen.shape[1]
            if grid[row, column] < 0:
                if away > 1.0:
                    break
                continue
            if inside:
                seen[i, j] = True
            if grid[row, column] >= _BLOCKED:
                break


@kernel
def _gains(
    positions: Array,
    worth: Array,
    low: Array,
    cell: float,
    view: float,
    gains: Array,
    worths: Array,
) -> None:
    radius_cells = math.ceil(view / cell)
    for p in range(len(positions)):
        ci = math.floor((positions[p, 0] - low[0]) / cell)
        cj = math.floor((positions[p, 1] - low[1]) / cell)
        count, total = 0, 0.0
        for i in range(max(ci - radius_cells, 0), min(ci + radius_cells + 1, worth.shape[0])):
            for j in range(max(cj - radius_cells, 0), min(cj + radius_cells + 1, worth.shape[1])):
                near = ((i - ci) ** 2 + (j - cj) ** 2) * cell * cell <= view * view
                if near and worth[i, j] > 0.0:
                    count += 1
                    total += worth[i, j]
        gains[p], worths[p] = count * cell * cell, total * cell * cell
