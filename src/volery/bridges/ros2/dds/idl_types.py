"""Types of the graph for Cyclone DDS: structures whose samples stay bytes.

Peers and the C library compare and check the structure; `rosbags` encodes and decodes the bytes,
which is some twenty times faster than the package's own codec.
"""

from __future__ import annotations

import threading
from functools import cache
from typing import Any

from cyclonedds.idl import make_idl_struct, types
from rosbags.interfaces import Nodetype

from volery.bridges.ros2.names import dds_type
from volery.graph.typestore import typestore

_BASE: dict[str, Any] = {
    "bool": bool,
    "string": str,
    "wstring": str,
    "octet": types.byte,
    "byte": types.byte,
    "char": types.uint8,
    "float32": types.float32,
    "float64": types.float64,
    **{
        f"{sign}int{bits}": getattr(types, f"{sign}int{bits}")
        for sign in ("", "u")
        for bits in (8, 16, 32, 64)
    },
}
_REQUEST_HEADER = {"guid": types.uint64, "seq": types.int64}
"""Header of rmw_cyclonedds' requests and responses: the client, and the number of its request."""

_lock = threading.RLock()


def message_struct(msgtype: str) -> type[Any]:
    """Returns the structure of a message; its samples have their bytes in `cdr`."""
    with _lock:
        return _complete(_struct(msgtype, headed=False))


def request_struct(msgtype: str) -> type[Any]:
    """Returns the structure of a service's request or response with its header."""
    with _lock:
        return _complete(_struct(msgtype, headed=True))


def _complete(struct: type[Any]) -> type[Any]:
    """Creates the type's description now; the package creates it later, without a lock."""
    struct.__idl__.fill_type_data()
    return struct


@cache
def _struct(msgtype: str, *, headed: bool) -> type[Any]:
    fields = dict(_REQUEST_HEADER) if headed else {}
    fields |= {name: _type_of(kind) for name, kind in typestore().fielddefs[msgtype][1]}
    name = dds_type(msgtype).replace("::", ".")
    made: type[Any] = make_idl_struct(name.rpartition(".")[2], name, fields, dataclassify=False)
    made.deserialize = classmethod(_keep)
    made.deserialize_key = classmethod(_keep)
    return made


def _keep(cls: Any, data: bytes, *_: Any, **__: Any) -> Any:
    """Returns a sample that holds its encoded bytes."""
    sample = cls.__new__(cls)
    sample.cdr = data
    return sample


def _type_of(described: Any) -> Any:
    """Returns the type of a field from its `rosbags` description."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return _struct(detail, headed=False)
    if kind == Nodetype.BASE:
        base, limit = detail
        return types.bounded_str[limit] if base == "string" and limit else _BASE[base]
    element, size = _type_of(detail[0]), detail[1]
    if kind == Nodetype.ARRAY:
        return types.array[element, size]
    return types.sequence[element, size] if size else types.sequence[element]
