"""The field to cover, from a map on the graph: free cells and their positions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.autonomy.coverage.cells import Mask
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import PlanError

BLOCKED_FROM = 50
"""Occupancy, in per cent, from which a cell is blocked; unknown cells (-1) are blocked as well."""


@dataclass(frozen=True)
class CoverageField:
    """Free cells (rows, columns), the side of a cell in m, the lower left corner (2,) m, map.

    The grid is rotated by `yaw` rad about its corner.
    """

    free: Mask
    cell_m: float
    origin_map: tuple[float, float]
    yaw: float = 0.0

    @classmethod
    def from_message(cls, message: Any) -> CoverageField:
        """Returns the field of a nav_msgs/OccupancyGrid. Raises PlanError if it is invalid."""
        info, corner = message.info, message.info.origin.position
        data: NDArray[np.int8] = np.asarray(message.data, dtype=np.int8)
        rows, columns = int(info.height), int(info.width)
        if not data.size or data.size != rows * columns:
            raise PlanError(f"a map of {columns} x {rows} cells has {data.size} entries")
        if not (info.resolution > 0.0 and math.isfinite(corner.x + corner.y + info.resolution)):
            raise PlanError("origin and resolution of a map must be finite, resolution above 0")
        turn = info.origin.orientation
        yaw = rotations.heading_of((turn.x, turn.y, turn.z, turn.w)) or 0.0
        free = ((data >= 0) & (data < BLOCKED_FROM)).reshape(rows, columns)
        return cls(free, float(info.resolution), (float(corner.x), float(corner.y)), yaw)

    def lies_like(self, other: CoverageField) -> bool:
        """Returns whether the cells coincide with those of `other`."""
        same = (self.cell_m, self.origin_map, self.yaw) == (
            other.cell_m,
            other.origin_map,
            other.yaw,
        )
        return same and self.free.shape == other.free.shape

    def cells_at(self, position_map: ArrayLike) -> NDArray[np.int64]:
        """Returns row, column (K, 2) of positions (K, 2 or 3) m, also outside of the map."""
        return self._grid_at(position_map, self.cell_m)

    def sub_cells_at(self, position_map: ArrayLike) -> NDArray[np.int64]:
        """Returns row, column (K, 2) on the grid twice as fine."""
        return self._grid_at(position_map, 0.5 * self.cell_m)

    def centres(self, cells: ArrayLike) -> Array:
        """Returns the centres (K, 2) m, map, of cells (K, 2) row, column."""
        return self._middles(cells, self.cell_m)

    def sub_centres(self, sub_cells: ArrayLike) -> Array:
        """Returns the centres (K, 2) m, map, of cells of the grid twice as fine."""
        return self._middles(sub_cells, 0.5 * self.cell_m)

    def apart(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Returns the nearest free cells (R, 2) to `cells` (R, 2), all different if possible."""
        free = np.argwhere(self.free)
        found = cells.copy()
        for number, cell in enumerate(cells[: len(free)]):
            nearest = int(np.argmin(np.hypot(*(free - cell).T)))
            found[number] = free[nearest]
            free = np.delete(free, nearest, axis=0)
        return found

    def _grid_at(self, position_map: ArrayLike, side_m: float) -> NDArray[np.int64]:
        off = np.asarray(position_map, np.float64)[..., :2] - self.origin_map
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        right = cos * off[..., 0] + sin * off[..., 1]
        up = cos * off[..., 1] - sin * off[..., 0]
        return np.floor(np.stack([up, right], axis=-1) / side_m).astype(np.int64)

    def _middles(self, cells: ArrayLike, side_m: float) -> Array:
        up, right = np.moveaxis((np.asarray(cells, np.float64) + 0.5) * side_m, -1, 0)
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        x, y = self.origin_map
        return np.stack([x + cos * right - sin * up, y + sin * right + cos * up], axis=-1)
