"""Reads wind fields: a CSV table of nodes or a numpy .npz archive.

A .csv or .txt file names its columns `x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s` in its first row and holds
one node of a regular grid per row, both in any order; `core.text_tables` reads it. An .npz file
holds `velocity_m_s` (Z, Y, X, 3), `origin_m` (3,) and `spacing_m` (3,).
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.core.text_tables import number_in, plain_name, read_table, warn_of_unread
from volery.scenario.wind import MAX_WIND_M_S

Field = tuple[Array, tuple[float, float, float], tuple[float, float, float]]

_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
_SHAPES = {"velocity_m_s": "(Z, Y, X, 3)", "origin_m": "(3,)", "spacing_m": "(3,)"}
_SHOWN_FAULTS = 20
_SHOWN_LETTERS = 60
_MAX_BYTES = 1_000_000_000
_SLACK = 1e-2
"""Tolerance of a node's position as a fraction of the spacing: written coordinates are rounded."""


def read_wind_field(path: Path) -> Field:
    """Reads velocities (Z, Y, X, 3) m/s, origin (3,) m and spacing (3,) m of a file, map frame.

    Raises one `DataFileError` that names the file and every invalid row.
    """
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".txt", ".npz"):
        raise DataFileError(f"wind field {path}: a .csv or an .npz file is needed")
    if not path.is_file():
        raise DataFileError(f"wind field {path} does not exist")
    return _read_npz(path) if suffix == ".npz" else _read_csv(path)


# --------------------------------------------------------------------------------------------- npz


def _read_npz(path: Path) -> Field:
    try:
        _check_size(path)
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            held = {name: np.asarray(archive[name], np.float64) for name in _SHAPES}
    except KeyError:
        wanted = ", ".join(f"{name} {shape}" for name, shape in _SHAPES.items())
        raise DataFileError(f"wind field {path} must hold {wanted}") from None
    except Exception as error:  # zipfile raises any exception for a broken file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise DataFileError(f"wind field {path} cannot be read: {reason}") from None
    velocity, origin, spacing = held.values()
    for name, shape in _SHAPES.items():
        right = held[name].shape == (3,) if name != "velocity_m_s" else _is_grid(velocity)
        if not right:
            raise DataFileError(
                f"wind field {path}: {name} has shape {held[name].shape}, not {shape}"
            )
    wrong = np.argwhere(~(np.abs(velocity) <= MAX_WIND_M_S))
    if len(wrong):
        node, value = tuple(wrong[0].tolist()), velocity[tuple(wrong[0])]
        raise DataFileError(
            f"wind field {path}: velocity_m_s{list(node)} = {value:g}; finite numbers within "
            f"+-{MAX_WIND_M_S:g} m/s are allowed"
        )
    if not np.isfinite(origin).all():
        raise DataFileError(f"wind field {path}: origin_m must be finite")
    if not ((spacing > 0.0) & np.isfinite(spacing)).all():
        raise DataFileError(f"wind field {path}: spacing_m must be above 0")
    return velocity, _three(origin), _three(spacing)


def _check_size(path: Path) -> None:
    """Raises `ValueError` for an archive that unpacks to more than `_MAX_BYTES`."""
    with zipfile.ZipFile(path) as archive:
        size = sum(member.file_size for member in archive.infolist())
    if size > _MAX_BYTES:
        raise ValueError(f"it unpacks to {size / 1e6:.0f} MB; {_MAX_BYTES / 1e6:.0f} are allowed")


def _is_grid(velocity: Array) -> bool:
    return velocity.ndim == 4 and velocity.shape[3] == 3 and 0 not in velocity.shape


# --------------------------------------------------------------------------------------------- csv


def _read_csv(path: Path) -> Field:
    numbers, table = _rows_of(path)
    faults: list[str] = []
    axes = [_axis_of(path, table[:, k], name) for k, name in enumerate(_COLUMNS[:3])]
    shape = tuple(len(axis) for axis in axes)
    cells = np.empty((len(table), 3), np.int64)
    for k, axis in enumerate(axes):
        step = axis[1] - axis[0] if len(axis) > 1 else 1.0
        near = np.rint((table[:, k] - axis[0]) / step)
        cells[:, k] = np.clip(near, 0, len(axis) - 1)
        off = np.abs(table[:, k] - (axis[0] + cells[:, k] * step)) > _SLACK * step
        for row in np.flatnonzero(off):
            faults.append(
                f"row {numbers[row]}: {_COLUMNS[k]} {table[row, k]:g} is not on the grid "
                f"{_shown(axis)}"
            )
    _report(path, faults)
    flat = np.asarray(np.ravel_multi_index(tuple(cells.T), shape))
    _check_complete(path, flat, numbers, axes)
    velocity = np.empty((int(np.prod(shape)), 3))
    velocity[flat] = table[:, 3:]
    grid = velocity.reshape(*shape, 3).transpose(2, 1, 0, 3)
    spacing = [axis[1] - axis[0] if len(axis) > 1 else 1.0 for axis in axes]
    return grid, _three([axis[0] for axis in axes]), _three(spacing)


