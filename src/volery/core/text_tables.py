"""Tables and matrices of numbers in text, as spreadsheets, pandas, R and numpy write them.

Text is UTF-8, or UTF-16 with its byte order mark. Cells are separated by semicolons, bars, tabs,
commas or blanks, and may be in quotes; where the separator is not a comma, numbers may have decimal
commas. Excel's first row `sep=;` and comments, which begin with `#`, are left out.
"""

from __future__ import annotations

import csv
import io
import logging
import math
import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from volery.core.errors import DataFileError
from volery.core.plain_text import plain
from volery.core.text_files import decode_text

_log = logging.getLogger(__name__)

_SEPARATORS = ",;\t|"
_SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
"""First bytes of .xlsx, .ods and .xls files."""
_SEPARATOR_ROW = re.compile(r'"?sep=([,;\t|])"?', re.IGNORECASE)
"""First row that Excel understands, and other programs do not write."""
_NOT_MEASURED = ("", "na", "n/a", "nan", "null", "none", "-", ".")
_EXCEL_ERROR = re.compile(r"#(?:[^\W\d_][\w/]*[!?]|N/\w|NV)", re.IGNORECASE)
"""Errors of Excel's formulas: `#N/A` (in other languages `#NV`, `#N/D`), `#VALUE!`, `#NAME?` ..."""
_BLANK_BETWEEN = re.compile(r"[^\s,][ \t]+[^\s,]")
"""Blanks that are not beside a comma, and therefore separate."""
_SHOWN_LETTERS = 40


class TextTable(NamedTuple):
    """Rows below a heading.

    heading: names of the columns. rows: number of the row in the file, from 1, and its cells.
    separator: between cells.
    """

    heading: list[str]
    rows: list[tuple[int, list[str]]]
    separator: str

    def has_decimal_commas(self, columns: Iterable[int]) -> bool:
        """Returns whether numbers in these columns have decimal commas."""
        if self.separator == ",":
            return False
        width = len(self.heading)
        return any("," in row[k] for k in columns for _, row in self.rows if len(row) == width)


def read_table(path: Path, what: str) -> TextTable:
    """Reads a table with a heading; messages begin with `what` and the path.

    The heading may be the last comment, as `numpy.savetxt` writes it. Raises `DataFileError`.
    """
    try:
        data = path.read_bytes()
        if data.startswith(_SPREADSHEETS):
            raise DataFileError(f"{what} {path} is a spreadsheet; save it as CSV in UTF-8")
        table = _table_of(decode_text(data))
    except FileNotFoundError:
        raise DataFileError(f"{what} {path} does not exist") from None
    except UnicodeDecodeError:
        raise DataFileError(f"{what} {path} is not UTF-8; save it as CSV in UTF-8") from None
    except (OSError, csv.Error) as error:
        raise DataFileError(f"{what} {path} cannot be read: {error}") from None
    if table is None:
        raise DataFileError(f"{what} {path} is empty; its first row must name the columns")
    return table


def _table_of(text: str) -> TextTable | None:
    """Returns the table of a text; None if it has no row."""
    lines = list(io.StringIO(text, newline=""))
    above, comment, separator = 0, "", ""
    for line in lines:
        excel = _SEPARATOR_ROW.fullmatch(line.strip("\r\n"))
        if excel:
            separator = excel[1]
        elif _is_comment(line):
            comment = line
        elif line.strip():
            break
        above += 1
    if above == len(lines):
        return None
    first = lines[above]
    heading = _heading_in(comment, first, separator)
    if heading is not None:
        separator = heading.separator
    elif not separator or separator not in first:
        separator = _separator_of_names(first)
    numbered = enumerate(_cells(lines[above:], separator), start=above + 1)
    rows = [(k, row) for k, row in numbered if any(cell.strip() for cell in row)]
    if not rows:
        return None
    names = heading.names if heading is not None else _stripped(rows.pop(0)[1])
    while rows and rows[-1][1][0].startswith("# ") and len(rows[-1][1]) != len(names):
        rows.pop()  # a comment below
    # R's write.table gives row names, and no name to their column
    if separator != "," and rows and all(len(row) == len(names) + 1 for _, row in rows):
        is_named = any(row[-1].strip() for _, row in rows)
        names = ["", *names] if is_named else [*names, ""]
    return TextTable(names, rows, separator)


