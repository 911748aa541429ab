"""Sequences of numbers that behave as in rclpy and are numpy arrays.

rclpy gives a node `float32[]` and the like as `array.array`: `a + b` joins, `3 * a` repeats,
`a == b` and `not a` are truths, there are `index` and `count`, and an element is a Python number.
Programs for numpy use the same field as an array. `NumberSequence` is both: what `array.array`
defines acts as there, everything else as in numpy. Results of numpy's functions are plain arrays.
"""

from __future__ import annotations

import array
import operator
from collections.abc import Callable, Iterator
from typing import Any, SupportsIndex

import numpy as np
from numpy.typing import NDArray

MAX_COPIED_BYTES = 64 * 1024
"""Largest array that `received` copies, so that a node may write into it as in rclpy."""

_GROWING = ("append", "extend", "fromlist", "frombytes", "insert", "pop", "remove")

Plain = NDArray[Any]


class NumberSequence(np.ndarray):
    """A field of numbers of a received message: 1-dimensional; see the module."""

    _is_field = True

    def __array_finalize__(self, source: Any) -> None:
        """Marks arrays that are derived from a field, such as a reshaped one, as plain."""
        if isinstance(source, NumberSequence):
            self._is_field = False

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Computes with plain arrays."""
        if "out" in options:
            options["out"] = tuple(map(_plain, options["out"]))
        return getattr(ufunc, method)(*map(_plain, inputs), **options)

    @property
    def typecode(self) -> str:
        """Type code, as of `array.array`."""
        return self.dtype.char

    def index(self, value: Any, start: int = 0, stop: int | None = None) -> int:
        """Returns the first index of a value. Raises `ValueError` if there is none."""
        begin = range(len(self))[start:stop].start
        indices = np.flatnonzero(_plain(self)[start:stop] == value)
        if not len(indices):
            raise ValueError(f"{value} is not in the sequence")
        return int(indices[0]) + begin

    def count(self, value: Any) -> int:
        """Returns how often a value occurs."""
        return int(np.count_nonzero(_plain(self) == value))

    def __bool__(self) -> bool:
        """Returns whether there are elements."""
        return bool(len(self)) if self._is_field else bool(_plain(self))

    def __iter__(self) -> Iterator[Any]:
        """Iterates over Python numbers."""
        return iter(self.tolist() if self._is_field else _plain(self))

    def __getitem__(self, which: Any) -> Any:
        """Returns a Python number, a copied part for a slice, or what numpy returns."""
        found = _plain(self)[which]
        if not self._is_field:
            return found
        if isinstance(which, SupportsIndex) and isinstance(found, np.generic):
            return found.item()
        return field_of(found.copy()) if isinstance(which, slice) else found

    def __setitem__(self, which: Any, value: Any) -> None:
        """Sets elements. Raises `ValueError` where subscribers share the array."""
        if not self.flags.writeable:
            raise ValueError(
                f"subscribers share large arrays of a message ({len(self)} elements), which are "
                "read-only: modify a copy, list(values) or numpy.array(values)"
            )
        super().__setitem__(which, value)

    def __add__(self, other: Any) -> Any:
        """Joins two sequences; adds anything else. Raises `TypeError` for a list, as rclpy does."""
        if self._joins(other):
            return field_of(np.concatenate([_plain(self), np.asarray(other)]))
        self._refuse_list(other)
        return _plain(self) + _plain(other)

    def __iadd__(self, other: Any) -> Any:  # an `array.array` grows in place
        """Joins two sequences; adds anything else in a new array."""
        return self + other

    def __radd__(self, other: Any) -> Any:
        """Joins an `array.array` and this; else as `__add__`."""
        if self._joins(other):
            return field_of(np.concatenate([np.asarray(other), _plain(self)]))
        self._refuse_list(other)
        return _plain(other) + _plain(self)

    def __mul__(self, other: Any) -> Any:
        """Repeats by an `int`; multiplies by anything else."""
        if self._is_field and type(other) is int:
            return field_of(np.tile(_plain(self), max(other, 0)))
        return _plain(self) * _plain(other)

    __rmul__ = __mul__

    def __eq__(self, other: Any) -> Any:
        """Compares sequences as a whole; anything else element by element."""
        return self._compared(other, operator.eq)

    def __ne__(self, other: Any) -> Any:
        """Compares two sequences as a whole; anything else element by element."""
        return self._compared(other, operator.ne)

    __hash__ = None

    def __copy__(self) -> NumberSequence:
        """Returns a writeable copy."""
        return field_of(_plain(self).copy())

    def __deepcopy__(self, _memo: Any) -> NumberSequence:
        """Returns a writeable copy."""
        return self.__copy__()

    def __getattr__(self, name: str) -> Any:
        """Raises `AttributeError`: the sequence cannot grow or shrink."""
        hint = ": its length is fixed; use list(values)" if name in _GROWING else ""
        raise AttributeError(f"a received sequence has no '{name}'{hint}")

    def __repr__(self) -> str:
        """Shows the sequence as `array.array` does."""
        return f"array('{self.typecode}', {_plain(self).tolist()})"

    __str__ = __repr__

    def _compared(self, other: Any, compare: Callable[[Any, Any], Any]) -> Any:
        if self._joins(other):
            return compare(self.tolist(), list(other))
        if self._is_field and isinstance(other, list | tuple):
            return compare is operator.ne  # an `array.array` equals no list
        return compare(_plain(self), _plain(other))

    def _refuse_list(self, other: Any) -> None:
        if self._is_field and isinstance(other, list | tuple):
            raise TypeError(
                f"a received sequence and a {type(other).__name__} neither join nor add: join with "
                "list(values) + [...], add with numpy.array(values) + [...]"
            )

    def _joins(self, other: Any) -> bool:
        """Returns whether `array.array` would treat both as sequences."""
        if isinstance(other, NumberSequence):
            return self._is_field and other._is_field
        return self._is_field and isinstance(other, array.array)


def field_of(values: Plain) -> NumberSequence:
    """Returns an array (N,) as a field, without a copy."""
    return values.view(NumberSequence)


def received(values: Any) -> Any:
    """Returns the numbers of a received message, as rclpy gives them: lists of truths, else fields.

    Up to `MAX_COPIED_BYTES` the array is a copy that the node may change, beyond read-only.
    """
    plain = np.asarray(values)
    if plain.dtype == np.bool_:
        return plain.tolist()
    if not plain.flags.writeable and plain.nbytes <= MAX_COPIED_BYTES:
        plain = plain.copy()
    return field_of(plain)


def _plain(value: Any) -> Any:
    return value.view(np.ndarray) if isinstance(value, NumberSequence) else value
