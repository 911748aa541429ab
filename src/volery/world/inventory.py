"""Reads tree inventories: CSV files with a header row and one tree per row.

Columns `x_m` and `y_m` are required; `dbh_cm`, `height_m` and `species` may follow in any order, in
other units (see `inventory_columns`); others are ignored. An empty field means "not measured", as
do the marks of R, pandas, Excel and GIS programs (`NA`, `nan`, `#N/A`, -9999). Species may have any
name (see `species_map`). All invalid rows are reported together, with their row numbers in the
file. A warning tells of numbers that are possible but most likely in another unit.
`core.text_tables` reads the fields: where they are not separated by commas, a number may have a
decimal comma, and then all have.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.core.text_tables import is_not_measured, number_in, read_table
from volery.world.inventory_columns import REQUIRED, ColumnOf, columns_of

_log = logging.getLogger(__name__)

_MARKS = (-999.0, -9999.0, -99999.0)
"""Numbers that stand for values that were not measured."""
_NUMBERS = ("x_m", "y_m", "dbh_cm", "height_m")
_SHOWN_FAULTS = 20
_SHOWN_LETTERS = 20
_THICKEST_CM, _TALLEST_M = 1500.0, 130.0
"""Limits beyond any living tree: larger numbers are errors of units."""
_THINNEST_USUAL_CM, _THICKEST_USUAL_CM = 1.0, 400.0
"""Inventories begin at 1 cm (that of Barro Colorado) or more; few giants exceed 4 m."""
_SLENDEREST = 500.0
"""Height by diameter; the slenderest trees of dense stands reach about 200."""
_TOGETHER_M = 1.0


@dataclass(frozen=True, eq=False)
class Inventory:
    """Surveyed trees: N rows, lengths in m, NaN and "" where not measured.

    position: (N, 2) in the map. dbh_m, height_m: (N,). species: N names.
    """

    position: NDArray[np.float64]
    dbh_m: NDArray[np.float64]
    height_m: NDArray[np.float64]
    species: tuple[str, ...]

    def __len__(self) -> int:
        """Number of trees."""
        return len(self.position)

    def moved(self, by: tuple[float, float]) -> Inventory:
        """Returns the trees displaced by x and y, m."""
        return replace(self, position=self.position + np.array(by))

    def within(self, region: tuple[float, float, float, float]) -> Inventory:
        """Returns trees with x0 <= x < x1 and y0 <= y < y1 of `region` (x0, y0, x1, y1), m."""
        x, y = self.position.T
        kept = (x >= region[0]) & (x < region[2]) & (y >= region[1]) & (y < region[3])
        rows = np.flatnonzero(kept)
        return Inventory(
            self.position[rows],
            self.dbh_m[rows],
            self.height_m[rows],
            tuple(self.species[k] for k in rows),
        )


def read_inventory(path: str | Path) -> Inventory:
    """Reads an inventory; raises one `DataFileError` that lists every invalid row."""
    path = Path(path)
    table = read_table(path, "inventory")
    heading = table.heading
    try:
        columns = columns_of(heading, f"inventory {path.name}")
    except ValueError as error:
        raise DataFileError(f"inventory {path}: {error}") from None
    comma = table.has_decimal_commas(c.position for k, c in columns.items() if k in _NUMBERS)
    faults: list[str] = []
    numbers: list[list[float]] = []
    names: list[str] = []
    sound: list[int] = []
    for number, row in table.rows:
        fault, values, name = _parse(row, columns, len(heading), comma=comma)
        if fault:
            faults.append(f"row {number}: {fault}")
        else:
            numbers.append(values)
            names.append(name)
            sound.append(number)
    if faults:
        shown = "; ".join(faults[:_SHOWN_FAULTS])
        others = [fault.split(":")[0].removeprefix("row ") for fault in faults[_SHOWN_FAULTS:]]
        shown += f"; and rows {', '.join(others)}" if others else ""
        plural = "row" if len(faults) == 1 else "rows"
        raise DataFileError(f"inventory {path} has {len(faults)} bad {plural}: {shown}")
    measured = np.array(numbers, dtype=np.float64).reshape(-1, 4)
    _warn_of_units(f"inventory {path.name}", np.array(sound, dtype=np.int64), measured)
    return Inventory(measured[:, :2], measured[:, 2], measured[:, 3], tuple(names))


def _parse(
    row: list[str], columns: dict[str, ColumnOf], width: int, *, comma: bool
) -> tuple[str, list[float], str]:
    """Returns the error of a row ("" if none), x, y, dbh and height in m, species."""
    if len(row) != width:
        return f"{counted(len(row), 'field')}, the heading has {width}", [], ""
    values: list[float] = []
    last = math.nan
    for name in _NUMBERS:
        column = columns.get(name)
        text = "" if column is None else row[column.position].strip()
        value = number_in(text, decimal_comma=comma)
        shown = repr(text[:_SHOWN_LETTERS])
        if value is None:
            other = f", other rows have decimal commas: {shown}" if comma and "." in text else ""
            return f"{name} is not a number{other or f': {shown}'}", [], ""
        if name in REQUIRED:
            if math.isnan(value):
                return f"{name} is empty" + (f": {shown}" if text else ""), [], ""
            if value in _MARKS and value == last:
                return f"x_m and y_m are {value:g}, which marks what is not measured", [], ""
        elif math.isnan(value) or value in _MARKS:
            values.append(math.nan)
            continue
        last = value
        value *= 1.0 if column is None else column.factor
        fault = _wrong(name, value)
        if fault:
            return f"{name} {value:g} {fault}", [], ""
        values.append(value / 100.0 if name == "dbh_cm" else value)
    species = row[columns["species"].position].strip() if "species" in columns else ""
    return "", values, "" if is_not_measured(species) else species


def _wrong(column: str, value: float) -> str:
    if not math.isfinite(value):
        return "is not finite"
    if column in REQUIRED:
        return ""
    if value <= 0.0:
        return "must be above 0; an empty field means not measured"
    highest = _THICKEST_CM if column == "dbh_cm" else _TALLEST_M
    return f"is above {highest:g}" if value > highest else ""


def _warn_of_units(where: str, rows: NDArray[np.int64], table: NDArray[np.float64]) -> None:
    """Logs one warning for each doubtful column, once for each file.

    where: names the inventory. rows: (N,) of the file. table: (N, 4) x, y, diameter and height in
    m, NaN where not measured.
    """
    x, y, dbh, height = table.T
    with np.errstate(invalid="ignore", divide="ignore"):
        thin = (100.0 * dbh < _THINNEST_USUAL_CM) | (height / dbh > _SLENDEREST)
        thick = 100.0 * dbh > _THICKEST_USUAL_CM
    for doubtful, unit in ((thin, "m"), (thick, "mm")):
        if doubtful.any():
            first = int(np.argmax(doubtful))
            _warn(
                f"{where}: row {rows[first]}: dbh_cm is {100.0 * dbh[first]:.4g}"
                + (f", with a height of {height[first]:g} m" if height[first] > 0.0 else "")
                + f"; is it in {unit}? ({counted(int(doubtful.sum()), 'tree')} of {len(rows)})"
            )
    _, first_of = np.unique(table, axis=0, return_index=True, equal_nan=True)
    repeated = np.setdiff1d(np.arange(len(x)), first_of)
    if len(repeated):
        _warn(
            f"{where}: row {rows[repeated[0]]} repeats a row above it; does the file hold trees "
            f"twice? ({counted(len(repeated), 'tree')} of {len(rows)})"
        )
    in_degrees = len(first_of) > 1 and np.abs(x).max() <= 180.0 and np.abs(y).max() <= 90.0
    if in_degrees and max(np.ptp(x), np.ptp(y)) < _TOGETHER_M:
        _warn(f"{where}: all {len(rows)} trees are within 1 m; are x_m and y_m in degrees?")


@lru_cache(maxsize=100)
def _warn(text: str) -> None:
    """Logs a warning once, however often the same file is read."""
    _log.warning("%s", text)
