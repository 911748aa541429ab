"""Reads grids of elevations: CSV matrices and ESRI ASCII grids, in m.

A matrix has no header; its first row is at the lowest y. Entries are separated by commas,
semicolons, tabs or blanks; with semicolons a comma is a decimal point. An ESRI ASCII grid begins
with `ncols`, `nrows`, ... and its first row is at the highest y (Esri, "ESRI ASCII raster format").
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.plurals import counted

_SHOWN_FAULTS = 20
_DEEPEST_M, _HIGHEST_M = -12_000.0, 9_000.0
"""Limits beyond any elevation on the earth: other numbers are marks, or in another unit."""
_NO_DATA = (-9999.0, -99999.0, -32767.0, -32768.0)
"""Common marks of cells without data."""
_ESRI_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize",
              "nodata_value")  # fmt: skip
_SAME = 1e-6
"""Relative tolerance of two spacings."""


def read_elevations(path: Path, spacing_m: float) -> NDArray[np.float64]:
    """Returns heights (rows along y, columns along x), m, row 0 at the lowest y.

    spacing_m: of the grid; an ESRI grid must have it, too. Raises `DataFileError`, naming the file
    and every invalid row.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise DataFileError(f"elevation grid {path} does not exist") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"elevation grid {path} cannot be read: {error}") from None
    head = _esri_head(path, lines)
    cell_m = head.get("cellsize", spacing_m)
    if abs(cell_m - spacing_m) > _SAME * spacing_m:
        raise DataFileError(
            f"elevation grid {path}: its cellsize is {cell_m:g}, spacing_m is {spacing_m:g}"
        )
    heights = _rows(path, lines, len(head), head.get("nodata_value"))
    if not head:
        return heights
    for key, own, what in zip(("nrows", "ncols"), heights.shape, ("row", "value"), strict=True):
        if key in head and head[key] != own:
            raise DataFileError(
                f"elevation grid {path}: {key} is {head[key]:g}; it has {counted(own, what)}"
            )
    return heights[::-1].copy()


def _esri_head(path: Path, lines: list[str]) -> dict[str, float]:
    """Returns the header of an ESRI ASCII grid by lower-case keys; empty for a plain matrix."""
    head: dict[str, float] = {}
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words or words[0].lower() not in _ESRI_KEYS:
            break
        try:
            head[words[0].lower()] = float(words[1])
        except (IndexError, ValueError):
            raise DataFileError(
                f"elevation grid {path}: row {number}: '{words[0]}' needs a number"
            ) from None
    return head


def _rows(path: Path, lines: list[str], skipped: int, no_data: float | None) -> NDArray[np.float64]:
    rows: list[list[float]] = []
    faults: list[str] = []
    columns = 0
    for number, line in enumerate(lines[skipped:], start=skipped + 1):
        if not line.strip():
            continue
        fields = _fields(line)
        columns = columns or len(fields)
        if len(fields) != columns:
            faults.append(
                f"row {number} has {counted(len(fields), 'value')}, the first row {columns}"
            )
            continue
        values, fault = _values(fields, no_data)
        if fault:
            faults.append(f"row {number}, {fault}")
        rows.append(values)
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


def _fields(line: str) -> list[str]:
    if ";" in line:
        fields = line.replace(",", ".").split(";")
    elif "," in line:
        fields = line.split(",")
    else:
        return line.split()
    if not fields[-1].strip():  # a separator ends the line
        fields.pop()
    return fields


def _values(fields: list[str], no_data: float | None) -> tuple[list[float], str]:
    """Returns the numbers of a row, and its first fault with the column; "" without one."""
    values: list[float] = []
    for column, text in enumerate(fields, start=1):
        try:
            value = float(text)
        except ValueError:
            return [], f"column {column}: not a number"
        fault = _wrong(value, no_data)
        if fault:
            return [], f"column {column}: {fault}"
        values.append(value)
    return values, ""


def _wrong(value: float, no_data: float | None) -> str:
    if not math.isfinite(value):
        return "not finite"
    if value == no_data or value in _NO_DATA:
        return f"{value:g} marks a place without data; fill such places first"
    if not _DEEPEST_M <= value <= _HIGHEST_M:
        return (
            f"{value:g} is no elevation in m, which lie between {_DEEPEST_M:g} and {_HIGHEST_M:g}"
        )
    return ""
