"""Changes values of nested tables by paths of keys, such as `world.wind.turbulence`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from volery.core.errors import ScenarioError
from volery.scenario.merging import merged

_PART = re.compile(r"[^.\[\]]+|\[\d+\]")
_PATH = re.compile(r"[^.\[\]]+(\[\d+\])*(\.[^.\[\]]+(\[\d+\])*)*")


def with_key(data: Mapping[str, Any], path: str, value: Any, where: str) -> dict[str, Any]:
    """Returns `data` with another value at a path of keys.

    `uavs[0].count` names an entry of a list, `types.*.airframe` the key of all tables. Tables on
    the way that do not exist are created. A table as `value` merges into the old one, as in
    `merged`. where: names the source in errors. Raises `ScenarioError` for a path that does not
    exist.
    """
    if not _PATH.fullmatch(path):
        raise ScenarioError(
            f"{where}: '{path}' is no path of keys; write 'world.wind.turbulence' or "
            "'uavs[0].count'"
        )
    result: dict[str, Any] = _changed(data, _PART.findall(path), value, f"{where}: key '{path}'")
    return result


def _changed(node: Any, parts: Sequence[str], value: Any, where: str) -> Any:
    if isinstance(node, BaseModel):
        node = node.model_dump(exclude_unset=True)
    if not parts:
        is_merged = isinstance(node, Mapping) and isinstance(value, Mapping)
        return merged({"": node}, {"": value})[""] if is_merged else value
    part, rest = parts[0], parts[1:]
    if part.startswith("["):
        return _with_entry(node, int(part[1:-1]), rest, value, where)
    node = {} if node is None else node
    if not isinstance(node, Mapping):
        raise ScenarioError(f"{where}: '{part}' is not inside a table; name an entry as [0]")
    if part == "*":
        return {key: _changed(inner, rest, value, where) for key, inner in node.items()}
    return {**node, part: _changed(node.get(part), rest, value, where)}


def _with_entry(node: Any, index: int, rest: Sequence[str], value: Any, where: str) -> list[Any]:
    entries = list(node) if isinstance(node, list | tuple) else []
    if index >= len(entries):
        raise ScenarioError(f"{where}: there is no entry [{index}]; the list has {len(entries)}")
    entries[index] = _changed(entries[index], rest, value, where)
    return entries
