"""Gives message classes what those of rclpy have: equality, a text, and the names of their fields.

The dataclasses of `rosbags` compare tuples of their fields, which raises an exception for arrays,
and name neither their fields' types nor themselves as ROS does.
"""

from __future__ import annotations

import array
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from volery.graph.codecs.definition_budget import EMPTY_MEMBER
from volery.graph.number_sequence import NumberSequence
from volery.graph.octet import Octet

_IDL_NAMES = {
    "bool": "boolean",
    "byte": "octet",
    "char": "uint8",
    "float32": "float",
    "float64": "double",
}
"""Base types whose name in a ROS 2 class is another one than in its definition file."""
_SEQUENCES = (list, tuple, array.array, np.ndarray)


def add_methods(name: str, cls: Any, fielddefs: Any) -> None:
    """Gives the class of message `name` the methods; `fielddefs` are read when they are called."""

    def names() -> list[str]:
        return [field for field, _ in fielddefs[name][1] if field != EMPTY_MEMBER]

    def is_equal(self: Any, other: Any) -> Any:
        if other.__class__ is not self.__class__:
            return NotImplemented
        return all(_same(getattr(self, field), getattr(other, field)) for field in names())

    def text(self: Any) -> str:
        values = ", ".join(f"{field}={_text(getattr(self, field))}" for field in names())
        return f"{name.replace('/', '.')}({values})"

    def find(self: Any, attribute: str) -> Any:
        if attribute[:1] == "_" and attribute[1:] in cls.__dataclass_fields__:
            return getattr(self, attribute[1:])
        raise AttributeError(f"'{cls.__name__}' object has no attribute '{attribute}'")

    for constant, base, value in fielddefs[name][0]:
        if base == "byte":
            setattr(cls, constant, Octet(value))
    cls.__eq__, cls.__repr__ = is_equal, text
    cls.__getattr__ = find
    cls.__slots__ = _Slots(names)
    cls.__slotnames__ = []  # copies and pickles hold `__dict__` alone
    cls.get_fields_and_field_types = staticmethod(lambda: field_types(fielddefs[name][1]))
    cls.__name__ = name.rpartition("/")[2]


def field_types(fields: Any) -> dict[str, str]:
    """Returns the names and types of fields as the classes of ROS 2 do, `sequence<double>`."""
    return {name: _idl_name(kind) for name, kind in fields if name != EMPTY_MEMBER}


class _Slots:
    """`__slots__` of a class: `_x` of each field x, as in rclpy; an instance has both names."""

    def __init__(self, names: Any) -> None:
        self._names = names

    def __get__(self, _instance: Any, _owner: Any) -> list[str]:
        return [f"_{name}" for name in self._names()]


def _same(a: Any, b: Any) -> bool:
    """Returns whether two values of a field are equal, sequences element by element."""
    if not isinstance(a, _SEQUENCES) or not isinstance(b, _SEQUENCES):
        return bool(a == b)
    if len(a) != len(b):
        return False
    if isinstance(a, np.ndarray | array.array) or isinstance(b, np.ndarray | array.array):
        return np.array_equal(np.asarray(a), np.asarray(b))
    return all(map(_same, a, b))


def _text(value: Any) -> str:
    """Returns the text of a value; a sequence of numbers appears as a list."""
    is_numbers = isinstance(value, array.array | NumberSequence)
    return repr(value.tolist() if is_numbers else value)


def _idl_name(described: Any) -> str:
    """Returns a field's type in the spelling of ROS 2's classes."""
    kind, detail = described
    if kind == Nodetype.NAME:
        package, _, name = detail.split("/")
        return f"{package}/{name}"
    if kind == Nodetype.BASE:
        base, limit = detail
        return f"{_IDL_NAMES.get(base, base)}<{limit}>" if limit else _IDL_NAMES.get(base, base)
    inner, size = detail
    if kind == Nodetype.ARRAY:
        return f"{_idl_name(inner)}[{size}]"
    return f"sequence<{_idl_name(inner)}, {size}>" if size else f"sequence<{_idl_name(inner)}>"
