"""Converts definitions in IDL, as rosidl generates and MCAP files hold them, to `.msg` texts.

A schema holds the type and those that it nests: `IDL: package/msg/Name` before each, lines of `=`
between them.
"""

from __future__ import annotations

import re
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_idl

from volery.core.errors import GraphError

_PART = re.compile(r"^(?:=+\s*$|IDL:[^\n]*$)", re.MULTILINE)
_INCLUDE = re.compile(r"^[ \t]*#[^\n]*$", re.MULTILINE)
"""Lines for the preprocessor, which the parser does not know; all types are in the schema."""
_LONGEST = 60_000
"""Limit of a schema, characters."""
_MAX_NOTES = 2000
"""Limit of annotations, such as `@unit`: the parser's time grows with their number squared."""
_DEEPEST = 50
"""Limit of nested brackets; the parser calls itself for each."""


def msg_texts(definition: str) -> dict[str, str]:
    """Returns the `.msg` text of each structure by name, `package/msg/Name`, without constants.

    Raises `GraphError` if a definition is invalid, or has parts that ROS messages lack.
    """
    if len(definition) > _LONGEST or definition.count("@") > _MAX_NOTES:
        raise GraphError(
            f"a definition in IDL has more than {_LONGEST} characters or {_MAX_NOTES} annotations"
        )
    texts: dict[str, str] = {}
    for part in _PART.split(definition):
        if not part.strip():
            continue
        _check_depth(part)
        try:
            found = get_types_from_idl(_INCLUDE.sub("", part))
        except Exception as error:  # the parser's errors on any text
            reason = " ".join(str(error).split())[:250]
            raise GraphError(f"a definition in IDL is not readable: {reason}") from None
        for name, (_, fields) in found.items():
            texts[name] = "".join(f"{_type(kind)} {field}\n" for field, kind in fields)
    return texts


def _check_depth(text: str) -> None:
    depth = 0
    for character in text:
        depth += (character in "{(<[") - (character in "})>]")
        if depth > _DEEPEST:
            raise GraphError(f"a definition in IDL nests more than {_DEEPEST} brackets")


def _type(described: Any) -> str:
    """Returns a field's type as in `.msg` files."""
    kind, detail = described
    if kind == Nodetype.BASE:
        name, limit = detail
        return f"{name}{f'<={limit}' if limit else ''}"
    if kind == Nodetype.NAME:
        return str(detail).replace("/msg/", "/")
    inner, size = detail
    if kind == Nodetype.ARRAY:
        return f"{_type(inner)}[{size}]"
    return f"{_type(inner)}[{f'<={size}' if size else ''}]"
