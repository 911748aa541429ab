"""Creates messages with each field zero, empty or at its definition file's default."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.typestore import typestore

DTYPES: dict[str, np.dtype[Any]] = {
    "bool": np.dtype(np.bool_),
    "byte": np.dtype(np.int8),
    "char": np.dtype(np.uint8),
    "float32": np.dtype(np.float32),
    "float64": np.dtype(np.float64),
    **{
        f"{sign}int{bits}": np.dtype(f"{sign}int{bits}")
        for sign in ("", "u")
        for bits in (8, 16, 32, 64)
    },
}
"""numpy dtype of each number type, as decoders return it."""

Maker = Callable[[], Any]


def zero_message(msgtype: str) -> Any:
    """Returns a new message of zeros, empty strings and arrays; fixed arrays have their length.

    Arrays are read-only: replace them, do not write into them. Raises `GraphError` if the type is
    unknown.
    """
    return message_maker(msgtype)()


@cache
def message_maker(msgtype: str) -> Maker:
    """Returns a function that creates zero messages of a type."""
    store = typestore()
    if msgtype not in store.types:
        raise GraphError(f"unknown message type '{msgtype}'")
    cls: Any = store.types[msgtype]
    makers = [
        value_maker(described, store.default_of(msgtype, name))
        for name, described in store.fielddefs[msgtype][1]
        if name != EMPTY_MEMBER
    ]
    return lambda: cls(*[make() for make in makers])


def value_maker(described: Any, default: Any = None) -> Maker:
    """Returns a function that creates a field's zero or default."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return message_maker(detail)
    if kind == Nodetype.BASE:
        base = detail[0]
        zero: Any = "" if base == "string" else DTYPES[base].type(0).item()
        value = zero if default is None else default
        return lambda: value
    (inner, inner_detail), size = detail
    length = size if kind == Nodetype.ARRAY else 0
    if inner == Nodetype.NAME:
        make = message_maker(inner_detail)
        return lambda: [make() for _ in range(length)]
    if inner_detail[0] == "string":
        strings = [""] * length if default is None else default
        return lambda: list(strings)
    dtype = DTYPES[inner_detail[0]]
    array = np.zeros(length, dtype) if default is None else np.array(default, dtype)
    array.setflags(write=False)
    return lambda: array
