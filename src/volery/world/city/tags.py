"""Tags of features: what is mapped, whatever the exporter calls it and wherever it puts it.

Names are in lower case with underscores: `building:levels`, `BUILDING_LEVELS` and `Building levels`
are `building_levels`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from volery.core.text_tables import plain_name

Tags = Mapping[str, Any]

_NESTED = ("tags", "other_tags", "all_tags")
"""Properties that hold tags: of osmtogeojson, GDAL, osm2pgsql and pyrosm."""
_QUOTED = r'"((?:[^"\\]|\\.)*+)"'
_HSTORE = re.compile(rf"{_QUOTED}\s*=>\s*(?:{_QUOTED}|NULL)", re.DOTALL)
"""A pair in the text format of PostgreSQL's hstore."""
_LONGEST = 100_000
"""Maximum characters of tags in one text."""


def tags_of(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a feature's tags by plain names; of several of one name, the first with a value.

    Besides the properties, these are the tags in `tags`, `other_tags` and `all_tags`, as an object,
    as its JSON, or as hstore text (`"height"=>"9"`).
    """
    tags: dict[str, Any] = {}
    nested = []
    for key, value in properties.items():
        name = plain_name(key)
        if name in _NESTED and isinstance(value, dict | str):
            nested.append(value)
        else:
            _add(tags, name, value)
    for value in nested:
        for key, own in _pairs(value):
            _add(tags, plain_name(key), own)
    return tags


def is_given(value: Any) -> bool:
    """Returns whether a tag has a value: tables write empty texts and NaN for none."""
    if isinstance(value, str):
        return bool(value.strip())
    return value is not None and not (isinstance(value, float) and math.isnan(value))


def _add(tags: dict[str, Any], name: str, value: Any) -> None:
    if name and not is_given(tags.get(name)):
        tags[name] = value


def _pairs(held: dict[str, Any] | str) -> Iterable[tuple[str, Any]]:
    if isinstance(held, dict):
        return held.items()
    if len(held) > _LONGEST:
        return ()
    if held.lstrip().startswith("{"):
        try:
            read = json.loads(held)
        except (ValueError, RecursionError):
            return ()
        return read.items() if isinstance(read, dict) else ()
    return [(_plain(key), _plain(value)) for key, value in _HSTORE.findall(held)]


def _plain(quoted: str) -> str:
    return re.sub(r"\\(.)", r"\1", quoted, flags=re.DOTALL)
