"""Reads a user-defined beam pattern from a CSV file."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.clock import NS_PER_S
from volery.core.errors import DataFileError
from volery.core.plurals import counted

_NEEDED = ("azimuth_deg", "elevation_deg", "time_s")
_MOST_RINGS = 65535


class BeamList(NamedTuple):
    """N beams in the order of the file."""

    direction: NDArray[np.float64]
    """(3, N) unit vectors in the sensor frame, FLU."""
    time_ns: NDArray[np.int64]
    """(N,) ns after the start of the sweep."""
    ring: NDArray[np.uint16]
    """(N,) ring number of each beam."""


def read_beams(path: Path, longest_s: float, most: int) -> BeamList:
    """Reads a CSV file with the columns azimuth_deg, elevation_deg, time_s and optionally ring.

    Times must begin at 0 or later, never decrease and not exceed `longest_s`; the file may have
    from 2 to `most` beams. Raises `DataFileError`, naming file, line and allowed values, if the
    file violates this.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            columns = tuple(reader.fieldnames or ())
            if not set(_NEEDED) <= set(columns) <= {*_NEEDED, "ring"}:
                raise DataFileError(
                    f"{path}: row 1 must name the columns {', '.join(_NEEDED)} and optionally ring"
                )
            rows = [_row(row, path, reader.line_num) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataFileError(f"{path}: cannot be read: {error}") from None
    if not 2 <= len(rows) <= most:
        raise DataFileError(f"{path}: {counted(len(rows), 'beam')}; allowed are 2 to {most}")
    table = np.array(rows)
    _check_times(table[:, 2], longest_s, path)
    azimuth, elevation = np.radians(table[:, 0]), np.radians(table[:, 1])
    level = np.cos(elevation)
    return BeamList(
        np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]),
        np.round(table[:, 2] * NS_PER_S).astype(np.int64),
        table[:, 3].astype(np.uint16),
    )


def _row(row: dict[str, str | None], path: Path, line: int) -> list[float]:
    try:
        values = [float(row[name] or "") for name in _NEEDED]
        ring = int(row.get("ring") or 0)
    except (ValueError, TypeError):
        raise DataFileError(f"{path}: line {line}: every entry must be a number") from None
    if not (np.isfinite(values).all() and abs(values[1]) <= 90.0 and 0 <= ring <= _MOST_RINGS):
        raise DataFileError(
            f"{path}: line {line}: numbers must be finite, elevation_deg within +-90, "
            f"ring within 0..{_MOST_RINGS}"
        )
    return [*values, float(ring)]


def _check_times(time_s: NDArray[np.float64], longest_s: float, path: Path) -> None:
    backward = np.flatnonzero(np.diff(time_s, prepend=0.0) < 0.0)
    if len(backward):
        raise DataFileError(
            f"{path}: beam {int(backward[0]) + 1}: time_s must not be negative nor decrease"
        )
    if time_s[-1] > longest_s:
        raise DataFileError(f"{path}: time_s may be 1 / rate_hz = {longest_s:g} at most")
