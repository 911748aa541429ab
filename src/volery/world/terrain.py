"""The ground: heights on a square grid, and a common surface through them.

Each cell is split along its diagonal from lower left to upper right, and a height anywhere is that
of the triangle there, so that rays (`Terrain.mesh`), ground contact (`terrain_height`,
`terrain_normal`) and queries agree to rounding. Beyond the grid the height is that of the nearest
edge point and the ground is horizontal across the edge.

Row i of the heights holds y = origin_y + i * spacing, column j x = origin_x + j * spacing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.compiled import inline_kernel, kernel
from volery.world.elevation_files import read_elevations
from volery.world.mesh import Mesh


class TerrainGrid(NamedTuple):
    """Heights for kernels: heights (rows along y, columns along x) m, corner and spacing in m."""

    heights: NDArray[np.float64]
    origin_x: float
    origin_y: float
    spacing: float


@inline_kernel
def terrain_height(grid: TerrainGrid, x: float, y: float) -> float:
    """Returns the height of the ground at map position (x, y), m."""
    heights, origin_x, origin_y, spacing = grid
    rows, columns = heights.shape
    u: float = min(max((x - origin_x) / spacing, 0.0), columns - 1.0)
    v: float = min(max((y - origin_y) / spacing, 0.0), rows - 1.0)
    j = min(int(u), columns - 2)
    i = min(int(v), rows - 2)
    u -= j
    v -= i
    low: float = heights[i, j]
    high: float = heights[i + 1, j + 1]
    if u >= v:  # the triangle below the diagonal
        right: float = heights[i, j + 1]
        return low + u * (right - low) + v * (high - right)
    left: float = heights[i + 1, j]
    return low + v * (left - low) + u * (high - left)


@inline_kernel
def terrain_normal(grid: TerrainGrid, x: float, y: float) -> tuple[float, float, float]:
    """Returns the unit normal (nx, ny, nz), upward, of the ground at map position (x, y)."""
    heights, origin_x, origin_y, spacing = grid
    rows, columns = heights.shape
    u = (x - origin_x) / spacing
    v = (y - origin_y) / spacing
    inside_x = 0.0 <= u <= columns - 1.0
    inside_y = 0.0 <= v <= rows - 1.0
    u = min(max(u, 0.0), columns - 1.0)
    v = min(max(v, 0.0), rows - 1.0)
    j = min(int(u), columns - 2)
    i = min(int(v), rows - 2)
    if u - j >= v - i:
        slope_x = (heights[i, j + 1] - heights[i, j]) / spacing
        slope_y = (heights[i + 1, j + 1] - heights[i, j + 1]) / spacing
    else:
        slope_x = (heights[i + 1, j + 1] - heights[i + 1, j]) / spacing
        slope_y = (heights[i + 1, j] - heights[i, j]) / spacing
    if not inside_x:
        slope_x = 0.0
    if not inside_y:
        slope_y = 0.0
    nz = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    return -slope_x * nz, -slope_y * nz, nz


@kernel
def _heights_kernel(
    grid: TerrainGrid, x: NDArray[np.float64], y: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    for k in range(x.shape[0]):
        out[k] = terrain_height(grid, x[k], y[k])


@kernel
def _normals_kernel(
    grid: TerrainGrid, x: NDArray[np.float64], y: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    for k in range(x.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = terrain_normal(grid, x[k], y[k])


@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground of a world, in the map frame.

    grid: heights and their position; at least 2 x 2 finite heights, copied and read-only. Raises
    `ValueError` for other grids.
    """

    grid: TerrainGrid
    _own: TerrainGrid = field(init=False, repr=False)
    """The same memory, writable: kernels compile once for both kinds of array."""

    def __post_init__(self) -> None:
        heights = np.array(self.grid.heights, dtype=np.float64, order="C")
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise ValueError(f"a terrain needs at least 2 x 2 heights, not {heights.shape}")
        if not np.isfinite(heights).all():
            raise ValueError("a terrain's heights must be finite numbers")
        spacing = float(self.grid.spacing)
        if not (spacing > 0.0 and math.isfinite(spacing)):
            raise ValueError(f"a terrain's spacing must be positive, not {spacing}")
        origin = float(self.grid.origin_x), float(self.grid.origin_y)
        if not all(map(math.isfinite, origin)):
            raise ValueError(f"a terrain's origin must be finite, not {origin}")
        object.__setattr__(self, "_own", TerrainGrid(heights, *origin, spacing))
        shown = heights.view()
        shown.flags.writeable = False
        object.__setattr__(self, "grid", TerrainGrid(shown, *origin, spacing))

    @classmethod
    def from_heights(
        cls, heights: ArrayLike, spacing_m: float, origin: tuple[float, float] = (0.0, 0.0)
    ) -> Terrain:
        """Returns a terrain through `heights` (rows along y, columns along x), m.

        heights[0, 0] is at `origin`. Raises `ValueError` for invalid heights or spacing.
        """
        return cls(TerrainGrid(np.asarray(heights, dtype=np.float64), *origin, spacing_m))

    @classmethod
    def flat(
        cls,
        extent_m: float = 500.0,
        height_m: float = 0.0,
        origin: tuple[float, float] = (0.0, 0.0),
    ) -> Terrain:
        """Returns a horizontal square of side `extent_m` whose lower left corner is `origin`."""
        return cls.from_heights(np.full((2, 2), height_m), extent_m, origin)

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        spacing_m: float,
        origin: tuple[float, float] = (0.0, 0.0),
    ) -> Terrain:
        """Reads a terrain from a CSV matrix of heights in m (first row at the lowest y).

        ESRI ASCII grids are read, too (first row at the highest y); `origin` is not theirs.
        Raises `DataFileError`, naming the file and every invalid row.
        """
        return cls.from_heights(read_elevations(Path(path), spacing_m), spacing_m, origin)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """The grid's rectangle x0, y0, x1, y1 in the map, m."""
        heights, x0, y0, spacing = self.grid
        rows, columns = heights.shape
        return x0, y0, x0 + (columns - 1) * spacing, y0 + (rows - 1) * spacing

    @property
    def steepest(self) -> float:
        """Maximum slope of the surface, height by horizontal distance.

        Each triangle of `mesh` has one side along x and one along y: two rises determine its slope.
        """
        along_x, along_y = np.diff(self.grid.heights, axis=1), np.diff(self.grid.heights, axis=0)
        upper = along_x[1:] ** 2 + along_y[:, :-1] ** 2
        lower = along_x[:-1] ** 2 + along_y[:, 1:] ** 2
        return math.sqrt(max(upper.max(), lower.max())) / self.grid.spacing

    def height(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Returns heights at map positions, m; x and y broadcast, the result has their shape."""
        x, y = _broadcast(x, y)
        out = np.empty(x.size)
        _heights_kernel(self._own, x.ravel(), y.ravel(), out)
        return out.reshape(x.shape)

    def normal(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Returns unit upward normals at map positions, (..., 3)."""
        x, y = _broadcast(x, y)
        out = np.empty((x.size, 3))
        _normals_kernel(self._own, x.ravel(), y.ravel(), out)
        return out.reshape((*x.shape, 3))

    def mesh(self) -> Mesh:
        """Returns the surface as upward triangles in the map frame, two per cell."""
        heights, x0, y0, spacing = self.grid
        rows, columns = heights.shape
        x, y = np.meshgrid(x0 + spacing * np.arange(columns), y0 + spacing * np.arange(rows))
        index = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
        a, b = index[:-1, :-1], index[:-1, 1:]
        d, c = index[1:, :-1], index[1:, 1:]
        triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2)
        vertices = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
        return Mesh(vertices.astype(np.float32), triangles.reshape(-1, 3).astype(np.uint32))


def _broadcast(x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    bx, by = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    return np.ascontiguousarray(bx).reshape(bx.shape), np.ascontiguousarray(by).reshape(by.shape)
