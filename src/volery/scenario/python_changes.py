"""Changes of a scenario in Python: keys, paths of keys, and short forms of common changes.

A path of keys, such as `world.wind.turbulence`, leads to a value in nested tables.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from operator import index
from typing import Any

from pydantic import BaseModel

from volery.core.errors import ScenarioError
from volery.core.near_names import near_miss
from volery.scenario.fleet_size import resized
from volery.scenario.merging import merged
from volery.scenario.sensor_sets import SENSOR_SETS, fit
from volery.scenario.uav_types import with_airframe

_Data = dict[str, Any]
_FIRST = re.compile(r"[^.\[\]]+")
"""First key of a path."""
_PART = re.compile(r"[^.\[\]]+|\[\d+\]")
_PATH = re.compile(r"[^.\[\]]+(\[\d+\])*(\.[^.\[\]]+(\[\d+\])*)*")
_KEY_OF_TYPE = re.compile(r"types\.([^.\[\]]+)\.")


def split_changes(
    changes: Mapping[str, Any], known: Collection[str], where: str
) -> tuple[_Data, _Data]:
    """Returns the short forms of changes, and the other changes.

    known: keys of a scenario. where: names the source in errors. Raises `ScenarioError` for a key
    that is neither known, nor the beginning of a path, nor a short form.
    """
    for key in changes:
        _check_key(key, known, where)
    short = {key: value for key, value in changes.items() if _is_short(key, value)}
    return short, {key: value for key, value in changes.items() if key not in short}


def with_keys(data: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> _Data:
    """Returns a scenario's plain data with other values of keys and paths of keys, not validated.

    where: names the source in errors. Raises `ScenarioError` for a path that does not exist.
    """
    names = {key: value for key, value in changes.items() if key.isidentifier()}
    result = merged(data, names)
    for path, value in changes.items():
        if path not in names:
            _check_type(path, result.get("types", {}), where)
            result = _with_key(result, path, value, where)
    plain: _Data = _plain(result)
    return plain


def with_short_forms(data: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> _Data:
    """Returns a valid scenario's plain data with changes in short forms, not validated.

    where: names the source in errors. Raises `ScenarioError` for a change that does not fit.
    """
    result = dict(data)
    for key, value in changes.items():
        result = _SHORT_FORMS[key](result, value, where)
    plain: _Data = _plain(result)
    return plain


def _check_key(key: Any, known: Collection[str], where: str) -> None:
    if not isinstance(key, str):
        raise ScenarioError(f"{where}: a key is a text such as 'world.wind' (found {key!r})")
    first = _FIRST.match(key)
    if first is None or first[0] in known or key in _SHORT_FORMS:
        return
    if first[0] in ("wind", "weather"):
        raise ScenarioError(f"{where}: unknown key '{key}'; write 'world.{key}'")
    names = sorted({*known, *_SHORT_FORMS})
    hint = near_miss(first[0], names)
    raise ScenarioError(f"{where}: unknown key '{key}'{hint} Allowed here: {', '.join(names)}")


def _check_type(path: str, types: Mapping[str, Any], where: str) -> None:
    """Raises `ScenarioError` for a key of a type that the scenario lacks: no UAV would have it."""
    found = _KEY_OF_TYPE.match(path)
    if found is not None and found[1] != "*" and found[1] not in types:
        hint = near_miss(found[1], types)
        known = ", ".join(sorted(types))
        raise ScenarioError(f"{where}: key '{path}': no type '{found[1]}'{hint} Types: {known}")


def _is_short(key: str, value: Any) -> bool:
    return key in _SHORT_FORMS and (key != "uavs" or not isinstance(value, list | tuple))


def _plain(value: Any) -> Any:
    """Returns models as tables, in tables and lists too."""
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_unset=True)
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _with_key(data: Mapping[str, Any], path: str, value: Any, where: str) -> dict[str, Any]:
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


def _with_uavs(data: _Data, uavs: Any, where: str) -> _Data:
    if isinstance(uavs, bool) or not hasattr(uavs, "__index__"):
        raise ScenarioError(
            f"{where}: key 'uavs': give a whole number or a list of groups (found {uavs!r})"
        )
    groups = resized(data["uavs"], index(uavs), name=data.get("name", ""), where=where)
    return {**data, "uavs": groups}


def _with_wind(data: _Data, wind: Any, where: str) -> _Data:
    if not isinstance(wind, Mapping | BaseModel):
        wind = {"velocity_m_s": wind}
    return _with_key(data, "world.wind", wind, where)


def _with_weather(data: _Data, weather: Any, where: str) -> _Data:
    return _with_key(data, "world.weather", weather, where)


def _with_airframe(data: _Data, airframe: str, _where: str) -> _Data:
    return _for_all_types(data, lambda kind: with_airframe(kind, airframe))


def _with_sensors(data: _Data, sensors: Any, where: str) -> _Data:
    chosen = _listed(_plain(sensors))
    strange = [sensor for sensor in chosen if not isinstance(sensor, str | Mapping)]
    if strange:
        raise ScenarioError(
            f"{where}: key 'sensors': give sets ({', '.join(SENSOR_SETS)}) or all sensors as "
            f"tables or models (found {strange[0]!r})"
        )
    names = [sensor for sensor in chosen if isinstance(sensor, str)]
    unknown = [name for name in names if name not in SENSOR_SETS]
    if unknown or 0 < len(names) < len(chosen):
        problem = f"no set '{unknown[0]}'" if unknown else "names of sets and sensors are mixed"
        raise ScenarioError(
            f"{where}: key 'sensors': {problem}; give sets ({', '.join(SENSOR_SETS)}) or all "
            "sensors as tables or models"
        )
    if names:
        return _for_all_types(
            data, lambda kind: {**kind, "sensors": fit(kind.get("sensors", ()), chosen)}
        )
    return _for_all_types(data, lambda kind: {**kind, "sensors": chosen})


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list) else [value]


def _for_all_types(data: _Data, change: Callable[[_Data], _Data]) -> _Data:
    return {**data, "types": {name: change(kind) for name, kind in data["types"].items()}}


_SHORT_FORMS: dict[str, Callable[[_Data, Any, str], _Data]] = {
    "uavs": _with_uavs,
    "wind": _with_wind,
    "weather": _with_weather,
    "airframe": _with_airframe,
    "sensors": _with_sensors,
}
