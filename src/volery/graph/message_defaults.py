"""Lets message classes be constructed without arguments: `Twist()`, `Vector3(x=1.0)`.

The dataclasses of `rosbags` require every field. As in rclpy's generated classes, each argument is
optional here: a number defaults to 0, a text to empty, a nested message to a new one, a fixed array
to a new numpy array of zeros, a sequence of numbers to a new `array.array`, any other sequence to a
new list; a default in the definition file takes precedence. An unknown name raises `TypeError`. A
message with all fields given is constructed as fast as before.
"""

from __future__ import annotations

import array
import keyword
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

from volery.graph.octet import Octet

Maker = Callable[[], Any]
DefaultOf = Callable[[str, str], Any]
"""Default of a type's field in its definition file; None: zero."""

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
"""Type codes of `array.array`; sequences of other base types default to lists."""


def make_arguments_optional(
    name: str, cls: type[Any], types: Mapping[str, type[Any]], fielddefs: Any, default_of: DefaultOf
) -> None:
    """Gives the class of message `name` a constructor whose arguments are optional.

    The first message compiles the constructor, because most types are never used.
    """
    if not all(is_plain_name(field.name) for field in fields(cls)):
        return

    def first(self: Any, *values: Any, **named: Any) -> None:
        # a field with the name of a keyword, `from`, is an attribute `from_`
        described = {normalize_fieldname(f[0]): f for f in fielddefs[name][1]}
        cls.__init__ = _constructor(name, cls, described, types, default_of)
        cls.__init__(self, *values, **named)

    first.__qualname__ = f"{cls.__qualname__}.__init__"
    cls.__init__ = first


def is_plain_name(name: str) -> bool:
    """Returns whether a field's name may appear in generated code."""
    return name.isidentifier() and not keyword.iskeyword(name)


def _constructor(
    name: str,
    cls: type[Any],
    described: Mapping[str, tuple[str, Any]],
    types: Mapping[str, type[Any]],
    default_of: DefaultOf,
) -> Callable[..., None]:
    """Returns `__init__` of a class: immutable defaults shared, others made for each message.

    described: names in the definition and types, by the names of the attributes.
    """
    scope: dict[str, Any] = {"_not_given": _NOT_GIVEN}
    arguments, lines = [], []
    for own in (field.name for field in fields(cls)):
        if own not in described:  # a constant of the class; `dataclasses.replace` passes it
            arguments.append(f"{own}=None")
            continue
        field, kind = described[own]
        make, is_plain = _maker(kind, default_of(name, field), types)
        if is_plain:
            scope[f"_default_{own}"] = make()
            arguments.append(f"{own}=_default_{own}")
            lines.append(f"    self.{own} = {own}")
        else:
            scope[f"_make_{own}"] = make
            arguments.append(f"{own}=_not_given")
            lines.append(f"    self.{own} = _make_{own}() if {own} is _not_given else {own}")
    text = f"def __init__(self, {', '.join(arguments)}):\n" + "\n".join(lines or ["    pass"])
    exec(text, scope)  # field names only, as in dataclasses
    made: Callable[..., None] = scope["__init__"]
    made.__qualname__ = f"{cls.__name__}.__init__"
    return made


def _maker(described: Any, default: Any, types: Mapping[str, type[Any]]) -> tuple[Maker, bool]:
    """Returns a field's factory, and whether one value serves all messages."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return types[detail], False
    if kind == Nodetype.BASE:
        zero = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(detail[0], 0)
        given: Any = zero if default is None else default
        value = Octet(given) if detail[0] == "byte" else given
        return lambda: value, True
    return _sequence_maker(kind, detail, default, types), False


def _sequence_maker(
    kind: Nodetype, detail: Any, default: Any, types: Mapping[str, type[Any]]
) -> Maker:
    """Returns the factory of an array or sequence."""
    (inner, inner_detail), size = detail
    length = size if kind == Nodetype.ARRAY else 0
    if inner == Nodetype.NAME:
        return lambda: [types[inner_detail]() for _ in range(length)]
    base = inner_detail[0]
    if base == "string":
        texts = [""] * length if default is None else list(default)
        return lambda: list(texts)
    if base == "byte" and default is not None:  # octets in ROS 2, numbers with a sign in ROS 1
        default = [value - 256 if value > 127 else value for value in default]
    if kind == Nodetype.ARRAY:
        dtype = np.dtype({"byte": "int8", "char": "uint8"}.get(base, base))
        numbers = np.zeros(length, dtype) if default is None else np.array(default, dtype)
        return numbers.copy
    values = [] if default is None else list(default)
    code = _TYPECODES.get(base)
    if code is None:
        return lambda: list(values)
    return lambda: array.array(code, values)
