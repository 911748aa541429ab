"""Copies messages at the moment of their publication.

A node may modify a message after publishing it, as with rclpy, which serializes at once. So a
published message is a copy: nested messages and lists are new, writeable arrays are copied and
read-only, read-only arrays are shared. Number sequences given as lists, tuples, bytes or
`array.array` become numpy arrays of the field's type.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.codecs.zero import DTYPES
from volery.graph.message_defaults import is_plain_name
from volery.graph.typestore import typestore

Copy = Callable[[Any], Any]


def copy_message(message: Any) -> Any:
    """Returns a copy of a message for subscribers. Raises `GraphError` if numbers do not fit."""
    return message_copier(message.__msgtype__)(message)


@cache
def message_copier(msgtype: str) -> Copy:
    """Returns the function that copies messages of a type."""
    store = typestore()
    cls: Any = store.types[msgtype]
    described = dict(store.fielddefs[msgtype][1])
    if not all(is_plain_name(name) for name in described):
        raise GraphError(f"{msgtype}: a field's name is not a Python identifier")
    scope: dict[str, Any] = {"_cls": cls}
    values = []
    for name in (field.name for field in fields(cls) if field.name in described):
        copier = _field_copier(f"{msgtype}: {name}", described[name])
        if copier is None:
            values.append(f"message.{name}")
        else:
            scope[f"_copy_{name}"] = copier
            values.append(f"_copy_{name}(message.{name})")
    text = f"def copy(message):\n    return _cls({', '.join(values)})"
    exec(text, scope)  # field names only
    copy: Copy = scope["copy"]
    return copy


def _field_copier(where: str, described: Any) -> Copy | None:
    """Returns the function that copies a field; None where its value is immutable."""
    kind, detail = described
    if kind == Nodetype.BASE:
        return None
    if kind == Nodetype.NAME:
        return message_copier(detail)
    (inner, inner_detail), size = detail
    if inner == Nodetype.NAME:
        return partial(_copy_list, message_copier(inner_detail) if _holds(inner_detail) else None)
    if inner_detail[0] == "string":
        return partial(_copy_list, None)
    return partial(_numbers, where, DTYPES[inner_detail[0]], size if kind == Nodetype.ARRAY else 0)


@cache
def _holds(msgtype: str) -> bool:
    """Returns whether a message holds lists or arrays at any level."""
    kinds = [described for _, described in typestore().fielddefs[msgtype][1]]
    return any(
        kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) or (kind == Nodetype.NAME and _holds(detail))
        for kind, detail in kinds
    )


def _copy_list(copy: Copy | None, values: Any) -> Any:
    if not isinstance(values, list | tuple):  # built when read, and so immutable
        return values
    return list(values) if copy is None else [copy(value) for value in values]


def _numbers(where: str, dtype: np.dtype[Any], length: int, values: Any) -> NDArray[Any]:
    if isinstance(values, np.ndarray) and values.dtype == dtype:
        if values.flags.writeable:
            values = values.copy()
    elif isinstance(values, bytes | bytearray | memoryview):
        values = np.frombuffer(bytes(values), np.uint8).astype(dtype)
    else:
        try:
            values = np.array(values, dtype)
        except (ValueError, TypeError, OverflowError) as error:
            raise GraphError(f"{where}: {error}") from None
    if length and values.size != length:
        raise GraphError(f"{where}: must have {length} numbers, not {values.size}")
    values.setflags(write=False)
    array: NDArray[Any] = values
    return array
