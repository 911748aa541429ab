"""A grid map: blocked cells of a horizontal grid, and its size in the world.

Row 0 holds the cells of lowest y and column 0 those of lowest x, as in `nav_msgs/OccupancyGrid`. In
files the first row is the top of an image; reading them flips the rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import CommandError

MAX_CELLS = 4096 * 4096
LARGEST_M = 1000.0
"""Maximum side of a cell and height of a block."""
MAX_DISTANCE_M = 100_000.0
"""Maximum distance of the origin; beyond, single precision is coarser than a centimetre."""


@dataclass(frozen=True, eq=False)
class GridMap:
    """Cells and their pose in the map.

    Raises `CommandError` for sizes out of range.
    """

    name: str
    blocked: NDArray[np.bool_]
    """(rows, columns) row 0: lowest y, column 0: lowest x."""
    cell_size_m: float
    block_height_m: float
    origin_m: tuple[float, float] = (0.0, 0.0)
    """Outer corner of the cell in row 0, column 0."""
    yaw_rad: float = 0.0
    """Rotation of the map about its origin, counter-clockwise."""

    def __post_init__(self) -> None:
        blocked = np.ascontiguousarray(self.blocked, dtype=np.bool_).view()
        if blocked.ndim != 2 or not 0 < blocked.size <= MAX_CELLS:
            shape = " x ".join(str(side) for side in blocked.shape)
            raise CommandError(
                f"grid map '{self.name}' has {shape} cells; allowed are 1 to {MAX_CELLS} "
                "in rows and columns"
            )
        for key, value in (
            ("cell_size_m", self.cell_size_m),
            ("block_height_m", self.block_height_m),
        ):
            if not 0.001 <= value <= LARGEST_M:
                raise CommandError(
                    f"grid map '{self.name}': {key} must be .001 to {LARGEST_M:g}, not {value:g}"
                )
        max_offset = max(abs(self.origin_m[0]), abs(self.origin_m[1]))
        if not (max_offset <= MAX_DISTANCE_M and math.isfinite(self.yaw_rad)):
            raise CommandError(
                f"grid map '{self.name}': the origin must be within {MAX_DISTANCE_M:g} m and yaw "
                f"finite, not {self.origin_m}, {self.yaw_rad}"
            )
        blocked.flags.writeable = False
        object.__setattr__(self, "blocked", blocked)

    @property
    def rows(self) -> int:
        """Number of cells along y, before rotation."""
        return int(self.blocked.shape[0])

    @property
    def columns(self) -> int:
        """Number of cells along x, before rotation."""
        return int(self.blocked.shape[1])

    def map_from_cells(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns positions (P, 2) m in the map of points (P, 2) in columns and rows of cells."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        turn = self.cell_size_m * np.array([[c, s], [-s, c]])
        return np.asarray(points @ turn + np.array(self.origin_m))

    def bounds_of_blocks(self) -> tuple[float, float, float, float] | None:
        """Returns x_min, y_min, x_max, y_max, m, around all blocked cells; None without any."""
        rows, columns = (np.flatnonzero(self.blocked.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return None
        x, y = [columns[0], columns[-1] + 1], [rows[0], rows[-1] + 1]
        corners = self.map_from_cells(np.array([[a, b] for a in x for b in y], dtype=np.float64))
        (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        return x0, y0, x1, y1

    def describe(self) -> str:
        """Returns a description in one line."""
        return (
            f"grid map '{self.name}', {self.columns} x {self.rows} cells of {self.cell_size_m:g} m,"
            f" blocks {self.block_height_m:g} m high"
        )
