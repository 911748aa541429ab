"""Lets message classes be made without arguments: `Twist()`, `Vector3(x=1.0)`.

The dataclasses of `rosbags` take every field. As in rclpy's generated classes, each argument may
stay away: a number is then 0, a text empty, a nested message new, a fixed array a new numpy array
of zeros, a sequence of numbers a new `array.array`, any other sequence a new list, and a default of
the definition file counts. An unknown name is a `TypeError`. A message that is given all its fields
is made as fast as before.
"""

from __future__ import annotations

import array
import keyword
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

Maker = Callable[[], Any]
DefaultOf = Callable[[str, str], Any]
"""Default of a type's field in its definition file; None where it starts at zero."""

_NOT_GIVEN: Any = object()
_TYPECODES = {
    "int8": "b",
    "uint8": "B",
    "char": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""Of `array.array`; sequences of other base types start as lists."""


def make_arguments_optional(
    name: str, cls: type[Any], types: Mapping[str, type[Any]], fielddefs: Any, default_of: DefaultOf
) -> None:
    """Give the class of message `name` a constructor whose arguments may stay away.

    It is made when the first message is: most types are never used.
    """
    if not all(is_plain_name(field.name) for field in fields(cls)):
        return

    def first(self: Any, *values: Any, **named: Any) -> None:
        described = dict(fielddefs[name][1])
        cls.__init__ = _constructor(name, cls, described, types, default_of)
        cls.__init__(self, *values, **named)

    first.__qualname__ = f"{cls.__qualname__}.__init__"
    cls.__init__ = first


def is_plain_name(name: str) -> bool:
    """Whether a field's name may stand in code that is made."""
    return name.isidentifier() and not keyword.iskeyword(name)


def _constructor(
    name: str,
    cls: type[Any],
    described: dict[str, Any],
    types: Mapping[str, type[Any]],
    default_of: DefaultOf,
) -> Callable[..., None]:
    """`__init__` of a class: plain values as defaults, all others made for each message."""
    scope: dict[str, Any] = {"_not_given": _NOT_GIVEN}
    arguments, lines = [], []
    for own in (field.name for field in fields(cls)):
        if own not in described:  # a constant, which the class has; `dataclasses.replace` gives it
            arguments.append(f"{own}=None")
            continue
        make, is_plain = _maker(described[own], default_of(name, own), types)
        if is_plain:
            scope[f"_default_{own}"] = make()
            arguments.append(f"{own}=_default_{own}")
            lines.append(f"    self.{own} = {own}")
        else:
            scope[f"_make_{own}"] = make
            arguments.append(f"{own}=_not_given")
            lines.append(f"    self.{own} = _make_{own}() if {own} is _not_given else {own}")
    text = f"def __init__(self, {', '.join(arguments)}):\n" + "\n".join(lines or ["    pass"])
    exec(text, scope)  # names of fields alone, as dataclasses do it
    made: Callable[..., None] = scope["__init__"]
    made.__qualname__ = f"{cls.__qualname__}.__init__"
    return made


def _maker(described: Any, default: Any, types: Mapping[str, type[Any]]) -> tuple[Maker, bool]:
    """What makes a field's value, and whether one value serves all messages."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return types[detail], False
    if kind == Nodetype.BASE:
        zero = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(detail[0], 0)
        value = zero if default is None else default
        return lambda: value, True
    return _sequence_maker(kind, detail, default, types), False


def _sequence_maker(
    kind: Nodetype, detail: Any, default: Any, types: Mapping[str, type[Any]]
) -> Maker:
    """What makes an array's or a sequence's value."""
    (inner, inner_detail), size = detail
    length = size if kind == Nodetype.ARRAY else 0
    if inner == Nodetype.NAME:
        return lambda: [types[inner_detail]() for _ in range(length)]
    base = inner_detail[0]
    if base == "string":
        texts = [""] * length if default is None else list(default)
        return lambda: list(texts)
    if kind == Nodetype.ARRAY:
        dtype = np.dtype({"byte": "int8", "char": "uint8"}.get(base, base))
        numbers = np.zeros(length, dtype) if default is None else np.array(default, dtype)
        return numbers.copy
    values = [] if default is None else list(default)
    code = _TYPECODES.get(base)
    if code is None:
        return lambda: list(values)
    return lambda: array.array(code, values)
