"""Copies messages at the moment of their publication.

A node may modify a message after publishing it, as with rclpy, which serializes at once. So a
published message is a copy: nested messages and lists are new, writeable arrays are copied and
read-only, read-only arrays are shared. Number sequences given as lists, tuples, bytes or
`array.array` become numpy arrays of the field's type. A value of another type than its field's
raises an error that names the field, as rclpy's assertions do.

A node written for rclpy receives copies too (`receive_message`): with sequences as in rclpy, and it
may modify them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence, Set
from dataclasses import fields
from enum import Enum
from functools import cache, partial
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

from volery.core.errors import GraphError
from volery.graph.codecs.zero import DTYPES
from volery.graph.lazy_list import LazyList
from volery.graph.message_defaults import is_plain_name
from volery.graph.message_numbers import MAX_FLOAT32, numbers_of, with_sign
from volery.graph.number_sequence import received
from volery.graph.octet import Octet
from volery.graph.typestore import typestore

Copy = Callable[[Any], Any]


def copy_message(message: Any) -> Any:
    """Returns a copy of a message for subscribers. Raises `GraphError` if numbers do not fit."""
    return message_copier(message.__msgtype__)(message)


@cache
def message_copier(msgtype: str) -> Copy:
    """Returns the function that copies messages of a type for subscribers."""
    return _copier(msgtype, _CHECKED)


def receive_message(message: Any) -> Any:
    """Returns a copy of a received message with the sequences of rclpy, for one subscriber."""
    return _copier(message.__msgtype__, _RECEIVED)(message)


@cache
def message_checker(msgtype: str) -> Callable[[Any], None]:
    """Returns the function that checks messages of a type, without a copy; raises `GraphError`."""
    return _copier(msgtype, _LOOKED_AT)


class _Purpose(Enum):
    """Why a message is copied."""

    CHECKED = "to be published"
    RECEIVED = "for one node"
    LOOKED_AT = "not at all: its values are checked"


_CHECKED, _RECEIVED, _LOOKED_AT = _Purpose
_OTHER_TYPE, _NO_FIELD = _OF_MESSAGES = ("must be a message of type", "has no field")
"""What errors say about a message as a whole, after its type or path."""
_USUAL = {
    "float32": f"float and -{MAX_FLOAT32} <= v <= {MAX_FLOAT32}",
    "float64": "float",
    "string": "str and v.isascii()",  # other text may have half a surrogate pair
    "bool": "bool",
}
"""Class of the usual values `v` of a base type, with a condition; they fit."""


_MADE_FOR_NODES: dict[str, Copy] = {"byte": Octet}
"""What makes the values of base types that nodes receive as another class."""


@cache
def _copier(msgtype: str, purpose: _Purpose) -> Copy:
    store = typestore()
    cls: Any = store.types[msgtype]
    # a field with the name of a keyword, `from`, is an attribute `from_`
    described = {normalize_fieldname(name): kind for name, kind in store.fielddefs[msgtype][1]}
    if not all(is_plain_name(name) for name in described):
        raise GraphError(f"{msgtype}: a field's name is not a Python identifier")
    scope: dict[str, Any] = {"_cls": cls, "_check": partial(_check_class, msgtype, cls)}
    values = []
    for name in (field.name for field in fields(cls) if field.name in described):
        copier = _field_copier(f"{msgtype}: {name}", described[name], purpose)
        if copier is None:
            values.append(f"message.{name}")
            continue
        scope[f"_copy_{name}"] = copier
        kind, details = described[name]
        usual = _USUAL.get(str(details[0])) if kind == Nodetype.BASE else None
        values.append(
            f"_copy_{name}(message.{name})"
            if usual is None
            else f"(v if (v := message.{name}).__class__ is {usual} else _copy_{name}(v))"
        )
    num_fields = len(described)
    is_odd = f"message.__class__ is not _cls or len(message.__dict__) > {num_fields}"
    check = "" if purpose is _RECEIVED else f"    if {is_odd}: _check(message)\n"
    listed = ", ".join(values)
    made = f"[{listed}]" if purpose is _LOOKED_AT else f"_cls({listed})"
    exec(f"def copy(message):\n{check}    return {made}", scope)  # field names only
    copy: Copy = scope["copy"]
    return copy


def _check_class(msgtype: str, cls: Any, message: Any) -> None:
    """Raises `GraphError` for an object of another class, or with a field that does not exist."""
    if isinstance(message, type) or getattr(message, "__msgtype__", None) != msgtype:
        found = message.__name__ if isinstance(message, type) else type(message).__name__
        what = f"the class {found}" if isinstance(message, type) else f"{message!r:.80} ({found})"
        raise GraphError(f"{msgtype}: {_OTHER_TYPE} {msgtype}, not {what}")
    known = cls.__dataclass_fields__
    unknown = next((name for name in vars(message) if name not in known), None)
    if unknown is not None:
        names = ", ".join(name for name in known if not name.startswith("_"))
        raise GraphError(f"{msgtype}: {_NO_FIELD} '{unknown}'; fields: {names}")


def _field_copier(where: str, described: Any, purpose: _Purpose) -> Copy | None:
    """Returns the function that copies a field; None where its value is immutable."""
    kind, detail = described
    if kind == Nodetype.BASE:
        base = detail[0]
        return _MADE_FOR_NODES.get(base) if purpose is _RECEIVED else _base_checker(where, base)
    if kind == Nodetype.NAME:
        return partial(_nested, where, detail, _copier(detail, purpose))
    (inner, inner_detail), size = detail
    length = size if kind == Nodetype.ARRAY else 0
    if inner == Nodetype.NAME:
        return _parts_copier(where, inner_detail, purpose)
    if inner_detail[0] == "string":
        check = None if purpose is _RECEIVED else _base_checker(where, "string")
        return partial(_copy_list, where, "", check, False)
    base = inner_detail[0]
    if purpose is _RECEIVED:
        return received if kind == Nodetype.SEQUENCE else _writeable
    copy = _look_at_numbers if purpose is _LOOKED_AT else numbers_of
    numbers = partial(copy, where, DTYPES[base], length)
    return (lambda values: numbers(with_sign(values))) if base == "byte" else numbers


def _parts_copier(where: str, msgtype: str, purpose: _Purpose) -> Copy:
    """Returns the function that copies a list of messages."""
    if purpose is _RECEIVED:
        return partial(_receive_list, _copier(msgtype, purpose))
    is_shared = purpose is _CHECKED and not _holds(msgtype)
    looked_at = _copier(msgtype, _LOOKED_AT if is_shared else purpose)
    return partial(_copy_list, where, msgtype, looked_at, is_shared)


def _base_checker(where: str, base: str) -> Copy:
    """Returns the function that returns a value of a base type, or raises `GraphError`."""
    if base in ("string", "wstring"):
        return partial(_check_text, where, base)
    if base == "bool":
        return partial(_check_value, where, base, (bool, np.bool_), None)
    if base in ("float32", "float64"):
        is_number = partial(_check_value, where, base, (float, int, np.floating, np.integer), None)
        return is_number if base == "float64" else partial(_check_float32, where, is_number)
    if base == "byte":
        return partial(_check_byte, where)
    limits = np.iinfo(DTYPES[base])
    return partial(_check_value, where, base, (int, np.integer), (int(limits.min), int(limits.max)))


def _check_value(
    where: str, base: str, classes: Any, limits: tuple[int, int] | None, value: Any
) -> Any:
    if not isinstance(value, classes):
        raise GraphError(
            f"{where} must be {_kind(base)}, not {value!r:.80} ({type(value).__name__})"
        )
    if limits is not None and not limits[0] <= value <= limits[1]:
        raise GraphError(f"{where} must be {_kind(base)}, {limits[0]} to {limits[1]}, not {value}")
    return value


def _check_float32(where: str, is_number: Copy, value: Any) -> Any:
    is_number(value)
    if MAX_FLOAT32 < abs(value) < math.inf:
        raise GraphError(f"{where} must be a float32, at most {MAX_FLOAT32:.7g}, not {value}")
    return value


def _kind(base: str) -> str:
    return f"{'an' if base[0] == 'i' else 'a'} {base}"


def _check_text(where: str, base: str, value: Any) -> Any:
    _check_value(where, base, str, None, value)
    try:
        value.encode()
    except UnicodeEncodeError:
        raise GraphError(f"{where} contains half a surrogate pair, not UTF-8") from None
    return value


def _check_byte(where: str, value: Any) -> Any:
    """Returns the number of a byte, which rclpy has as `bytes` of length 1."""
    if isinstance(value, bytes) and len(value) == 1:
        value = value[0]
    number = _check_value(where, "byte", (int, np.integer), (-128, 255), value)
    return int(number) - 256 if number > 127 else int(number)


def _nested(where: str, msgtype: str, copy: Copy, value: Any) -> Any:
    try:
        return copy(value)
    except GraphError as error:
        raise _error_inside(where, msgtype, error) from None


def _error_inside(where: str, msgtype: str, error: GraphError) -> GraphError:
    """Returns the error of a nested message, with the path of its field: `pose.position.x`."""
    reason = str(error).removeprefix(f"{msgtype}: ")
    return GraphError(
        f"{where} {reason}" if reason.startswith(_OF_MESSAGES) else f"{where}.{reason}"
    )


def _writeable(values: Any) -> Any:
    """Returns a fixed array, which is one of numpy in rclpy as well."""
    return np.array(values)


@cache
def _holds(msgtype: str) -> bool:
    """Returns whether a message holds lists or arrays at any level."""
    kinds = [described for _, described in typestore().fielddefs[msgtype][1]]
    return any(
        kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) or (kind == Nodetype.NAME and _holds(detail))
        for kind, detail in kinds
    )


def _copy_list(where: str, msgtype: str, copy: Copy | None, is_shared: bool, values: Any) -> Any:
    """Returns a list of copied parts; `is_shared`: of the parts themselves, after `copy`.

    msgtype: of the parts; empty for texts.
    """
    if isinstance(values, LazyList):  # built when read, and so immutable
        return values
    if not isinstance(values, Sequence | Set) or isinstance(values, str | bytes):
        raise GraphError(f"{where} must be a list, not {values!r:.80} ({type(values).__name__})")
    if copy is None:
        return list(values)
    copied: list[Any] = []
    try:
        copied.extend(map(copy, values))
    except GraphError as error:
        item = f"{where}[{len(copied)}]"
        if msgtype:
            raise _error_inside(item, msgtype, error) from None
        raise GraphError(f"{item}{str(error).removeprefix(where)}") from None
    return list(values) if is_shared else copied


def _receive_list(copy: Copy, values: Any) -> list[Any]:
    """Returns a list for one node, which may modify it and its parts, also of a `LazyList`."""
    return list(map(copy, values))


def _look_at_numbers(where: str, dtype: np.dtype[Any], length: int, values: Any) -> None:
    """Raises `GraphError` if `numbers_of` would; copies no array."""
    fits = isinstance(values, np.ndarray) and values.dtype == dtype and values.ndim == 1
    if not fits or length not in (0, values.size):
        numbers_of(where, dtype, length, values)
