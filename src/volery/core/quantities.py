"""Defines limits of physical quantities; the unit at the end of a key names the quantity.

All checks of data (schemas, data files, node parameters) get the limits of keys such as `mass_kg`,
`drag_area_m2`, `rise_time_s` here. The limits are generous: real values are within, and a value
beyond most likely has another unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from volery.core.data_tables import read_table


class Quantity(NamedTuple):
    """Limits of the numbers of a quantity."""

    unit: str
    maximum: float
    """Maximum magnitude."""
    smallest: float = 0.0
    """Minimum above 0 for a key that must be positive, because the value may be a divisor."""
    others: Mapping[str, float] = {}
    """Units that are often confused with this one, as factors of it."""
    low: float | None = None
    """Minimum; None: `-maximum`."""


_LARGEST_INT = 2**63
_NUMBER = Quantity("", 1e9, 1e-12)
"""Limits of keys without a unit."""
_QUANTITIES = {
    ending: Quantity(**fields) for ending, fields in read_table(__file__, "quantities.toml").items()
}


def quantity_of(key: str, special: Mapping[str, Quantity] | None = None) -> Quantity | None:
    """Returns the quantity of a key's ending, None without one.

    The longest ending counts; `special` takes precedence for equal endings.
    """
    parts = key.split("_")
    endings = ["_".join(parts[k:]) for k in range(len(parts))]
    for ending in endings:
        for table in (special or {}, _QUANTITIES):
            if ending in table:
                return table[ending]
    return None


def fault_in(
    key: str,
    value: Any,
    *,
    special: Mapping[str, Quantity] | None = None,
    low: float | None = None,
    positive: bool = False,
) -> str | None:
    """Returns the problem with the numbers of `key`, in lists and tables too; None without one.

    special: quantities of one kind of data. low: minimum of the key itself, for the message.
    positive: whether only numbers above 0 are allowed.
    """
    known = quantity_of(key, special)
    quantity = known or _NUMBER
    for where, number in _numbers(value, ""):
        if isinstance(number, int):
            if abs(number) > _LARGEST_INT:
                return f"{where}an integer of {number.bit_length()} bits; at most 64 are allowed"
            if known is None:
                continue  # counts and seeds have limits of their own
        elif not math.isfinite(number):
            return f"{where}{number} is not finite"
        tiny = (positive or low == 0.0) and 0 < number < quantity.smallest
        below = quantity.low is not None and number < quantity.low
        if tiny or below or abs(number) > quantity.maximum:
            lowest = quantity.smallest if positive or tiny else quantity.low if low is None else low
            return where + _beyond(number, quantity, lowest)
    return None


def _numbers(value: Any, where: str) -> Iterator[tuple[str, int | float]]:
    """Yields the numbers of a value, each with a text for its position."""
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield (f"entry {where}: " if where else ""), value
    elif isinstance(value, list | tuple):
        for k, item in enumerate(value):
            yield from _numbers(item, f"{where}[{k}]")
    elif isinstance(value, dict):
        for name, item in value.items():
            yield from _numbers(item, f"{where}.{name}" if where else str(name))


def _beyond(number: float, quantity: Quantity, low: float | None) -> str:
    unit = f" {quantity.unit}" if quantity.unit else ""
    lowest = -quantity.maximum if low is None else low
    text = f"{number:g}{unit} is beyond {lowest:g} to {quantity.maximum:g}{unit}"
    for other, factor in quantity.others.items():
        if abs(number) > quantity.maximum >= abs(number) * factor:
            return f"{text}; given in {other}?"
    return text
