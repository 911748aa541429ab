"""Reads grids of elevations: CSV matrices and ESRI ASCII grids, in m.

A matrix has no header; its first row is at the lowest y. Its cells are those of `core.text_tables`.
An ESRI ASCII grid begins with `ncols`, `nrows`, ... and its first row is at the highest y (Esri,
"ESRI ASCII raster format"); its entries are separated by blanks, in lines of any length, and may
have decimal commas. Comments (`#`) and Excel's first row `sep=;` are left out of both.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.core.text_files import decode_text
from volery.core.text_tables import is_not_measured, matrix_cells, matrix_lines

_SHOWN_FAULTS = 20
_DEEPEST_M, _HIGHEST_M = -12_000.0, 9_000.0
"""Limits beyond any elevation on the earth: other numbers are marks, or in another unit."""
_NO_DATA = (-9999.0, -99999.0, -32767.0, -32768.0)
"""Common marks of cells without data."""
_ESRI_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize",
              "dx", "dy", "nodata_value")  # fmt: skip
_WORD = "nodata"
"""Stands for no data, as the words of `core.text_tables` do."""
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_SAME = 1e-6
"""Relative tolerance of two spacings."""


def read_elevations(path: Path, spacing_m: float) -> NDArray[np.float64]:
    """Returns heights (rows along y, columns along x), m, row 0 at the lowest y.

    spacing_m: of the grid; an ESRI grid must have it, too. Raises `DataFileError`, naming the file
    and every invalid row.
    """
    lines = _lines(path)
    head = _esri_head(path, lines)
    for key in ("cellsize", "dx", "dy"):
        if abs(head.get(key, spacing_m) - spacing_m) > _SAME * spacing_m:
            raise DataFileError(
                f"elevation grid {path}: its {key} is {head[key]:g}, spacing_m is {spacing_m:g}"
            )
    shape = (head.get("nrows", 0.0), head.get("ncols", 0.0))
    heights = _rows(path, lines, len(head), head.get("nodata_value"), shape if head else None)
    if not head:
        _refuse_points(path, heights)
        return heights
    for key, own, what in zip(("nrows", "ncols"), heights.shape, ("row", "value"), strict=True):
        if key in head and head[key] != own:
            raise DataFileError(
                f"elevation grid {path}: {key} is {head[key]:g}; it has {counted(own, what)}"
            )
    return heights[::-1].copy()


def _lines(path: Path) -> list[tuple[int, str]]:
    """Returns numbers and texts of the lines that hold the grid."""
    try:
        data = path.read_bytes()
        if data.startswith(_TIFF):
            raise DataFileError(
                f"elevation grid {path} is a GeoTIFF; `gdal_translate -of AAIGrid` writes an ESRI "
                "ASCII grid, which can be read"
            )
        return list(matrix_lines(decode_text(data)))
    except FileNotFoundError:
        raise DataFileError(f"elevation grid {path} does not exist") from None
    except UnicodeDecodeError:
        raise DataFileError(f"elevation grid {path} is not text in UTF-8") from None
    except OSError as error:
        raise DataFileError(f"elevation grid {path} cannot be read: {error.strerror}") from None


def _refuse_points(path: Path, heights: NDArray[np.float64]) -> None:
    """Raises `DataFileError` for a list of x y z, which is no matrix of heights."""
    if heights.shape[1] != 3 or len(heights) < 4:
        return
    axes = [np.unique(heights[:, k]) for k in (0, 1)]
    is_grid = len(axes[0]) * len(axes[1]) == len(heights) and min(map(len, axes)) > 1
    if is_grid and len(np.unique(heights[:, :2], axis=0)) == len(heights):
        raise DataFileError(
            f"elevation grid {path} is a list of x y z, as its three columns show: write the "
            "heights as a matrix, or as an ESRI ASCII grid (`gdal_translate -of AAIGrid`)"
        )


def _esri_head(path: Path, lines: list[tuple[int, str]]) -> dict[str, float]:
    """Returns the header of an ESRI ASCII grid by lower-case keys; empty for a plain matrix."""
    head: dict[str, float] = {}
    for number, line in lines:
        words = line.split()
        if not words or words[0].lower() not in _ESRI_KEYS:
            break
        key, value = words[0].lower(), words[1] if len(words) > 1 else ""
        try:
            is_word = key == "nodata_value" and bool(value) and _is_no_data(value)
            head[key] = math.nan if is_word else float(value.replace(",", "."))
        except (IndexError, ValueError):
            raise DataFileError(
                f"elevation grid {path}: row {number}: '{words[0]}' needs a number"
            ) from None
    return head


def _rows(
    path: Path,
    lines: list[tuple[int, str]],
    skipped: int,
    no_data: float | None,
    shape: tuple[float, float] | None,
) -> NDArray[np.float64]:
    """Returns the numbers of lines; shape: of an ESRI grid, None for a matrix."""
    rows: list[list[float]] = []
    faults: list[str] = []
    uneven: list[str] = []
    columns = 0
    comma = shape is not None and not any("." in line for _, line in lines[skipped:])
    for number, line in lines[skipped:]:
        if shape is None or len(line.split()) == 1:
            fields = _fields(path, number, line)
        else:
            fields = (line.replace(",", ".") if comma else line).split()
        columns = columns or len(fields)
        if len(fields) != columns:
            uneven.append(
                f"row {number} has {counted(len(fields), 'value')}, the first row {columns}"
            )
            if shape is None:
                continue
        values, fault = _values(fields, no_data)
        if fault:
            faults.append(f"row {number}, {fault}")
        rows.append(values)
    total = sum(map(len, rows))
    if shape and not faults and math.prod(shape) == total > 0 and shape[1] in range(1, total + 1):
        columns = int(shape[1])
        rows = np.concatenate(rows).reshape(-1, columns).tolist()
    else:
        faults += uneven
    if faults:
        more = len(faults) - _SHOWN_FAULTS
        shown = "; ".join(faults[:_SHOWN_FAULTS]) + (f"; and {more} more" if more > 0 else "")
        raise DataFileError(f"elevation grid {path}: {shown}")
    if len(rows) < 2 or columns < 2:
        raise DataFileError(
            f"elevation grid {path} has {counted(len(rows), 'row')} of "
            f"{counted(columns, 'value')}; at least 2 x 2 needed"
        )
    return np.array(rows)


def _fields(path: Path, number: int, line: str) -> list[str]:
    try:
        return matrix_cells(line)
    except csv.Error as error:
        raise DataFileError(f"elevation grid {path}: row {number}: {error}") from None


def _is_no_data(text: str) -> bool:
    return is_not_measured(text) or text.strip().lower() == _WORD


def _values(fields: list[str], no_data: float | None) -> tuple[list[float], str]:
    """Returns the numbers of a row, and its first fault with the column; "" without one."""
    values: list[float] = []
    for column, text in enumerate(fields, start=1):
        try:
            value = _value(text)
        except ValueError:
            return [], f"column {column}: not a number"
        fault = _wrong(value, no_data)
        if fault:
            return [], f"column {column}: {fault}"
        values.append(value)
    return values, ""


def _value(text: str) -> float:
    """Returns the number of a cell; NaN for a mark of missing data. Raises `ValueError`."""
    try:
        return float(text)
    except ValueError:
        if text.strip() and _is_no_data(text):
            return math.nan
        raise


def _wrong(value: float, no_data: float | None) -> str:
    if value == no_data or value in _NO_DATA or math.isnan(value):
        return f"{value:g} marks a place without data; fill such places first"
    if not math.isfinite(value):
        return "not finite"
    if not _DEEPEST_M <= value <= _HIGHEST_M:
        return (
            f"{value:g} is no elevation in m, which lie between {_DEEPEST_M:g} and {_HIGHEST_M:g}"
        )
    return ""
