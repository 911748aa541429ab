"""Reads a user-defined beam pattern from a CSV file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.clock import NS_PER_S
from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.core.text_tables import TextTable, number_in, plain_name, read_table, warn_of_unread

_NEEDED = ("azimuth_deg", "elevation_deg", "time_s")
_MAX_RINGS = 65535


class BeamList(NamedTuple):
    """N beams in the order of the file."""

    direction: NDArray[np.float64]
    """(3, N) unit vectors in the sensor frame, FLU."""
    time_ns: NDArray[np.int64]
    """(N,) ns after the start of the sweep."""
    ring: NDArray[np.uint16]
    """(N,) ring number of each beam."""


def read_beams(path: Path, longest_s: float, max_beams: int) -> BeamList:
    """Reads a table with the columns azimuth_deg, elevation_deg, time_s and optionally ring.

    `core.text_tables` reads it. Times must begin at 0 or later, never decrease and not exceed
    `longest_s`; the file may have from 2 to `max_beams` beams. Raises `DataFileError`, naming file,
    row and allowed values, if the file violates this.
    """
    table = read_table(path, "beam table")
    names = [plain_name(name) for name in table.heading]
    known = (*_NEEDED, "ring")
    if not set(_NEEDED) <= set(names) or any(names.count(name) > 1 for name in known):
        raise DataFileError(
            f"{path}: row 1 must name the columns {', '.join(_NEEDED)} and optionally ring"
        )
    unread = (table.heading[k] for k, name in enumerate(names) if name and name not in known)
    warn_of_unread(f"beam table {path.name}", unread)
    rows = _rows_of(table, [names.index(name) for name in known if name in names], path)
    if not 2 <= len(rows) <= max_beams:
        raise DataFileError(f"{path}: {counted(len(rows), 'beam')}; allowed are 2 to {max_beams}")
    beams = np.array(rows)
    _check_times(beams[:, 2], longest_s, path)
    azimuth, elevation = np.radians(beams[:, 0]), np.radians(beams[:, 1])
    level = np.cos(elevation)
    return BeamList(
        np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]),
        np.round(beams[:, 2] * NS_PER_S).astype(np.int64),
        beams[:, 3].astype(np.uint16),
    )


def _rows_of(table: TextTable, columns: list[int], path: Path) -> list[list[float]]:
    """Returns azimuth and elevation, deg, time, s, and ring of each row."""
    comma = table.has_decimal_commas(columns)
    rows = []
    for number, row in table.rows:
        cells = [row[k] for k in columns] if len(row) == len(table.heading) else []
        values = [number_in(cell, decimal_comma=comma) for cell in cells]
        numbers = [value for value in values if value is not None]
        if not cells or len(numbers) < len(values):
            raise DataFileError(f"{path}: row {number}: every entry must be a number")
        azimuth, elevation, time_s, ring = (*numbers, math.nan)[:4]
        ring = 0.0 if math.isnan(ring) else ring
        is_valid = np.isfinite((azimuth, elevation, time_s)).all() and abs(elevation) <= 90.0
        if not (is_valid and 0.0 <= ring <= _MAX_RINGS and ring.is_integer()):
            raise DataFileError(
                f"{path}: row {number}: numbers must be finite, elevation_deg within +-90, "
                f"ring within 0..{_MAX_RINGS}"
            )
        rows.append([azimuth, elevation, time_s, ring])
    return rows


def _check_times(time_s: NDArray[np.float64], longest_s: float, path: Path) -> None:
    backward = np.flatnonzero(np.diff(time_s, prepend=0.0) < 0.0)
    if len(backward):
        raise DataFileError(
            f"{path}: beam {int(backward[0]) + 1}: time_s must not be negative nor decrease"
        )
    if time_s[-1] > longest_s:
        raise DataFileError(f"{path}: time_s may be 1 / rate_hz = {longest_s:g} at most")
