"""Defines limits of physical quantities; the unit at the end of a key names the quantity.

All checks of data (schemas, data files, node parameters) get the limits of keys such as `mass_kg`,
`drag_area_m2`, `rise_time_s` here. The limits are generous: real values are within, and a value
beyond most likely has another unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple


class Quantity(NamedTuple):
    """Limits of the numbers of a quantity."""

    unit: str
    most: float
    """Maximum magnitude."""
    least: float = 0.0
    """Minimum above 0 for a key that must be positive, because the value may be a divisor."""
    others: Mapping[str, float] = {}
    """Units that are often confused with this one, as factors of it."""
    low: float | None = None
    """Minimum; None: `-most`."""


_LARGEST_INT = 2**63
_MM = {"mm": 1e-3}
_NUMBER = Quantity("", 1e9, 1e-12)
"""Limits of keys without a unit."""
_QUANTITIES: dict[str, Quantity] = {
    # space
    "m": Quantity("m", 1e6, 1e-9, _MM),
    "cm": Quantity("cm", 1e5, 1e-3, {"mm": 0.1}),
    **dict.fromkeys(("radius_m", "range_m"), Quantity("m", 1e6, 1e-9, _MM, 0.0)),
    "m2": Quantity("m2", 1e10, 1e-9, {"mm2": 1e-6}),
    "drag_area_m2": Quantity("m2", 100.0, 1e-9, {"mm2": 1e-6, "cm2": 1e-4}),
    "per_m": Quantity("1/m", 100.0),
    "per_ha": Quantity("1/ha", 1e9),
    "deg": Quantity("deg", 36_000.0, 1e-6),
    "rad": Quantity("rad", 100.0, 1e-9, {"deg": math.pi / 180.0}),
    # time
    "s": Quantity("s", 1e7, 1e-9, {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}, 0.0),
    "hz": Quantity("Hz", 1e6, 1e-4),
    "mhz": Quantity("MHz", 1e6, 1e-6, {"Hz": 1e-6}),
    "mbit_s": Quantity("Mbit/s", 1e6, 1e-6, {"bit/s": 1e-6}),
    "rpm": Quantity("rpm", 1e6),
    # motion
    "m_s": Quantity("m/s", 1000.0, 1e-6, {"mm/s": 1e-3}),
    "deceleration_m_s2": Quantity("m/s^2", 1000.0, 1e-6, {"mm/s^2": 1e-3}, 0.0),
    "m_s2": Quantity("m/s^2", 1000.0, 1e-6, {"mm/s^2": 1e-3}),
    "rad_s": Quantity("rad/s", 1e5, 1e-6, {"deg/s": math.pi / 180.0}),
    "deg_s": Quantity("deg/s", 1e5, 1e-3),
    "1_s": Quantity("1/s", 1000.0),
    # vehicles
    "kg": Quantity("kg", 1000.0, 1e-5, {"g": 1e-3, "mg": 1e-6}),
    "kg_m2": Quantity("kg m2", 1e4, 1e-11, {"kg mm2": 1e-6, "g mm2": 1e-9}),
    "thrust_n_s2": Quantity("N s2", 10.0, 1e-13),
    "drag_n_s2_m": Quantity("N s2/m", 1.0),
    "rolling_n_s2": Quantity("N s2", 1.0),
    "torque_m": Quantity("m", 10.0, 1e-7, _MM),
    "ah": Quantity("Ah", 1e4, 1e-4, {"mAh": 1e-3}),
    "v": Quantity("V", 1e4, 1e-3, {"mV": 1e-3}),
    "ohm": Quantity("ohm", 1000.0, 0.0, {"mohm": 1e-3}),
    "w": Quantity("W", 1e5, 0.0, {"mW": 1e-3}),
    "seed": Quantity("", float(_LARGEST_INT), low=0.0),
    "fraction": Quantity("", 1.0, low=0.0),
    "share": Quantity("", 1.0, low=0.0),
    "damping": Quantity("", 100.0, 1e-3),
    # measurements of sensors, and their noise
    "pa": Quantity("Pa", 1e4, 0.0, {"mPa": 1e-3}),
    "t": Quantity("T", 1.0, 0.0, {"uT": 1e-6, "nT": 1e-9}),
    "ut": Quantity("uT", 1e6, 1e-6),
    "rad_s_sqrt_hz": Quantity("rad/s/sqrt(Hz)", 10.0, 1e-12),
    "rad_s2_sqrt_hz": Quantity("rad/s^2/sqrt(Hz)", 10.0),
    "m_s2_sqrt_hz": Quantity("m/s^2/sqrt(Hz)", 100.0, 1e-12),
    "m_s3_sqrt_hz": Quantity("m/s^3/sqrt(Hz)", 100.0),
    "t_sqrt_hz": Quantity("T/sqrt(Hz)", 1.0),
    "t_s_sqrt_hz": Quantity("T/s/sqrt(Hz)", 1.0),
    "m_sqrt_m": Quantity("m/sqrt(m)", 100.0),
    "rad_sqrt_m": Quantity("rad/sqrt(m)", 10.0),
    "m_sqrt_s": Quantity("m/sqrt(s)", 100.0),
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
    for place, number in _numbers(value, ""):
        if isinstance(number, int):
            if abs(number) > _LARGEST_INT:
                return f"{place}an integer of {number.bit_length()} bits; at most 64 are allowed"
            if known is None:
                continue  # counts and seeds have limits of their own
        elif not math.isfinite(number):
            return f"{place}{number} is not finite"
        tiny = (positive or low == 0.0) and 0 < number < quantity.least
        below = quantity.low is not None and number < quantity.low
        if tiny or below or abs(number) > quantity.most:
            least = quantity.least if positive or tiny else quantity.low if low is None else low
            return place + _beyond(number, quantity, least)
    return None


def _numbers(value: Any, place: str) -> Iterator[tuple[str, int | float]]:
    """Yields the numbers of a value, each with a text for its position."""
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield (f"entry {place}: " if place else ""), value
    elif isinstance(value, list | tuple):
        for k, item in enumerate(value):
            yield from _numbers(item, f"{place}[{k}]")
    elif isinstance(value, dict):
        for name, item in value.items():
            yield from _numbers(item, f"{place}.{name}" if place else str(name))


def _beyond(number: float, quantity: Quantity, low: float | None) -> str:
    unit = f" {quantity.unit}" if quantity.unit else ""
    least = -quantity.most if low is None else low
    told = f"{number:g}{unit} is beyond {least:g} to {quantity.most:g}{unit}"
    for other, factor in quantity.others.items():
        if abs(number) > quantity.most >= abs(number) * factor:
            return f"{told}; given in {other}?"
    return told
