"""Grid maps of the benchmarks of movingai.com.

The format is that of N. R. Sturtevant, "Benchmarks for grid-based pathfinding", 2012, as described
on movingai.com: four header lines (`type octile`, `height`, `width`, `map`), then a character per
cell. `.` and `G` are passable, `S` (swamp) from regular terrain, too; `@` and `O` are out of
bounds, `T` trees, `W` water that cannot be entered from terrain: these four are blocked.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.world.grid_maps.grid_map import MAX_CELLS

FREE, BLOCKED = b".GS", b"@OTW"
_HEAD_LINES = 4
_LONGEST_NUMBER = 9


def parse_moving_ai(data: bytes, where: str) -> NDArray[np.bool_]:
    """Returns blocked cells (rows, columns), row 0: the first line after the header.

    Raises `DataFileError`, naming line and column, for other input.
    """
    lines = data.removeprefix(b"\xef\xbb\xbf").splitlines()
    height, width = _head(lines, where)
    rows = lines[_HEAD_LINES:]
    while len(rows) > height and not rows[-1].strip():
        rows.pop()
    if len(rows) != height:
        raise DataFileError(
            f"{where}: {counted(len(rows), 'row')} after the header, which states {height}"
        )
    cells = np.empty((height, width), dtype=np.uint8)
    for k, row in enumerate(rows):
        line = f"{where}, line {_HEAD_LINES + k + 1}"
        if len(row) != width:
            raise DataFileError(
                f"{line} has {counted(len(row), 'cell')}; the header states {width}"
            )
        cells[k] = np.frombuffer(row, dtype=np.uint8)
    blocked = np.isin(cells, np.frombuffer(BLOCKED, dtype=np.uint8))
    unknown = np.argwhere(~blocked & ~np.isin(cells, np.frombuffer(FREE, dtype=np.uint8)))
    if len(unknown):
        row, column = unknown[0].tolist()
        raise DataFileError(
            f"{where}, line {_HEAD_LINES + row + 1}, column {column + 1}: "
            f"{chr(cells[row, column])!r}; allowed are . G S (free) and @ O T W (blocked)"
        )
    return np.asarray(blocked)


def _head(lines: list[bytes], where: str) -> tuple[int, int]:
    words = [line.split() for line in lines[:_HEAD_LINES]]
    wanted = ("'type octile'", "'height N'", "'width N'", "'map'")
    sizes: dict[bytes, int] = {}
    for k, what in enumerate(wanted):
        found = words[k] if k < len(words) else []
        fits = {
            0: found == [b"type", b"octile"],
            3: found == [b"map"],
        }.get(k, len(found) == 2 and found[0] in (b"height", b"width") and _is_number(found[1]))
        if not fits:
            raise DataFileError(
                f"{where}, line {k + 1}: a MovingAI map begins with {', '.join(wanted)}; "
                f"{what} is missing"
            )
        if k in (1, 2):
            sizes[found[0]] = int(found[1])
    height, width = sizes.get(b"height", 0), sizes.get(b"width", 0)
    if not 0 < height * width <= MAX_CELLS:
        raise DataFileError(
            f"{where}: {width} x {height} cells; allowed are 1 to {MAX_CELLS} in all"
        )
    return height, width


def _is_number(word: bytes) -> bool:
    return word.isdigit() and len(word) <= _LONGEST_NUMBER
