"""Converts what a node assigns to a field of numbers to the array that is published.

As in rclpy, a sequence holds numbers of the field's kind only: no text, no nested list, no fraction
or number out of range for integers. A value that numpy would cut or wrap silently is refused.
"""

from __future__ import annotations

import array
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import GraphError

_KINDS = {"f": "fiu", "i": "iu", "u": "iu", "b": "b"}
"""Kinds of numpy's numbers that a field of a kind accepts."""
_CLASSES: dict[str, tuple[type, ...]] = {
    "f": (float, int, np.floating, np.integer),
    "i": (int, np.integer),
    "u": (int, np.integer),
    "b": (bool, np.bool_),
}


MAX_FLOAT32 = 3.4028235677973362e38
"""Largest number that rounds to a float32; rclpy refuses larger ones, too."""


def with_sign(values: Any) -> Any:
    """Returns the values of a `byte[]`, which may be octets, as int8 where they are bytes."""
    if isinstance(values, array.array):
        values = np.array(values)
    if isinstance(values, bytes | bytearray | memoryview):
        values = np.frombuffer(bytes(values), np.uint8)
    is_octets = isinstance(values, np.ndarray) and values.dtype == np.uint8
    return values.view(np.int8) if is_octets else values


def numbers_of(where: str, dtype: np.dtype[Any], length: int, values: Any) -> NDArray[Any]:
    """Returns a read-only array; a read-only one of the field's type is returned itself.

    length: of a fixed array, which may have any shape; 0: any. Raises `GraphError` with `where` if
    the values do not fit.
    """
    is_plain = values.__class__ is np.ndarray and values.dtype == dtype and values.ndim == 1
    if is_plain and length in (0, values.size):  # the usual case
        return _own(values)
    found = _array_of(where, dtype, values)
    if length and found.size != length:
        raise GraphError(f"{where}: must have {length} numbers, not {found.size}")
    if length:
        found = found.reshape(length)
    if found.ndim != 1:
        shape = "a number" if found.ndim == 0 else f"an array of shape {found.shape}"
        raise GraphError(f"{where} must be a sequence of numbers, not {shape}")
    if found.dtype != dtype:
        _check_range(where, dtype, found)
        found = found.astype(dtype)
    elif isinstance(values, np.ndarray):
        return _own(found)
    found.setflags(write=False)
    return found


def _own(values: NDArray[Any]) -> NDArray[Any]:
    """Returns a read-only copy of an array into which the node may write, or the array."""
    if values.flags.writeable:
        values = values.copy()
        values.setflags(write=False)
    return values


def _array_of(where: str, dtype: np.dtype[Any], values: Any) -> NDArray[Any]:
    """Returns the values as an array of their own type, whose kind fits the field."""
    if isinstance(values, bytes | bytearray | memoryview):
        return np.frombuffer(bytes(values), np.uint8)
    if isinstance(values, array.array):
        values = np.array(values)
    if isinstance(values, np.ndarray):
        plain = values if type(values) is np.ndarray else values.view(np.ndarray)
        if plain.dtype.kind not in _KINDS[dtype.kind]:
            raise GraphError(f"{where} must be numbers of {dtype}, not of {plain.dtype}")
        return plain
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise GraphError(
            f"{where} must be a sequence of numbers, not {values!r:.80} ({type(values).__name__})"
        )
    return _array_of_list(where, dtype, list(values))


def _array_of_list(where: str, dtype: np.dtype[Any], values: list[Any]) -> NDArray[Any]:
    if values and isinstance(values[0], bytes):  # of `byte[]`
        return np.frombuffer(b"".join(values), np.uint8)
    classes = _CLASSES[dtype.kind]
    if not all(issubclass(kind, classes) for kind in set(map(type, values))):
        index, odd = next((k, v) for k, v in enumerate(values) if not isinstance(v, classes))
        raise GraphError(
            f"{where}[{index}] must be a number of {dtype}, not {odd!r:.80} ({type(odd).__name__})"
        )
    try:
        kind = {"f": np.float64, "b": np.bool_}.get(dtype.kind)
        return np.array(values, kind).reshape(len(values))
    except (ValueError, TypeError, OverflowError) as error:
        raise GraphError(f"{where}: {error}") from None


def _check_range(where: str, dtype: np.dtype[Any], values: NDArray[Any]) -> None:
    if dtype == np.float32 and values.dtype.kind == "f":
        odd = values[(np.abs(values) > MAX_FLOAT32) & (np.abs(values) < np.inf)]
        if len(odd):
            raise GraphError(f"{where} must be float32, at most {MAX_FLOAT32:.7g}, not {odd[0]}")
    if dtype.kind not in "iu" or not values.size:
        return
    limits = np.iinfo(dtype)
    minimum, maximum = values.min(), values.max()
    if minimum < limits.min or maximum > limits.max:
        odd = minimum if minimum < limits.min else maximum
        raise GraphError(f"{where} must be {dtype}, {limits.min} to {limits.max}, not {odd}")
