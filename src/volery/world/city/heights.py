"""Heights of buildings from the properties of their features."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

TALLEST_M = 1000.0
"""Maximum height; larger numbers are errors."""
_INCH_M = 0.0254
_LONGEST = 60
"""Maximum characters of a height that are read."""
_NUMBER = r"(\d+(?:[.,]\d*)?|[.,]\d+)"
_LENGTH = re.compile(rf"(?:~|ca\.?)?\s*{_NUMBER}\s*([a-z]*)\.?", re.IGNORECASE)
_INCH = r"(?:\"|in|inch|inches)"
_FEET_AND_INCHES = re.compile(
    rf"{_NUMBER}\s*(?:'|ft|feet|foot)(?:\s*-?\s*{_NUMBER}\s*{_INCH}?)?|{_NUMBER}\s*{_INCH}",
    re.IGNORECASE,
)
_QUOTES = str.maketrans("\u2032\u2019\u2018\u00b4`\u2033\u201d\u201c", "'" * 5 + '"' * 3)
"""Primes and quotes that stand for feet and inches."""
_UNITS_M = {
    **dict.fromkeys(("", "m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("cm", "centimetres", "centimeters"), 0.01),
    **dict.fromkeys(("mm", "millimetres", "millimeters"), 0.001),
    **dict.fromkeys(("ft", "feet", "foot"), 0.3048),
    **dict.fromkeys(("yd", "yard", "yards"), 0.9144),
}
_HEIGHTS = ("height", "building:height", "est_height")
_MOST_LEVELS = 300.0


@dataclass(frozen=True)
class HeightRule:
    """Defaults for unmapped heights; both are modelling choices.

    storey_m: height of a storey where only the number of levels is known, and between windows.
    default_m: of a building without any data.
    """

    storey_m: float = 3.2
    default_m: float = 16.0


@dataclass(frozen=True)
class Height:
    """Height above the lowest ground along a building's outline, m, and its storeys.

    source: "height", "levels" or "default". fault: values that could not be parsed, if any.
    """

    height_m: float
    storeys: int
    source: str
    fault: str = ""

    @property
    def storey_m(self) -> float:
        """Height of a storey, m."""
        return self.height_m / max(self.storeys, 1)


def height_of(properties: Mapping[str, Any], rule: HeightRule) -> Height:
    """Returns a building's `height` (m, or with a unit), else its levels times the storey height.

    `building:height` and `est_height` stand in for `height`. Levels are `building:levels` or
    `levels`. As in OpenStreetMap, `height` counts from the lowest
    point on the ground to the top.
    """
    faults = []
    given = next((properties[key] for key in _HEIGHTS if _is_given(properties.get(key))), None)
    levels, fault = _levels(properties)
    if fault:
        faults.append(fault)
    if given is not None:
        height = _length_m(given)
        if height is not None:
            storeys = max(1, round(levels if levels else height / rule.storey_m))
            return Height(height, storeys, "height", "; ".join(faults))
        faults.append(f"height {given!r} is no length in m".strip()[:120])
    if levels:
        return Height(levels * rule.storey_m, max(1, round(levels)), "levels", "; ".join(faults))
    storeys = max(1, round(rule.default_m / rule.storey_m))
    return Height(rule.default_m, storeys, "default", "; ".join(faults))


def _levels(properties: Mapping[str, Any]) -> tuple[float | None, str]:
    for key in ("building:levels", "levels"):
        given = properties.get(key)
        if not _is_given(given):
            continue
        # "3;4": parts of different height in one outline; the tallest counts
        parts = str(given).split(";") if isinstance(given, str | int | float) else []
        numbers = [n for n in map(_number, parts) if n is not None and 0.0 < n <= _MOST_LEVELS]
        if parts and len(numbers) == len(parts) and not isinstance(given, bool):
            return max(numbers), ""
        if _number(str(given)) == 0.0:  # a hall without storeys
            return None, ""
        return None, f"{key} {given!r} is no number of levels"[:120]
    return None, ""


def _length_m(given: Any) -> float | None:
    """Returns a length in m: a number, one with a unit, or feet and inches; else None.

    Of several lengths, separated by semicolons, the largest counts.
    """
    if isinstance(given, bool) or not isinstance(given, str | int | float):
        return None
    text = str(given)
    if len(text) > _LONGEST:
        return None
    lengths = [_one_length_m(part.strip()) for part in text.split(";")]
    known = [length for length in lengths if length is not None and 0.0 < length <= TALLEST_M]
    return max(known) if len(known) == len(lengths) else None


def _is_given(value: Any) -> bool:
    """Returns whether a property has a value: tables write empty texts and NaN for none."""
    if isinstance(value, str):
        return bool(value.strip())
    return value is not None and not (isinstance(value, float) and math.isnan(value))


def _one_length_m(text: str) -> float | None:
    match = _LENGTH.fullmatch(text)
    if match is not None and match[2].lower() in _UNITS_M:
        return _decimal(match[1]) * _UNITS_M[match[2].lower()]
    plain = text.translate(_QUOTES).replace("'" * 2, '"')
    match = _FEET_AND_INCHES.fullmatch(plain)
    if match is None:
        return None
    feet, inches, alone = (_decimal(part) if part else 0.0 for part in match.groups())
    return (12.0 * feet + inches + alone) * _INCH_M


def _decimal(text: str) -> float:
    return float(text.replace(",", "."))


def _number(text: str) -> float | None:
    try:
        number = _decimal(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
