"""Classes of messages and services of the sourced ROS 2, and whether they mean what ours do."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.messages import typestore

_WORDS = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float"}
_WORDS |= {"float64": "double"}
"""What `rosidl_generator_py` calls base types; others are called the same."""
_NESTED_IN = "/msg/"
_FILLER = "structure_needs_at_least_one_member"
"""What messages without fields have on the wire; classes of ROS 2 do not tell of it."""


@cache
def message_class(msgtype: str) -> Any:
    """Class of a message. `GraphError` where ROS 2 has none, or one with other fields."""
    found = _found(msgtype)
    _compare(msgtype, found)
    return found


@cache
def service_class(srvtype: str) -> Any:
    """Class of a service, with `Request` and `Response`; `GraphError` as for messages."""
    found = _found(srvtype)
    for part in ("Request", "Response"):
        _compare(f"{srvtype}_{part}", getattr(found, part))
    return found


def described(msgtype: str) -> dict[str, str]:
    """Fields and their types, in the words of `get_fields_and_field_types` of ROS 2's classes."""
    fields = typestore().fielddefs[msgtype][1]
    return {name: _word(kind) for name, kind in fields if name != _FILLER}


def _word(described_type: Any) -> str:
    kind, detail = described_type
    if kind == Nodetype.NAME:
        return str(detail).replace(_NESTED_IN, "/")
    if kind == Nodetype.BASE:
        base, limit = detail
        word = _WORDS.get(base, base)
        return f"{word}<{limit}>" if limit else word
    element, size = _word(detail[0]), detail[1]
    if kind == Nodetype.ARRAY:
        return f"{element}[{size}]"
    return f"sequence<{element}, {size}>" if size else f"sequence<{element}>"


def _found(name: str) -> Any:
    package, kind, short = name.split("/")
    missing = f"the sourced ROS 2 has no type '{name}'"
    try:
        found = getattr(import_module(f"{package}.{kind}"), short)
    except (ImportError, AttributeError):
        raise GraphError(missing) from None
    if not hasattr(getattr(found, "Request", found), "get_fields_and_field_types"):
        raise GraphError(f"{missing}: the package '{package}' found is of ROS 1")
    return found


def _compare(msgtype: str, found: Any) -> None:
    """Bytes pass between the two unread, so that their fields must be the same."""
    ours, theirs = described(msgtype), dict(found.get_fields_and_field_types())
    if ours != theirs or list(ours) != list(theirs):
        raise GraphError(f"the sourced ROS 2 has another definition of '{msgtype}'")
    for _, (kind, detail) in typestore().fielddefs[msgtype][1]:
        nested = detail if kind == Nodetype.NAME else detail[0][1]
        if isinstance(nested, str) and "/" in nested:
            message_class(nested)