def _rows_of(path: Path) -> tuple[list[int], Array]:
    """Returns row numbers in the file and the table (M, 6) of `_COLUMNS`."""
    text = read_table(path, "wind field")
    names = [plain_name(name) for name in text.heading]
    if any(names.count(name) != 1 for name in _COLUMNS):
        raise DataFileError(
            f"wind field {path}: row 1 must name the columns {','.join(_COLUMNS)}, not "
            f"{', '.join(text.heading)[:_SHOWN_LETTERS]}"
        )
    order = [names.index(name) for name in _COLUMNS]
    unread = (text.heading[k] for k, name in enumerate(names) if name and name not in _COLUMNS)
    warn_of_unread(f"wind field {path.name}", unread)
    comma = text.has_decimal_commas(order)
    faults: list[str] = []
    numbers, table = [], []
    for number, row in text.rows:
        fault, values = _parse(row, order, len(names), comma=comma)
        if fault:
            faults.append(f"row {number}: {fault}")
        else:
            numbers.append(number)
            table.append(values)
    _report(path, faults)
    if not table:
        raise DataFileError(f"wind field {path} has no nodes below its heading")
    return numbers, np.array(table)


def _parse(row: list[str], order: list[int], width: int, *, comma: bool) -> tuple[str, list[float]]:
    """Returns the error of a row ("" if none), and its numbers in the order of `_COLUMNS`."""
    if len(row) != width:
        return f"{counted(len(row), 'field')}, the heading has {width}", []
    values = []
    for name, column in zip(_COLUMNS, order, strict=True):
        text = row[column].strip()
        value = number_in(text, decimal_comma=comma)
        if value is None:
            return f"{name} is not a number: {text[:_SHOWN_LETTERS]!r}", []
        if math.isnan(value):
            return f"{name} is empty: {text[:_SHOWN_LETTERS]!r}", []
        limit = MAX_WIND_M_S if name.endswith("_m_s") else 1e6
        if not abs(value) <= limit:
            return f"{name} {value:g} is out of range; +-{limit:g} is allowed", []
        values.append(value)
    return "", values


def _axis_of(path: Path, column: Array, name: str) -> Array:
    """Returns the evenly spaced coordinates that nearly every line of nodes has."""
    values, counts = np.unique(column, return_counts=True)
    axis = values[2 * counts >= counts.max()]
    even: Array = np.linspace(axis[0], axis[-1], len(axis))
    if len(axis) > 2 and np.abs(axis - even).max() > _SLACK * (even[1] - even[0]):
        raise DataFileError(f"wind field {path}: {name} must be evenly spaced, not {_shown(axis)}")
    return even


def _check_complete(
    path: Path, flat: NDArray[np.intp], numbers: list[int], axes: list[Array]
) -> None:
    _, first, inverse = np.unique(flat, return_index=True, return_inverse=True)
    earlier = first[inverse]
    _report(
        path,
        [
            f"row {numbers[row]} repeats the node of row {numbers[earlier[row]]}"
            for row in np.flatnonzero(earlier != np.arange(len(flat)))
        ],
    )
    shape = tuple(len(axis) for axis in axes)
    count = int(np.prod(shape))
    if len(flat) < count:
        gap = int(np.argmax(np.append(np.sort(flat), count) != np.arange(len(flat) + 1)))
        at = np.unravel_index(gap, shape)
        node = ", ".join(f"{axis[i]:g}" for axis, i in zip(axes, at, strict=True))
        raise DataFileError(
            f"wind field {path} has {len(flat)} of the {count} nodes of its grid; the first gap is "
            f"at ({node}) m"
        )


def _report(path: Path, faults: list[str]) -> None:
    if faults:
        more = len(faults) - _SHOWN_FAULTS
        shown = "; ".join(faults[:_SHOWN_FAULTS]) + (f"; and {more} more" if more > 0 else "")
        raise DataFileError(f"wind field {path}: {shown}")


def _shown(axis: Array) -> str:
    few = [f"{value:g}" for value in axis[:4]]
    return ", ".join([*few, "..."] if len(axis) > 4 else few)


def _three(values: Array | list[float]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
