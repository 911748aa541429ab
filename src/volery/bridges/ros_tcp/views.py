"""Returns images, clouds and grids as bytes, without a copy of their large field.

Serialization copies a message at least once, which for megabytes takes longer than the socket. In
both generations of ROS a message whose last field, except for a bool perhaps, is a sequence of
bytes consists of a small front, a count, those bytes unchanged, and the bool.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache
from struct import Struct
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from volery.bridges.ros_tcp.wire import Bytes
from volery.core.errors import GraphError
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.messages import Published
from volery.graph.typestore import typestore

LARGE_BYTES = 16 << 10
"""Size below which a copy costs less than splitting a message."""

_COUNT = Struct("<I")
_ELEMENTS = {"uint8": np.dtype(np.uint8), "int8": np.dtype(np.int8)}


def parts_of(published: Published, encode: Callable[[Any, str], bytes]) -> list[Bytes] | None:
    """Returns the parts of a message's bytes; None if it has no large field.

    encode: returns the bytes of a whole message, in either generation.
    """
    plan = _plan(published.msgtype)
    if plan is None:
        return None
    field, element, tail_bytes = plan
    large = getattr(published.message, field)
    if not _can_stay(large, element):
        return None
    rest = encode(dataclasses.replace(published.message, **{field: large[:0]}), published.msgtype)
    end = len(rest) - tail_bytes
    front = rest[: end - _COUNT.size] + _COUNT.pack(len(large))
    return [front, memoryview(large).cast("B"), rest[end:]]


def _can_stay(large: Any, element: np.dtype[Any]) -> bool:
    return (
        isinstance(large, np.ndarray)
        and large.nbytes > LARGE_BYTES
        and large.dtype == element
        and large.ndim == 1
        and large.flags.c_contiguous
    )


@cache
def _plan(msgtype: str) -> tuple[str, np.dtype[Any], int] | None:
    """Returns the large field, type of its elements, bytes after it; None for other types."""
    fields = typestore().fielddefs[msgtype][1]
    tail_bytes = 0
    if len(fields) > 1 and fields[-1][1] == (Nodetype.BASE, ("bool", 0)):
        fields, tail_bytes = fields[:-1], 1
    if not fields:
        return None
    name, (kind, detail) = fields[-1]
    if kind != Nodetype.SEQUENCE or detail[0][0] != Nodetype.BASE:
        return None
    element = _ELEMENTS.get(detail[0][1][0])
    if element is None or not _same_end_in_ros1(msgtype, 1 + tail_bytes):
        return None
    return name, element, tail_bytes


def _same_end_in_ros1(msgtype: str, count: int) -> bool:
    new = [name for name, _ in typestore().fielddefs[msgtype][1]]
    try:
        old = [name for _, name in ros1_codec().fields(msgtype)]
    except (GraphError, KeyError):
        return False
    return old[-count:] == new[-count:]
