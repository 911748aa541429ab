"""Meshes of a grid map's blocks: tops and visible walls.

Tops of neighbours are merged to rectangles, walls along a line to one, so that a mesh grows with
the length of its outlines instead of the number of cells. There are no undersides: they are
invisible, and a body inside a block leaves it by a wall or the top.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import CommandError
from volery.world.grid_maps.grid_map import GridMap
from volery.world.mesh import EMPTY, Mesh

_TRIANGLES = (0, 1, 2, 0, 2, 3)
"""Triangles of a rectangle, by its corners."""
MAX_FACES = 1_000_000
"""Maximum rectangles of a mesh: with Embree's search trees they take about .6 GB."""


class _Runs(NamedTuple):
    """Contiguous runs of set cells."""

    row: NDArray[np.int64]
    first: NDArray[np.int64]
    end: NDArray[np.int64]
    """Column after the last one."""


def block_mesh(grid: GridMap, bottom_m: float, top_m: float) -> Mesh:
    """Returns the blocks from `bottom_m` to `top_m`, z in the map.

    Raises `CommandError` if the map is so irregular that its mesh would be too large.
    """
    edges = _walls(grid.blocked)
    _check_faces(grid, sum(_run_count(cells) for cells in edges))  # before memory is allocated
    walls = [_runs(cells) for cells in edges]
    tops = _runs(grid.blocked)
    corners = [_top_corners(*_merged(tops))]
    corners += [_wall_corners(side, runs) for side, runs in enumerate(walls)]
    cells = np.concatenate(corners)
    _check_faces(grid, len(cells))
    if not len(cells):
        return EMPTY
    vertices = np.empty((len(cells), 4, 3))
    vertices[:, :, :2] = grid.map_from_cells(cells[:, :, :2].reshape(-1, 2)).reshape(-1, 4, 2)
    vertices[:, :, 2] = np.where(cells[:, :, 2] > 0, top_m, bottom_m)
    first = 4 * np.arange(len(cells), dtype=np.uint32)
    triangles = first[:, None] + np.array(_TRIANGLES, dtype=np.uint32)
    return Mesh(vertices.reshape(-1, 3).astype(np.float32), triangles.reshape(-1, 3))


def _check_faces(grid: GridMap, faces: int) -> None:
    if faces > MAX_FACES:
        raise CommandError(
            f"grid map '{grid.name}' is too irregular: its blocks have at least {faces} "
            f"faces, more than {MAX_FACES}; use a coarser grid or fewer single cells"
        )


def _walls(blocked: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], ...]:
    """Returns cells with a wall towards +x, -x (those two transposed), +y and -y."""
    free = ~np.pad(blocked, 1)
    return (
        (blocked & free[1:-1, 2:]).T,
        (blocked & free[1:-1, :-2]).T,
        blocked & free[2:, 1:-1],
        blocked & free[:-2, 1:-1],
    )


def _runs(cells: NDArray[np.bool_]) -> _Runs:
    """Returns runs of set cells along the rows of `cells`, row by row."""
    step = np.diff(np.pad(cells, ((0, 0), (1, 1))).view(np.int8), axis=1)
    row, first = np.nonzero(step > 0)
    end = np.nonzero(step < 0)[1]
    return _Runs(row, first, end)


def _run_count(cells: NDArray[np.bool_]) -> int:
    """Returns the number of runs that `_runs` finds."""
    begins = np.count_nonzero(cells[:, 1:] > cells[:, :-1])
    return int(begins + np.count_nonzero(cells[:, 0]))


def _merged(runs: _Runs) -> tuple[_Runs, NDArray[np.int64]]:
    """Merges runs of equal extent in consecutive rows; also returns the rows of each."""
    order = np.lexsort((runs.row, runs.end, runs.first))
    row, first, end = (column[order] for column in runs)
    begins = np.ones(len(row), dtype=np.bool_)
    begins[1:] = (first[1:] != first[:-1]) | (end[1:] != end[:-1]) | (row[1:] != row[:-1] + 1)
    start = np.flatnonzero(begins)
    rows = np.diff(np.append(start, len(row)))
    return _Runs(row[start], first[start], end[start]), rows


def _top_corners(runs: _Runs, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Returns (F, 4 corners, 3): column, row, 1 for up; counter-clockwise from outside."""
    x0, x1, y0, y1 = runs.first, runs.end, runs.row, runs.row + rows
    return _quads((x0, y0, 1), (x1, y0, 1), (x1, y1, 1), (x0, y1, 1))


def _wall_corners(side: int, runs: _Runs) -> NDArray[np.float64]:
    """Returns the same for walls towards +x, -x, +y, -y (side 0 to 3)."""
    a, b = (runs.first, runs.end) if side in (0, 3) else (runs.end, runs.first)
    if side < 2:  # along y; rows of the transposed cells are columns
        x = runs.row + (1 if side == 0 else 0)
        return _quads((x, a, 0), (x, b, 0), (x, b, 1), (x, a, 1))
    y = runs.row + (1 if side == 2 else 0)
    return _quads((a, y, 0), (b, y, 0), (b, y, 1), (a, y, 1))


def _quads(
    *corners: tuple[NDArray[np.int64], NDArray[np.int64], int],
) -> NDArray[np.float64]:
    quads = np.empty((len(corners[0][0]), 4, 3))
    for k, corner in enumerate(corners):
        for j, values in enumerate(corner):
            quads[:, k, j] = np.asarray(values)
    return quads