class _Heading(NamedTuple):
    names: list[str]
    separator: str


def _heading_in(comment: str, first: str, separator: str) -> _Heading | None:
    """Returns the names in a comment above a first row of as many cells, of which one is a number.

    separator: of the rows; empty if unknown.
    """
    plain = comment.strip('" \t\r\n').lstrip("#").strip()
    own = _separator_of_names(plain)
    names = _stripped(next(_cells([plain], own), []))
    for between in (separator,) if separator else (own, _separator_of(first.strip())):
        cells = next(_cells([first], between), [])
        if len(cells) == len(names) > 1 and any(map(_is_number, cells)):
            return _Heading(names, between)
    return None


def _separator_of_names(line: str) -> str:
    separator = max(_SEPARATORS, key=line.count)
    return " " if separator not in line and " " in line.strip() else separator


def _cells(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    if separator == " ":
        lines = (line.strip() for line in lines)
    return csv.reader(lines, delimiter=separator, skipinitialspace=True)


def _stripped(cells: Iterable[str]) -> list[str]:
    return [cell.strip() for cell in cells]


def plain_name(name: str) -> str:
    """Returns a column's name in lower case with underscores only: `Vx (m/s)` as `vx_m_s`."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def warn_of_unread(where: str, names: Iterable[str]) -> None:
    """Logs a warning about columns that are not read, once for each file; none without names."""
    shown = plain(", ".join(name[:_SHOWN_LETTERS] for name in names))
    if shown:
        _warn(f"{where}: columns that are not read: {shown}")


@lru_cache(maxsize=100)
def _warn(text: str) -> None:
    _log.warning("%s", text)


def matrix_lines(text: str) -> Iterator[tuple[int, str]]:
    """Returns the numbers, from 1, and texts of the lines of a matrix without a heading.

    Empty lines, comments and Excel's `sep=;` are left out.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not _is_comment(line) and not _SEPARATOR_ROW.fullmatch(line):
            yield number, line


def matrix_cells(line: str) -> list[str]:
    """Returns the cells of a matrix's line, with decimal points.

    A separator may end the line. Raises `csv.Error` for cells beyond the limits of `csv`.
    """
    line = line.strip()
    separator = _separator_of(line)
    if separator != ",":
        line = line.replace(",", ".")
    if '"' in line:
        cells = next(_cells([line], separator))
    else:
        cells = line.split() if separator == " " else line.split(separator)
    if len(cells) > 1 and not cells[-1].strip():
        cells.pop()
    return cells


def _separator_of(line: str) -> str:
    for separator in ";|":
        if separator in line:
            return separator
    if "," in line and not _BLANK_BETWEEN.search(line):
        return ","
    return "\t" if "\t" in line and ("," in line or " " not in line) else " "


def _is_comment(line: str) -> bool:
    plain = line.lstrip('" \t')
    return plain.startswith("#") and not _EXCEL_ERROR.match(plain)


def _is_number(text: str) -> bool:
    value = number_in(text.replace(",", "."), decimal_comma=False)
    return value is not None and not math.isnan(value)


def is_not_measured(text: str) -> bool:
    """Returns whether a cell marks a missing value: it is empty, `NA`, `-`, Excel's `#N/A`, ..."""
    plain = text.strip()
    return plain.lower() in _NOT_MEASURED or _EXCEL_ERROR.fullmatch(plain) is not None


def number_in(text: str, *, decimal_comma: bool) -> float | None:
    """Returns the number in a cell, NaN where nothing was measured; None for other text.

    With decimal commas a number has no point.
    """
    if is_not_measured(text):
        return math.nan
    if decimal_comma and "." in text:
        return None
    try:
        return float(text.replace(",", ".") if decimal_comma else text)
    except ValueError:
        return None
