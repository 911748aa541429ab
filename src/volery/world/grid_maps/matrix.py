"""Grid maps as text: a matrix of 0 (free) and 1 (blocked), one row per line."""

from __future__ import annotations

import csv

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.core.text_files import decode_text
from volery.core.text_tables import matrix_cells, matrix_lines
from volery.world.grid_maps.grid_map import MAX_CELLS

_ZERO, _ONE, _COMMA = (ord(character) for character in "01,")
_WORDS = {"false": 0.0, "true": 1.0}
"""Entries of matrices of truth values, in any case."""
_SHOWN = 20
"""Maximum characters of the input that an error shows."""


def parse_matrix(data: bytes, where: str) -> NDArray[np.bool_]:
    """Returns blocked cells (rows, columns), row 0: the first line.

    Entries are those of `core.text_tables`, or `True` and `False`. Raises `DataFileError`, naming
    line and column, for other input.
    """
    rows: list[NDArray[np.bool_]] = []
    cells = 0
    for number, line in matrix_lines(_text(data, where)):
        row = _row(line, f"{where}, line {number}")
        if rows and len(row) != len(rows[0]):
            raise DataFileError(
                f"{where}, line {number} has {counted(len(row), 'entry', 'entries')}; "
                f"the lines before it {len(rows[0])}"
            )
        cells += len(row)
        if cells > MAX_CELLS:
            raise DataFileError(f"{where}: more than {MAX_CELLS} entries")
        rows.append(row)
    if not rows:
        raise DataFileError(f"{where}: it has no row; a matrix of 0 and 1 is needed")
    return np.stack(rows)


def _text(data: bytes, where: str) -> str:
    try:
        return decode_text(data)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DataFileError(
            f"{where}, line {line}: not text in UTF-8 (byte {data[error.start]:#04x})"
        ) from None


def _row(line: str, where: str) -> NDArray[np.bool_]:
    """Returns the entries of a line: at once in the usual form, otherwise one by one."""
    compact = line.replace(" ", "") if "," in line else line
    if compact.isascii():
        codes = np.frombuffer(compact.encode(), dtype=np.uint8)
        entries, between = codes[0::2], codes[1::2]
        plain = ((entries == _ZERO) | (entries == _ONE)).all() and (between == _COMMA).all()
        if plain and len(entries) > len(between):
            return np.asarray(entries == _ONE)
    try:
        words = matrix_cells(line)
    except csv.Error as error:
        raise DataFileError(f"{where}: {error}") from None
    return np.array([_entry(word, where, k) for k, word in enumerate(words, 1)], dtype=np.bool_)


def _entry(word: str, where: str, column: int) -> bool:
    try:
        value = float(word)
    except ValueError:
        value = _WORDS.get(word.strip().lower(), -1.0)
    if value not in (0.0, 1.0):
        raise DataFileError(
            f"{where}, column {column}: '{word.strip()[:_SHOWN]}'; allowed are 0 and 1"
        )
    return value == 1.0
