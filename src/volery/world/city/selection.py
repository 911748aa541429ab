"""Selects the buildings among the features of a file.

An export of OpenStreetMap holds lakes, lawns, car parks and boundaries beside buildings. A file in
which any feature has a tag `building` or `building:part`, with or without a value, counts as such
an export: a feature without that tag is no building. In other files all outlines are buildings.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from volery.world.city.geojson import Feature
from volery.world.city.tags import Tags, is_given

_BUILT = ("building", "building_part")
_UNBUILT = ("no", "false", "0", "proposed", "planned", "demolished", "razed", "removed",
            "destroyed")  # fmt: skip
"""Values of `building` of what is not there. Construction sites count as buildings."""
_KEYS = ("natural", "landuse", "leisure", "amenity", "highway", "boundary", "water", "waterway",
         "place", "man_made", "railway", "aeroway", "power", "barrier", "tourism", "historic",
         "public_transport", "military", "shop", "office", "area_highway", "indoor")  # fmt: skip
"""Keys of OpenStreetMap that say what an area is."""
_SHOWN = 5


class Selection(NamedTuple):
    """Features that are buildings, in the file's order, and the ids and reasons of the others."""

    buildings: tuple[Feature, ...]
    others: tuple[tuple[str, str], ...]


def select_buildings(features: Sequence[Feature]) -> Selection:
    """Returns the buildings among the features of a file."""
    is_tagged = any(key in feature.tags for feature in features for key in _BUILT)
    why = [_why_none(feature.tags, is_tagged=is_tagged) for feature in features]
    return Selection(
        tuple(feature for feature, fault in zip(features, why, strict=True) if not fault),
        tuple((feature.id, fault) for feature, fault in zip(features, why, strict=True) if fault),
    )


def is_part(tags: Tags) -> bool:
    """Returns whether a building is mapped as a part of another one only."""
    whole, part = (_text(tags, key) for key in _BUILT)
    return bool(part) and part not in _UNBUILT and (not whole or whole in _UNBUILT)


def reasons_in_words(others: Iterable[tuple[str, str]]) -> str:
    """Returns the most frequent reasons, separated by commas."""
    counts = Counter(why for _, why in others).most_common()
    shown = [why for why, _ in counts[:_SHOWN]]
    return ", ".join([*shown, "..."] if len(counts) > _SHOWN else shown)


def _why_none(tags: Tags, *, is_tagged: bool) -> str:
    """Returns the tag that shows that a feature is no building; empty for a building."""
    if _text(tags, "is_underground") in ("true", "yes", "1"):  # of Overture Maps
        return "underground"
    if not is_tagged:
        return ""
    built = [text for text in (_text(tags, key) for key in _BUILT) if text]
    if any(text not in _UNBUILT for text in built):
        return "underground" if _text(tags, "location") == "underground" else ""
    what = next((key for key in _KEYS if _text(tags, key)), "")
    return what or (f"building={built[0]}" if built else "without a tag building")


def _text(tags: Tags, key: str) -> str:
    value = tags.get(key)
    return str(value).strip().lower() if is_given(value) else ""
