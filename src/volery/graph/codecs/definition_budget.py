"""Limits the cost of message definitions: generated code, and messages full of zeros.

Generated coders have a line or more for each element of an array of messages, and a message is
created with all its fixed arrays. A few lines of text must not cost gigabytes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.codecs.definition_files import NUMBERS, Definition

EMPTY_MEMBER = "structure_needs_at_least_one_member"
"""The byte of a message without fields, in ROS 2 only."""
MAX_UNROLLED = 1 << 16
"""Limit of elements in the fixed arrays of messages and strings of one type."""
MAX_ELEMENTS = 1 << 24
"""Limit of numbers and strings in one message of a type, nested messages included, with empty
sequences."""
MAX_DEPTH = 64
"""Limit of the nesting of types."""

Lookup = Callable[[str], Any]
"""Returns the fields of a known type by its name."""


def check_definitions(found: Mapping[str, Definition], known: Lookup) -> None:
    """Raises `GraphError` for definitions of messages that are too large or nested too deep.

    found: new types, none containing itself.
    """
    sizes: dict[str, tuple[int, int]] = {}

    def measure(name: str, depth: int) -> tuple[int, int]:
        """Returns the elements and depth of a type."""
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
                f"limits: {MAX_ELEMENTS} and {MAX_DEPTH}"
            )
        return sizes[name]

    for name, definition in found.items():
        _check_code(definition)
        measure(name, 0)


def check_foreign(found: Mapping[str, Definition], known: Lookup) -> None:
    """Raises `GraphError` for sequences of empty messages, which a few bytes could make endless."""
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
                raise GraphError(f"{definition.name}: '{field}' is a sequence of empty messages")


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
            f"arrays; limit: {MAX_UNROLLED}"
        )


def _element(described: Any) -> str | None:
    """Returns the message type of a field or its elements; None for numbers and strings."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return str(detail)
    return _element(detail[0]) if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else None
