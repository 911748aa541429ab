"""Heights of buildings from the tags of their features."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from volery.world.city.tags import Tags, is_given

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
_HEIGHTS = ("height", "building_height", "est_height", "measuredheight")
"""Tags of OpenStreetMap, and of CityGML."""
_LEVELS = ("building_levels", "levels", "num_floors")
"""Tags of OpenStreetMap, and of Overture Maps."""
_MIN_LEVELS = ("building_min_level", "min_level", "min_floor")
_UNKNOWN = (-1.0, -999.0, -9999.0, -99999.0)
"""Marks of unknown heights: of Microsoft's building footprints, and of GIS programs."""
_MAX_LEVELS = 300.0


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

    source: "height", "levels" or "default". fault: values that could not be parsed, if any. base_m:
    height of the lower side of what hangs in the air, m; 0 for what is on the ground.
    """

    height_m: float
    storeys: int
    source: str
    fault: str = ""
    base_m: float = 0.0

    @property
    def storey_m(self) -> float:
        """Height of a storey, m."""
        return self.height_m / max(self.storeys, 1)


def height_of(tags: Tags, rule: HeightRule) -> Height:
    """Returns a building's `height` (m, or with a unit), else its levels times the storey height.

    `building:height`, `est_height` and CityGML's `measuredHeight` stand in for `height`, each with
    its unit in the name or without (`height_ft`). Levels are `building:levels`, `levels` or
    `num_floors`. As in OpenStreetMap, `height` counts from the lowest point on the ground to the
    top, `min_height` (or `building:min_level`) to the lower side of what does not reach the ground.
    """
    levels, fault = _levels(tags, _LEVELS)
    faults = [fault]
    height, fault = _length_in(tags, _HEIGHTS)
    faults.append(fault)
    source = "height" if height else "levels" if levels else "default"
    height = height or (levels * rule.storey_m if levels else rule.default_m)
    storeys = max(1, round(levels or height / rule.storey_m))
    base, fault = _base_m(tags, height / levels if levels else rule.storey_m, height)
    faults.append(fault)
    return Height(height, storeys, source, "; ".join(filter(None, faults)), base)


def _base_m(tags: Tags, storey_m: float, height_m: float) -> tuple[float, str]:
    """Returns the height of the lower side, m, and a fault."""
    base, fault = _length_in(tags, ("min_height",))
    if base is None and not fault:
        level, fault = _levels(tags, _MIN_LEVELS)
        base = (level or 0.0) * storey_m
    if base is not None and base >= height_m:
        return 0.0, f"its lower side, {base:g} m, is not below its height, {height_m:g} m"
    return base or 0.0, fault


def _levels(tags: Tags, keys: tuple[str, ...]) -> tuple[float | None, str]:
    for key in keys:
        given = tags.get(key)
        if not _is_known(given):
            continue
        # "3;4": parts of different height in one outline; the tallest counts
        parts = str(given).split(";") if isinstance(given, str | int | float) else []
        numbers = [n for n in map(_number, parts) if n is not None and 0.0 < n <= _MAX_LEVELS]
        if parts and len(numbers) == len(parts) and not isinstance(given, bool):
            return max(numbers), ""
        if _number(str(given)) == 0.0:  # a hall without storeys
            return None, ""
        return None, f"{key} {given!r} is no number of levels"[:120]
    return None, ""


def _length_in(tags: Tags, names: tuple[str, ...]) -> tuple[float | None, str]:
    """Returns the first length in m of these names, each with a unit or without, and a fault."""
    for name in names:
        for unit, unit_m in _UNITS_M.items():
            given = tags.get(f"{name}_{unit}" if unit else name)
            if not _is_known(given):
                continue
            length = _length_m(given, unit_m)
            if length is None and not (name == "min_height" and _number(str(given)) == 0.0):
                return None, f"{name} {given!r} is no length in m".strip()[:120]
            return length, ""
    return None, ""


def _is_known(given: Any) -> bool:
    return is_given(given) and _number(str(given)) not in _UNKNOWN


def _length_m(given: Any, unit_m: float) -> float | None:
    """Returns a length in m: a number, one with a unit, or feet and inches; else None.

    unit_m: of a number without a unit. Of several lengths, separated by semicolons, the largest
    counts.
    """
    if isinstance(given, bool) or not isinstance(given, str | int | float):
        return None
    text = str(given)
    if len(text) > _LONGEST:
        return None
    lengths = [_one_length_m(part.strip(), unit_m) for part in text.split(";")]
    known = [length for length in lengths if length is not None and 0.0 < length <= TALLEST_M]
    return max(known) if len(known) == len(lengths) else None


def _one_length_m(text: str, unit_m: float) -> float | None:
    match = _LENGTH.fullmatch(text)
    if match is not None and match[2].lower() in _UNITS_M:
        return _decimal(match[1]) * (_UNITS_M[match[2].lower()] if match[2] else unit_m)
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
