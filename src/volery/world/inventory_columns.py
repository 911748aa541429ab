"""Names of an inventory's columns, with the units in which surveys write them.

`x_m`, `y_m`, `dbh_cm` and `height_m` may be in other units and spellings: `DBH (mm)`, `Ht_ft`,
`Easting [m]`, `girth_cm`. A measured quantity without a unit is refused, not guessed. Columns of
anything else are ignored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from volery.core.text_tables import plain_name, warn_of_unread

REQUIRED = ("x_m", "y_m")
_OPTIONAL = ("dbh_cm", "height_m", "species")
ALLOWED = ", ".join((*REQUIRED, *_OPTIONAL))
_SPECIES = "species"
_UNITS_M = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    "cm": 0.01,
    "mm": 0.001,
    **dict.fromkeys(("ft", "feet"), 0.3048),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
}
_CIRCUMFERENCE = ("circumference", "cbh", "gbh", "girth")
_QUANTITIES = {
    **dict.fromkeys(("x", "easting"), "x_m"),
    **dict.fromkeys(("y", "northing"), "y_m"),
    **dict.fromkeys(("dbh", "diameter", *_CIRCUMFERENCE), "dbh_cm"),
    **dict.fromkeys(("height", "ht", "tree_height"), "height_m"),
}
"""Columns by the names of quantities."""
_DEGREES = ("lat", "lon", "lng", "long", "latitude", "longitude")
_FILE_UNIT_M = {"dbh_cm": 0.01}
_SHOWN_LETTERS = 40


class ColumnOf(NamedTuple):
    """Position of a column in the rows, and what its numbers are multiplied by."""

    position: int
    factor: float = 1.0


def columns_of(heading: Sequence[str], where: str) -> dict[str, ColumnOf]:
    """Returns the columns by name: `x_m`, `y_m`, `dbh_cm`, `height_m`, `species`.

    where: names the file and row in messages. Raises `ValueError` for a quantity without a unit or
    in degrees, for one that occurs twice, and if the position is missing.
    """
    found: dict[str, ColumnOf] = {}
    ignored = []
    for position, written in enumerate(heading):
        if not written:  # row numbers of pandas
            continue
        try:
            name, factor = _named(written)
        except ValueError as error:
            raise ValueError(f"row 1, column {position + 1}: {error}") from None
        if not name:
            ignored.append(written[:_SHOWN_LETTERS])
        elif name in found:
            raise ValueError(f"column {name!r} occurs twice")
        else:
            found[name] = ColumnOf(position, factor)
    for name in REQUIRED:
        if name not in found:
            others = f"the file has {', '.join(ignored)}; " if ignored else ""
            raise ValueError(f"column {name!r} is missing; {others}allowed: {ALLOWED}")
    warn_of_unread(where, ignored)
    return found


def _named(written: str) -> tuple[str, float]:
    """Returns a column's name and factor; an empty name for a column of something else."""
    plain = plain_name(written)
    if plain == _SPECIES:
        return plain, 1.0
    base, _, unit = plain.rpartition("_")
    if unit not in _UNITS_M:
        base, unit = plain, ""
    shown = written[:_SHOWN_LETTERS]
    if base in _DEGREES:
        raise ValueError(
            f"unknown name {shown!r}: positions are x_m and y_m in a plane; project degrees to it"
        )
    name = _QUANTITIES.get(base, "")
    if not name:
        return "", 1.0
    if not unit:
        raise ValueError(
            f"unknown name {shown!r}: it needs its unit, such as {base}_m or {base}_ft; "
            f"allowed: {ALLOWED}"
        )
    factor = _UNITS_M[unit] / _FILE_UNIT_M.get(name, 1.0)
    return name, factor / math.pi if base in _CIRCUMFERENCE else factor
