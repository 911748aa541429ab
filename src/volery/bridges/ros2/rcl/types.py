"""Classes of messages and services of the sourced ROS 2, compared with Volery's definitions."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.typestore import typestore

_WORDS = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float"}
_WORDS |= {"float64": "double"}
"""Names of base types in `rosidl_generator_py`; other names are equal."""
_NESTED_IN = "/msg/"
_FILLER = "structure_needs_at_least_one_member"
"""Encoded field of messages without fields; classes of ROS 2 do not list it."""


@cache
def message_class(msgtype: str) -> Any:
    """Returns the class of a message. Raises `GraphError` if ROS 2 has none, or other fields."""
    found = _found(msgtype)
    _compare(msgtype, found)
    return found


@cache
def service_class(srvtype: str) -> Any:
    """Returns the class of a service, with `Request` and `Response`.

    Raises `GraphError` likewise.
    """
    found = _found(srvtype)
    for part in ("Request", "Response"):
        _compare(f"{srvtype}_{part}", getattr(found, part))
    return found


def described(msgtype: str) -> dict[str, str]:
    """Returns fields and types in the form of `get_fields_and_field_types` of ROS 2's classes."""
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
    """Compares the fields, because bytes pass between the two without decoding."""
    ours, theirs = described(msgtype), dict(found.get_fields_and_field_types())
    if ours != theirs or list(ours) != list(theirs):
        raise GraphError(f"the sourced ROS 2 has another definition of '{msgtype}'")
    for _, (kind, detail) in typestore().fielddefs[msgtype][1]:
        nested = detail if kind == Nodetype.NAME else detail[0][1]
        if isinstance(nested, str) and "/" in nested:
            message_class(nested)
