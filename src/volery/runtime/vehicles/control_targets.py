"""Determines which UAVs a graph name, or the arguments of a request, concern.

It finds at least every UAV that the graph would resolve a spelling to, for topics, services,
actions and parameters; doubtful cases count as matches. If a name moves a UAV that it does not
contain, its receiver declares it: `graph.moved_uavs`.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Iterator, Mapping
from typing import Any

from volery.core.errors import CommandError

_SEPARATORS = re.compile(r"[/:#~.\s]+")
_MAX_DEPTH = 16
"""Max nesting depth of arguments; no message is nested so deeply."""


def parts_of(name: str) -> frozenset[str]:
    """Returns all parts of a topic, service, action, node or parameter name, in any spelling.

    `/uav1/odom`, `uav1/gap_following:height_m`, `//uav1/land#3`, `/uav2/../uav1` concern `uav1`.
    """
    return frozenset(
        part for text in {name, unicodedata.normalize("NFKC", name)} for part in _split(text)
    )


def names_in(value: Any, depth: int = 0) -> Iterator[str]:
    """Yields the name parts in all strings of a request's arguments, including JSON in strings.

    Raises `CommandError` if the arguments are nested too deeply to be checked.
    """
    if depth > _MAX_DEPTH:
        raise CommandError("the arguments are nested too deeply")
    if isinstance(value, bytes | bytearray):
        value = bytes(value).decode("utf-8", "replace")
    if isinstance(value, str):
        yield from parts_of(value)
        yield from _in_json(value, depth)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from names_in(key, depth + 1)
            yield from names_in(inner, depth + 1)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from names_in(inner, depth + 1)


def _in_json(text: str, depth: int) -> Iterator[str]:
    if not text.lstrip("\ufeff \t\r\n").startswith(("{", "[", '"')):
        return
    try:
        plain = json.loads(text)
    except ValueError:
        return
    except RecursionError:
        raise CommandError("the arguments are nested too deeply") from None
    yield from names_in(plain, depth + 1)


def _split(text: str) -> Iterator[str]:
    return (part for part in _SEPARATORS.split(text) if part)
