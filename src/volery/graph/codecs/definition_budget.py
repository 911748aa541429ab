"""Bounds on what message definitions cost: code that is made of them, and messages full of zeros.

Coders are made of a definition with a line or more for each element of an array of messages, and a
message is made whole with all its fixed arrays. A few lines of text must not cost gigabytes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.codecs.definition_files import NUMBERS, Definition

EMPTY_MEMBER = "structure_needs_at_least_one_member"
"""The byte that a message without fields has in ROS 2, and only there."""
MAX_UNROLLED = 1 << 16
"""Elements in the fixed arrays of messages and strings of one type."""
MAX_ELEMENTS = 1 << 24
"""Numbers and strings in one message of a type, with all that it nests and empty sequences."""
MAX_DEPTH = 64
"""Of types within types."""

Lookup = Callable[[str], Any]
"""The fields of a known type by its name."""


def check_definitions(found: Mapping[str, Definition], known: Lookup) -> None:
    """Refuse definitions of messages that are too large or too deep.

    found: new types, none of which contains itself. Raises `GraphError`.
    """
    sizes: dict[str, tuple[int, int]] = {}

    def measure(name: str, depth: int) -> tuple[int, int]:
        """Elements and depth of a type."""
        if name in sizes:
            return sizes[name]
        if depth > MAX_DEPTH:
            raise GraphError(f"{name}: types are nested more than {MAX_DEPTH} deep")
        fields = found[name].fields if name in found else known(name)[1]
        elements, deepest = 1, 0
        for _, (kind, detail) in fields:
            count, inner = (detail[1], detail[0]) if kind == Nodetype.ARRAY else (1, (kind, detail))
            if inner[0] == Nodetype.SEQUENCE:
                count, inner = 0, inner[1][0]
            if inner[0] == Nodetype.NAME:
                part, below = measure(inner[1], depth + 1)
                deepest = max(deepest, below + 1)
                elements += count * part
            else:
                elements += count
        sizes[name] = elements, deepest
        if elements > MAX_ELEMENTS or deepest > MAX_DEPTH:
            raise GraphError(
                f"{name}: a message holds {elements} numbers and strings, nested {deepest} deep; "
                f"at most {MAX_ELEMENTS} and {MAX_DEPTH} are possible"
            )
        return sizes[name]

    for name, definition in found.items():
        _check_code(definition)
        measure(name, 0)


def check_foreign(found: Mapping[str, Definition], known: Lookup) -> None:
    """Refuse sequences of messages without content: some bytes would claim any number of them.

    Raises `GraphError`.
    """
    empty: dict[str, bool] = {}

    def is_empty(name: str) -> bool:
        if name not in empty:
            fields = found[name].fields if name in found else known(name)[1]
            empty[name] = all(
                described[0] in (Nodetype.NAME, Nodetype.ARRAY)
                and (inner := _element(described)) is not None
                and is_empty(inner)
                for field, described in fields
                if field != EMPTY_MEMBER
            )
        return empty[name]

    for definition in found.values():
        for field, described in definition.fields:
            inner = _element(described)
            if described[0] == Nodetype.SEQUENCE and inner is not None and is_empty(inner):
                raise GraphError(
                    f"{definition.name}: '{field}' is a sequence of messages without content"
                )


def _check_code(definition: Definition) -> None:
    unrolled = sum(
        detail[1]
        for _, (kind, detail) in definition.fields
        if kind == Nodetype.ARRAY
        and not (detail[0][0] == Nodetype.BASE and detail[0][1][0] in NUMBERS)
    )
    if unrolled > MAX_UNROLLED:
        raise GraphError(
            f"{definition.source}: {definition.name} has {unrolled} strings and messages in fixed "
            f"arrays; at most {MAX_UNROLLED} are possible"
        )


def _element(described: Any) -> str | None:
    """Message type of a field, or of its elements; None for numbers and strings."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return str(detail)
    return _element(detail[0]) if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else None
