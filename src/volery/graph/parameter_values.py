"""Converts parameter values to and from ROS 2 messages."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type

NOT_SET = 0
"""rcl_interfaces/msg/ParameterType.PARAMETER_NOT_SET."""
_FIELDS = (
    "",
    "bool_value",
    "integer_value",
    "double_value",
    "string_value",
    "byte_array_value",
    "bool_array_value",
    "integer_array_value",
    "double_array_value",
    "string_array_value",
)
"""Indexed by the numbers of rcl_interfaces/msg/ParameterType."""
_BOOL, _INTEGER, _DOUBLE, _STRING = 1, 2, 3, 4
_BYTES, _BOOLS, _INTEGERS, _DOUBLES, _STRINGS = 5, 6, 7, 8, 9
_LONG = 2**63
_DTYPES = {_BOOLS: np.bool_, _INTEGERS: np.int64, _DOUBLES: np.float64}


def type_of(value: Any) -> int:
    """Returns the number of a value's type; NOT_SET if ROS 2 has no type for the value."""
    if isinstance(value, list | tuple | np.ndarray):
        return _type_of_array(list(value))
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return _INTEGER if -_LONG <= value < _LONG else NOT_SET
    kinds = {
        bool | np.bool_: _BOOL,
        float | np.floating: _DOUBLE,
        str: _STRING,
        bytes: _BYTES,
    }
    return next((number for kind, number in kinds.items() if isinstance(value, kind)), NOT_SET)


def _type_of_array(values: list[Any]) -> int:
    kinds = {type_of(value) for value in values}
    if kinds == {_INTEGER, _DOUBLE}:
        return _DOUBLES
    arrays = {_BOOL: _BOOLS, _INTEGER: _INTEGERS, _DOUBLE: _DOUBLES, _STRING: _STRINGS}
    return arrays.get(kinds.pop(), NOT_SET) if len(kinds) == 1 else NOT_SET


def value_message(value: Any) -> Any:
    """Returns the `rcl_interfaces/msg/ParameterValue` of a value."""
    message = zero_message("rcl_interfaces/msg/ParameterValue")
    kind = message.type = type_of(value)
    if kind == _BYTES:
        value = np.frombuffer(value, np.uint8)
    elif kind in _DTYPES:
        value = np.array(list(value), _DTYPES[kind])
    elif kind == _STRINGS:
        value = list(value)
    if kind != NOT_SET:
        setattr(message, _FIELDS[kind], value)
    return message


def plain_of(message: Any) -> Any:
    """Returns the value in a message as plain data; None if it is not set."""
    if not NOT_SET < message.type < len(_FIELDS):
        return None
    value = getattr(message, _FIELDS[message.type])
    return value.tolist() if isinstance(value, np.ndarray) else value


def parameter_message(name: str, value: Any) -> Any:
    """Returns a `rcl_interfaces/msg/Parameter`."""
    return message_type("rcl_interfaces/msg/Parameter")(name, value_message(value))
