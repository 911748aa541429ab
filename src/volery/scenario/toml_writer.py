"""Writes plain data as TOML."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from volery.core.errors import ScenarioError

SCHEMA_FILE = "scenario.schema.json"
"""Name of the JSON schema to which scenario files refer, beside them; `volery schema` writes it."""
SCHEMA_DIRECTIVE = f"#:schema ./{SCHEMA_FILE}"
"""First line of a scenario file: editors complete and check the file by that schema."""
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_MAX_INLINE = 88
"""Characters of a line with a table in braces."""


def toml_text(data: Mapping[str, Any]) -> str:
    """Returns nested tables, lists, strings, numbers, booleans and dates as TOML.

    Raises `ScenarioError`, naming the key, for values that TOML does not have, such as None.
    """
    return "\n".join(_table(data, "", inside_list=False)).strip("\n") + "\n"


def toml_value(value: Any) -> str:
    """Returns a value in one line of TOML; raises `ScenarioError` as `toml_text`."""
    return _value(value, "value")


def _table(data: Mapping[str, Any], name: str, *, inside_list: bool) -> Iterator[str]:
    """Yields the lines of a table: first its values, then the tables below it."""
    below: list[tuple[str, Any]] = []
    for key, value in sorted(data.items(), key=_rank):
        full = f"{name}.{_key(key)}" if name else _key(key)
        if not _has_header(value):
            yield f"{_key(key)} = {_value(value, full)}"
            continue
        line = f"{_key(key)} = {_value(value, full)}" if inside_list and _is_leaf(value) else ""
        if line and len(line) <= _MAX_INLINE:
            yield line
        else:
            below.append((full, value))
    for full, value in below:
        if isinstance(value, Mapping):
            lines = list(_table(value, full, inside_list=inside_list))
            if not lines or lines[0]:  # it has values of its own, before the tables below it
                yield from ("", f"[{full}]")
            yield from lines
            continue
        for item in value:
            yield from ("", f"[[{full}]]")
            yield from _table(item, full, inside_list=True)


def _rank(entry: tuple[str, Any]) -> int:
    """Returns the rank of a key in its table: first what the table is."""
    key, value = entry
    return {"kind": 0, "name": 1}.get(key, 2) if isinstance(value, str) else 2


def _has_header(value: Any) -> bool:
    """Returns whether a value is a table, or a list of tables only."""
    if isinstance(value, Mapping):
        return True
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    return is_list and bool(value) and all(isinstance(item, Mapping) for item in value)


def _is_leaf(value: Any) -> bool:
    return isinstance(value, Mapping) and not any(_has_header(item) for item in value.values())


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _string(key, key)


def _value(value: Any, where: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value, where)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {_value(v, f'{where}.{k}')}" for k, v in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, Sequence):
        return f"[{', '.join(_value(v, f'{where}[{k}]') for k, v in enumerate(value))}]"
    raise ScenarioError(
        f"key '{where}': TOML has no {type(value).__name__}; use a number, a text, a list or a "
        "table, or leave the key out"
    )


def _string(text: str, where: str) -> str:
    if any("\ud800" <= letter <= "\udfff" for letter in text):
        raise ScenarioError(f"key '{where}': the text is not valid Unicode; TOML is UTF-8")
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
