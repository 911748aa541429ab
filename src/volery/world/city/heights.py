"""Heights of buildings from the properties of their features."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

TALLEST_M = 1000.0
"""Maximum height; larger numbers are errors."""
_FOOT_M = 0.3048
_LENGTH = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(m|metres|meters|ft|feet|'|)\s*", re.IGNORECASE)
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

    Levels are `building:levels` or `levels`. As in OpenStreetMap, `height` counts from the lowest
    point on the ground to the top.
    """
    faults = []
    given = properties.get("height")
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
        if given is None:
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
    if isinstance(given, bool):
        return None
    match = _LENGTH.fullmatch(str(given)) if isinstance(given, str | int | float) else None
    if match is None:
        return None
    length = float(match[1]) * (
        1.0 if match[2].lower().startswith("m") or not match[2] else _FOOT_M
    )
    return length if 0.0 < length <= TALLEST_M else None


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
