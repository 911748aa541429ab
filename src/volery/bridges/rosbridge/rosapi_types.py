"""Describes message types in the form of rosapi's services."""

from __future__ import annotations

from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.codecs.ros1_names import ros1_name
from volery.graph.typestore import typestore

TypeDef = dict[str, Any]
"""Fields of rosapi_msgs/msg/TypeDef."""

_ROS1_TIMES = {"builtin_interfaces/msg/Time": "time", "builtin_interfaces/msg/Duration": "duration"}
_EXAMPLES = {"string": "", "bool": "False", "float32": "0.0", "float64": "0.0"}


def display_name(msgtype: str, *, ros1: bool) -> str:
    """Returns the name of a type in a generation's spelling."""
    return ros1_name(msgtype) if ros1 else msgtype


def type_definitions(msgtype: str, *, ros1: bool) -> list[TypeDef]:
    """Returns a type and all types that it nests, each once. Raises `GraphError` if it is unknown.

    Nested types are named `std_msgs/Header` in both generations, as in rosapi; the first one has
    the requested name.
    """
    if msgtype not in typestore().types:
        raise GraphError(f"message type '{msgtype}' is not known")
    found: dict[str, TypeDef] = {}
    _collect(msgtype, found, ros1)
    return list(found.values())


def full_text(msgtype: str, *, ros1: bool) -> str:
    """Returns the definition with those of all nested types, as in bags."""
    if ros1:
        return ros1_codec().definition_text(msgtype)
    return str(typestore().generate_msgdef(msgtype, ros_version=2)[0])


def _collect(msgtype: str, found: dict[str, TypeDef], ros1: bool) -> None:
    if msgtype in found:
        return
    if ros1 and msgtype in _ROS1_TIMES:
        found[msgtype] = _typedef(
            _ROS1_TIMES[msgtype], [("secs", "int32", -1, "0"), ("nsecs", "int32", -1, "0")], []
        )
        return
    constants, fields = typestore().fielddefs[msgtype]
    rows, nested = [], []
    for name, described in fields:
        if name == EMPTY_MEMBER:
            continue
        inner, length = _element(described)
        if "/" in inner:
            nested.append(inner)
        example = "[]" if length >= 0 else "{}" if "/" in inner else _EXAMPLES.get(inner, "0")
        rows.append((name, _inner_name(inner, ros1), length, example))
    texts = [(name, str(value)) for name, _, value in constants]
    found[msgtype] = _typedef(_inner_name(msgtype, ros1), rows, texts)
    for inner in nested:
        _collect(inner, found, ros1)


def _inner_name(name: str, ros1: bool) -> str:
    if "/" not in name:
        return name
    if ros1:
        return _ROS1_TIMES.get(name) or ros1_name(name)
    return name.replace("/msg/", "/")


def _element(described: Any) -> tuple[str, int]:
    """Returns the type of a field or its elements, and their number: -1 no array, 0 any."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return str(detail), -1
    if kind == Nodetype.BASE:
        return str(detail[0]), -1
    inner, _ = _element(detail[0])
    return inner, int(detail[1]) if kind == Nodetype.ARRAY else 0


def _typedef(
    name: str, rows: list[tuple[str, str, int, str]], constants: list[tuple[str, str]]
) -> TypeDef:
    return {
        "type": name,
        "fieldnames": [row[0] for row in rows],
        "fieldtypes": [row[1] for row in rows],
        "fieldarraylen": [row[2] for row in rows],
        "examples": [row[3] for row in rows],
        "constnames": [constant[0] for constant in constants],
        "constvalues": [constant[1] for constant in constants],
    }
