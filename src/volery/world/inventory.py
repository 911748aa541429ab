"""Reads tree inventories: CSV files with a header row and one tree per row.

Columns `x_m` and `y_m` are required; `dbh_cm`, `height_m` and `species` may follow in any order.
An empty field means "not measured", as does `NA`, which R writes. A column without a name, such as
the row numbers of pandas, is ignored. Species may have any name (see `species_map`). All invalid
rows are reported together, with their row numbers in the file (the header is row 1). Fields are
separated by commas, or by semicolons or tabs, as spreadsheets of many countries export them; then a
number may have a decimal comma.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.world.inventory_doubts import question

_REQUIRED = ("x_m", "y_m")
_OPTIONAL = ("dbh_cm", "height_m", "species")
_SEPARATORS = ",;\t"
_NOT_MEASURED = "NA"
_SHOWN_FAULTS = 20
_SHOWN_LETTERS = 40
_THICKEST_CM, _TALLEST_M = 1500.0, 130.0
"""Limits beyond any living tree: larger numbers are errors of units."""


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
    try:
        text = path.read_text(encoding="utf-8-sig")
        separator = _separator(text.partition("\n")[0])
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
    except FileNotFoundError:
        raise DataFileError(f"inventory {path} does not exist") from None
    except UnicodeDecodeError:
        raise DataFileError(f"inventory {path} is not UTF-8; save it as CSV in UTF-8") from None
    except (OSError, csv.Error) as error:
        raise DataFileError(f"inventory {path} cannot be read: {error}") from None
    if not rows or not any(field.strip() for field in rows[0]):
        raise DataFileError(f"inventory {path} is empty; its first row must name the columns")
    columns = _columns(path, [field.strip() for field in rows[0]])
    faults: list[str] = []
    numbers: list[list[float]] = []
    names: list[str] = []
    sound: list[int] = []
    for number, row in enumerate(rows[1:], start=2):
        if not any(field.strip() for field in row):
            continue
        fault, values, name = _parse(row, columns, len(rows[0]), separator)
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
    table = np.array(numbers, dtype=np.float64).reshape(-1, 4)
    question(f"inventory {path.name}", np.array(sound, dtype=np.int64), table)
    return Inventory(table[:, :2], table[:, 2], table[:, 3], tuple(names))


def _separator(heading: str) -> str:
    """Returns what separates the names of the columns."""
    return max(_SEPARATORS, key=heading.count)


def _columns(path: Path, heading: list[str]) -> dict[str, int]:
    allowed = ", ".join((*_REQUIRED, *_OPTIONAL))
    named = [name for name in heading if name]
    for name in named:
        if name not in _REQUIRED + _OPTIONAL:
            at = heading.index(name) + 1
            raise DataFileError(
                f"inventory {path}: row 1, column {at}: unknown name {name[:_SHOWN_LETTERS]!r}; "
                f"allowed: {allowed}"
            )
        if heading.count(name) > 1:
            raise DataFileError(f"inventory {path}: column {name!r} occurs twice")
    for name in _REQUIRED:
        if name not in heading:
            raise DataFileError(f"inventory {path}: column {name!r} is missing; allowed: {allowed}")
    return {name: heading.index(name) for name in named}


def _parse(
    row: list[str], columns: dict[str, int], width: int, separator: str
) -> tuple[str, list[float], str]:
    """Returns the error of a row ("" if none), x, y, dbh and height in m, species."""
    if len(row) != width:
        return f"{counted(len(row), 'field')}, the heading has {width}", [], ""
    values: list[float] = []
    for column in ("x_m", "y_m", "dbh_cm", "height_m"):
        text = row[columns[column]].strip() if column in columns else ""
        if text in ("", _NOT_MEASURED):
            if column in _REQUIRED:
                return f"{column} is empty", [], ""
            values.append(math.nan)
            continue
        try:
            value = float(text if separator == "," else text.replace(",", "."))
        except ValueError:
            return f"{column} is not a number", [], ""
        fault = _wrong(column, value)
        if fault:
            return f"{column} {value:g} {fault}", [], ""
        values.append(value / 100.0 if column == "dbh_cm" else value)
    name = row[columns["species"]].strip() if "species" in columns else ""
    return "", values, "" if name == _NOT_MEASURED else name


def _wrong(column: str, value: float) -> str:
    if not math.isfinite(value):
        return "is not finite"
    if column in _REQUIRED:
        return ""
    if value <= 0.0:
        return "must be above 0"
    highest = _THICKEST_CM if column == "dbh_cm" else _TALLEST_M
    return f"is above {highest:g}" if value > highest else ""
