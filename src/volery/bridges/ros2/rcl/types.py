"""Classes of messages and services of the sourced ROS 2, compared with Volery's definitions."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.message_methods import field_types
from volery.graph.typestore import typestore


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
    return field_types(typestore().fielddefs[msgtype][1])


def _found(name: str) -> Any:
    package, kind, short = name.split("/")
    missing = f"the sourced ROS 2 has no type '{name}'"
    try:
        found = getattr(import_module(f"{package}.{kind}"), short)
    except (ImportError, AttributeError):
        raise GraphError(missing) from None
    found_part = getattr(found, "Request", found)
    if hasattr(found_part, "__msgtype__"):  # a stand-in of Volery
        raise GraphError(missing)
    if not hasattr(found_part, "get_fields_and_field_types"):
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
