"""Encodes CBOR for rosbridge: plain values, and arrays of numbers as typed arrays (RFC 8746).

Arrays are sent in little-endian order, as the tags 69 to 71, 77 to 79, 85 and 86; arrays of 8-bit
numbers are byte strings (unsigned) or tag 72 (signed). The decoder also accepts big-endian, half
and clamped types. Other tags are refused: they would let a client build regular expressions, cycles
and numbers of any size.
"""

from __future__ import annotations

import struct
from typing import Any

import cbor2
import numpy as np
from numpy.typing import NDArray

from volery.core.errors import BridgeError

MAX_DEPTH = 64
"""Largest depth of nesting; no ROS message comes near it."""

_MANY = 32
"""Number of message parts in a list from which on an attempt of cbor2 is worthwhile."""

_TAGS = {
    "u2": 69,
    "u4": 70,
    "u8": 71,
    "i1": 72,
    "i2": 77,
    "i4": 78,
    "i8": 79,
    "f4": 85,
    "f8": 86,
}
_DTYPES = {
    64: "u1",
    65: ">u2",
    66: ">u4",
    67: ">u8",
    68: "u1",
    69: "<u2",
    70: "<u4",
    71: "<u8",
    72: "i1",
    73: ">i2",
    74: ">i4",
    75: ">i8",
    77: "<i2",
    78: "<i4",
    79: "<i8",
    80: ">f2",
    81: ">f4",
    82: ">f8",
    84: "<f2",
    85: "<f4",
    86: "<f8",
}
_BYTE_STRING, _TEXT, _ARRAY, _MAP, _TAG = 2, 3, 4, 5, 6
_SELF_DESCRIBED = bytes.fromhex("d9d9f7")
"""Head of tag 55799 (RFC 8949, 3.4.6), which says that the bytes are CBOR, and nothing else."""


def encode_cbor(value: Any) -> bytes:
    """Returns CBOR of dicts, lists, text, bytes, numbers, None and 1-dimensional numpy arrays.

    This encoder copies large arrays once.

    Raises
    ------
    BridgeError
        The value contains another type.

    """
    parts: list[Any] = []
    _add(value, parts)
    return b"".join(parts)


def decode_cbor(data: bytes) -> Any:
    """Returns plain values of CBOR; typed arrays become read-only numpy arrays, little-endian.

    Raises
    ------
    BridgeError
        The bytes are not CBOR, nest too deeply or have a tag that is no typed array.

    """
    try:
        return cbor2.loads(
            data.removeprefix(_SELF_DESCRIBED),
            tag_hook=_typed_array,
            semantic_decoders=_REFUSED,
            max_depth=MAX_DEPTH,
            strict_hashable_types=True,
        )
    except (cbor2.CBORError, ValueError, TypeError, RecursionError) as error:
        raise BridgeError(f"not readable as CBOR: {error.__cause__ or error}") from None


def _head(major: int, number: int) -> bytes:
    kind = major << 5
    if number < 24:
        return bytes((kind | number,))
    if number < 0x100:
        return bytes((kind | 24, number))
    if number < 0x10000:
        return struct.pack(">BH", kind | 25, number)
    if number < 0x1_0000_0000:
        return struct.pack(">BI", kind | 26, number)
    return struct.pack(">BQ", kind | 27, number)


def _add(value: Any, parts: list[Any]) -> None:
    adder = _ADDERS.get(type(value))
    if adder is None:
        raise BridgeError(f"cannot encode a {type(value).__name__} as CBOR")
    adder(value, parts)


def _add_int(value: int, parts: list[Any]) -> None:
    if not -(1 << 64) <= value < 1 << 64:
        raise BridgeError("cannot encode an integer beyond 64 bits as CBOR")
    parts.append(_head(0, value) if value >= 0 else _head(1, -1 - value))


def _add_text(value: str, parts: list[Any]) -> None:
    data = value.encode(errors="replace")  # a lone surrogate has no UTF-8
    parts.append(_head(_TEXT, len(data)))
    parts.append(data)


def _add_bytes(value: Any, parts: list[Any]) -> None:
    parts.append(_head(_BYTE_STRING, len(value)))
    parts.append(value)


def _add_list(values: Any, parts: list[Any]) -> None:
    if len(values) >= _MANY and type(values[0]) is dict:
        quick = _encoded(values)
        if quick is not None:
            parts.append(quick)
            return
    parts.append(_head(_ARRAY, len(values)))
    for value in values:
        _add(value, parts)


def _encoded(values: Any) -> bytes | None:
    """Returns a list as cbor2 encodes it, six times as fast; None if cbor2 refuses a value."""
    try:
        return cbor2.dumps(values)
    except (cbor2.CBORError, ValueError, TypeError, RecursionError):
        return None


def _add_map(values: dict[Any, Any], parts: list[Any]) -> None:
    parts.append(_head(_MAP, len(values)))
    for key, value in values.items():
        _add(key, parts)
        _add(value, parts)


def _add_array(values: NDArray[Any], parts: list[Any]) -> None:
    kind = f"{values.dtype.kind}{values.dtype.itemsize}"
    if kind != "u1":
        if kind not in _TAGS:
            raise BridgeError(f"cannot encode an array of {values.dtype} as CBOR")
        parts.append(_head(_TAG, _TAGS[kind]))
        values = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    parts.append(_head(_BYTE_STRING, values.nbytes))
    parts.append(np.ascontiguousarray(values).data.cast("B") if values.size else b"")


_ADDERS: dict[type, Any] = {
    dict: _add_map,
    str: _add_text,
    int: _add_int,
    float: lambda value, parts: parts.append(struct.pack(">Bd", 0xFB, value)),
    bool: lambda value, parts: parts.append(b"\xf5" if value else b"\xf4"),
    type(None): lambda _, parts: parts.append(b"\xf6"),
    list: _add_list,
    tuple: _add_list,
    bytes: _add_bytes,
    bytearray: _add_bytes,
    memoryview: _add_bytes,
    np.ndarray: _add_array,
}


def _typed_array(tag: Any, _immutable: bool) -> NDArray[Any]:
    dtype = _DTYPES.get(tag.tag)
    if dtype is None or not isinstance(tag.value, bytes):
        raise ValueError(f"tag {tag.tag} is no typed array")
    values = np.frombuffer(tag.value, dtype)
    values = values.astype(values.dtype.newbyteorder("<"), copy=False)
    values.setflags(write=False)
    return values


def _refuse(*_: Any) -> Any:
    raise ValueError("the only tags allowed are those of typed arrays")


_BUILT_IN = (*range(6), 25, 28, 29, 30, 35, 36, 37, 52, 54, 100, 256, 258, 260, 261, 1004, 43000)
_REFUSED = dict.fromkeys(_BUILT_IN, _refuse)
