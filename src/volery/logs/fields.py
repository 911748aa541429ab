"""Names the fields of a message type, with dots.

A field is a leaf of the type: a number, a text, an array of numbers, or a list of anything else.
`pose.pose.position` names a message of numbers, whose fields become columns of one array; a stamp
such as `header.stamp` becomes nanoseconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

from volery.core.clock import NS_PER_S
from volery.core.errors import VoleryError
from volery.graph.codecs.cdr import is_number_array
from volery.graph.typestore import typestore

_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_DTYPES: dict[str, type[Any]] = {
    "bool": np.bool_,
    "byte": np.int8,
    "char": np.uint8,
    **{f"{s}int{b}": np.dtype(f"{s}int{b}").type for s in ("u", "") for b in (8, 16, 32, 64)},
    "float32": np.float32,
    "float64": np.float64,
}


@dataclass(frozen=True)
class Field:
    """A leaf of a message type."""

    name: str
    """Name with dots, such as `pose.pose.position.x`."""
    dtype: type[Any] | None
    """Type of a number in messages; None for texts, lists of messages and arrays."""
    is_array: bool
    """Whether it is an array of numbers."""
    length: int | None = None
    """Length of a fixed array."""
    is_byte: bool = False
    """Whether the numbers are of type `byte`: signed in ROS 1 (int8), unsigned in ROS 2 (octet)."""


Column = NDArray[Any]
"""Values of a field in n messages."""


@lru_cache(maxsize=256)
def fields_of(msgtype: str) -> tuple[Field, ...]:
    """Returns the fields of a known type, in the order of its definition."""
    return tuple(_fields(msgtype, ""))


def _fields(msgtype: str, prefix: str) -> Iterator[Field]:
    described: Any
    for field, described in typestore().fielddefs[msgtype][1]:
        name = prefix + normalize_fieldname(field)
        kind, detail = described
        if kind == Nodetype.NAME:
            yield from _fields(detail, f"{name}.")
        elif kind == Nodetype.BASE:
            base = detail[0]
            yield Field(name, _DTYPES.get(base), is_array=False, is_byte=base == "byte")
        else:
            fixed = kind == Nodetype.ARRAY
            numbers = is_number_array(described)
            length = detail[1] if fixed and numbers else None
            yield Field(name, None, numbers, length, numbers and detail[0][1][0] == "byte")


def messages_in(msgtype: str) -> dict[str, str]:
    """Returns the types of nested messages (not of lists) by their names with dots."""
    found: dict[str, str] = {}
    described: Any
    for field, described in typestore().fielddefs[msgtype][1]:
        kind, detail = described
        if kind == Nodetype.NAME:
            name = normalize_fieldname(field)
            found[name] = detail
            found |= {f"{name}.{inner}": t for inner, t in messages_in(detail).items()}
    return found


def parts_of(name: str, msgtype: str) -> tuple[str, ...]:
    """Returns the names of the fields that `name` stands for: itself, or those of a message.

    Raises `VoleryError`, with similar fields, for an unknown name and for a message that is not
    of numbers alone.
    """
    if any(field.name == name for field in fields_of(msgtype)):
        return (name,)
    inner = messages_in(msgtype).get(name)
    if inner is None:
        raise VoleryError(f"{msgtype} has no field '{name}'; {_similar(name, msgtype)}")
    fields = fields_of(inner)
    if any(field.dtype is None for field in fields):
        names = ", ".join(f"{name}.{field.name}" for field in fields)
        raise VoleryError(f"'{name}' of {msgtype} holds more than numbers; ask for one of {names}")
    return tuple(f"{name}.{field.name}" for field in fields)


def _similar(name: str, msgtype: str) -> str:
    """Returns a phrase with the fields whose names are similar, or with all."""
    from difflib import get_close_matches

    known = [field.name for field in fields_of(msgtype)]
    near = get_close_matches(name, [*known, *messages_in(msgtype)])
    return f"similar ones: {', '.join(near)}" if near else f"it has {', '.join(known)}"


def is_time(name: str, msgtype: str) -> bool:
    """Returns whether `name` is a stamp or a duration."""
    return messages_in(msgtype).get(name) in _TIMES


def nanoseconds(seconds: Column, rest: Column) -> NDArray[np.int64]:
    """Returns times (n,), ns, of the two fields of stamps."""
    return seconds.astype(np.int64) * NS_PER_S + rest.astype(np.int64)
