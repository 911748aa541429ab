"""Encodes and decodes messages as CDR, the wire format of ROS 2; decoding checks the bytes."""

from __future__ import annotations

import struct
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys.base import normalize_fieldname

from volery.core.errors import GraphError
from volery.graph.codecs.definition_files import NUMBERS
from volery.graph.codecs.definition_store import element_type
from volery.graph.codecs.foreign_texts import TolerantStore
from volery.graph.typestore import typestore

_HEADER_BYTES = 4
_BIG_ENDIAN = b"\x00\x00"
_LITTLE_ENDIAN = b"\x00\x01"
_ALIGNMENT_BYTES = 3
"""Maximum padding after a message: writers fill up to a multiple of four."""

CODING_ERRORS = (
    SerdeError,
    struct.error,
    ValueError,
    TypeError,
    AttributeError,
    IndexError,
    OverflowError,
)
"""Exceptions of the generated coders for a message or bytes that do not fit the type."""


def encode_cdr(message: Any, msgtype: str) -> bytes:
    """Encodes a message as little-endian CDR with its four bytes of header.

    Raises `GraphError` if the type is unknown or the message does not fit the type.
    """
    known(msgtype)
    try:
        return bytes(typestore().serialize_cdr(message, msgtype))
    except (*CODING_ERRORS, AssertionError) as error:
        raise GraphError(f"the message does not fit {msgtype}: {error}") from None


def decode_cdr(
    data: bytes | bytearray | memoryview, msgtype: str, *, is_tolerant: bool = False
) -> Any:
    """Decodes CDR (version 1, either byte order) with its four bytes of header.

    The message's arrays are read-only and independent of `data`. Raises `GraphError` if the type is
    unknown or the bytes are not one message of that type: too short, too long, a wrong length, text
    that is not UTF-8. is_tolerant: text of other writers is read; see `foreign_texts`.
    """
    known(msgtype)
    view = memoryview(data).cast("B")
    kind = bytes(view[:2])
    if len(view) < _HEADER_BYTES or kind not in (_LITTLE_ENDIAN, _BIG_ENDIAN):
        raise GraphError(f"{msgtype}: not CDR of version 1 (header {bytes(view[:4]).hex()})")
    store: Any = _tolerant_store() if is_tolerant else typestore()
    definition = store.get_msgdef(msgtype)
    # A copy of the bytes after the header: arrays in it are aligned and owned by the message.
    body = bytes(view[_HEADER_BYTES:])
    little = kind == _LITTLE_ENDIAN
    decode = definition.deserialize_cdr_le if little else definition.deserialize_cdr_be
    try:
        message, end = decode(body, 0, definition.cls, store)
    except CODING_ERRORS as error:
        raise GraphError(
            f"{msgtype}: {len(view)} bytes are not a message of this type: {error}"
        ) from None
    if not end <= len(body) <= end + _ALIGNMENT_BYTES:
        raise GraphError(
            f"{msgtype}: the message has {end + _HEADER_BYTES} bytes, {len(view)} were given"
        )
    if not little or _has_bools(msgtype):
        _own_arrays(message, msgtype)
    return message


@cache
def _tolerant_store() -> TolerantStore:
    return TolerantStore(typestore().get_msgdef, typestore().max_sequence_length)


def known(msgtype: str) -> None:
    """Raises `GraphError` unless the graph knows the type."""
    if msgtype not in typestore().types:
        raise GraphError(f"unknown message type '{msgtype}'")


def own_array(values: NDArray[Any]) -> NDArray[Any]:
    """Returns the array aligned and read-only, bools as 0 or 1; copied only if necessary."""
    if values.dtype == np.bool_:
        values = values.view(np.uint8) != 0
    elif not values.flags.aligned:
        values = values.copy()
    values.setflags(write=False)
    return values


def is_number_array(described: Any) -> bool:
    """Returns whether a field is an array of numbers, which is a numpy array in messages."""
    kind, detail = described
    if kind not in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return False
    (inner, inner_detail), _ = detail
    return inner == Nodetype.BASE and inner_detail[0] in NUMBERS


@cache
def _has_bools(msgtype: str) -> bool:
    """Returns whether a type, or a nested type, contains an array of bools."""
    for _, described in typestore().fielddefs[msgtype][1]:
        if is_number_array(described) and described[1][0][1][0] == "bool":
            return True
        inner = element_type(described)
        if inner and _has_bools(inner):
            return True
    return False


def _own_arrays(message: Any, msgtype: str) -> None:
    for field, described in typestore().fielddefs[msgtype][1]:
        name = normalize_fieldname(field)
        value = getattr(message, name)
        inner = element_type(described)
        if inner:
            for item in value if isinstance(value, list) else [value]:
                _own_arrays(item, inner)
        elif is_number_array(described):
            setattr(message, name, own_array(value))
