"""Counts the objects that a message's bytes would become, before any object is created.

Arrays of numbers are copied whole, whatever their length; each message and text in an array becomes
a Python object, at 1 to 2 us. So the lengths of arrays of messages and texts determine the cost of
decoding, and types without such arrays are not examined.

    check_objects(data, "tf2_msgs/msg/TFMessage", ROS1)
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.typestore import typestore

MAX_OBJECTS = 20_000
"""Limit of messages and texts in arrays of a client's message: 3,300 transforms; 30 to 40 ms."""

CDR, ROS1 = "cdr", "ros1"
_CDR_HEADER_BYTES = 4
_LENGTH_BYTES = 4
_SIZES = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4,
    "uint32": 4, "float32": 4, "int64": 8, "uint64": 8, "float64": 8, "float128": 16,
}  # fmt: skip


@dataclass(frozen=True)
class _Fixed:
    """Numbers of one alignment; ROS 1 aligns none."""

    align: int
    size: int


@dataclass(frozen=True)
class _Text:
    pass


@dataclass(frozen=True)
class _Sequence:
    """A length, and as many elements; align, size: of a number, 0 where it holds none."""

    align: int = 0
    size: int = 0
    element: _Plan | None = None


@dataclass
class _Plan:
    """Layout of a type's parts, with nested messages flattened."""

    steps: list[_Fixed | _Text | _Sequence] = field(default_factory=list)
    objects: int = 1
    """Objects of the message without the elements of its sequences."""

    @property
    def grows(self) -> bool:
        """Whether the number of objects depends on the bytes."""
        return any(isinstance(step, _Sequence) and not step.size for step in self.steps)

    @property
    def is_fixed(self) -> bool:
        """Whether all messages have the same size, and need no padding between them."""
        return (
            len(self.steps) == 1
            and isinstance(self.steps[0], _Fixed)
            and self.steps[0].size % self.steps[0].align == 0
        )

    def add_fixed(self, align: int, size: int) -> None:
        last = self.steps[-1] if self.steps else None
        if isinstance(last, _Fixed) and last.align == align and last.size % align == 0:
            self.steps[-1] = _Fixed(align, last.size + size)
        elif size:
            self.steps.append(_Fixed(align, size))


def check_objects(data: bytes | bytearray | memoryview, msgtype: str, form: str) -> None:
    """Raises `GraphError` if the bytes would become more objects than a client may send.

    form: `CDR`, with its four bytes of header, or `ROS1`. Truncated bytes pass: the decoder rejects
    them.
    """
    plan = _plan_of(msgtype, form)
    if plan.grows:
        _Count(data, form).check(plan, msgtype)


class _Count:
    """One walk through the bytes of a message."""

    def __init__(self, data: bytes | bytearray | memoryview, form: str) -> None:
        big = form == CDR and bytes(data[:2]) == b"\x00\x00"
        self._length = struct.Struct(">I" if big else "<I")
        self._data = memoryview(data).cast("B")[_CDR_HEADER_BYTES if form == CDR else 0 :]
        self._objects = 0
        self._position = 0

    def check(self, plan: _Plan, msgtype: str) -> None:
        try:
            self._walk(plan)
        except struct.error:  # truncated
            return
        except OverflowError:
            raise GraphError(
                f"a {msgtype} has more than {MAX_OBJECTS:,} messages and texts in its arrays; "
                "send several messages"
            ) from None

    def _walk(self, plan: _Plan) -> None:
        for step in plan.steps:
            if isinstance(step, _Fixed):
                self._position = _aligned(self._position, step.align) + step.size
            elif isinstance(step, _Text):
                length = self._read_length()
                self._position += length
            else:
                self._walk_sequence(step)

    def _walk_sequence(self, step: _Sequence) -> None:
        count = self._read_length()
        if step.size:
            if count:
                self._position = _aligned(self._position, step.align) + count * step.size
            return
        assert step.element is not None
        self._objects += count * step.element.objects
        if self._objects > MAX_OBJECTS:
            raise OverflowError
        if step.element.is_fixed:
            fixed = step.element.steps[0]
            assert isinstance(fixed, _Fixed)
            if count:
                self._position = _aligned(self._position, fixed.align) + count * fixed.size
        else:
            for _ in range(count):
                self._walk(step.element)

    def _read_length(self) -> int:
        start = self._position
        (length,) = self._length.unpack_from(self._data, start)
        self._position = start + _LENGTH_BYTES
        return int(length)


def _aligned(position: int, align: int) -> int:
    return (position + align - 1) & -align


@cache
def _plan_of(msgtype: str, form: str) -> _Plan:
    plan = _Plan()
    _add_message(plan, msgtype, form)
    return plan


def _add_message(plan: _Plan, msgtype: str, form: str) -> None:
    for described in _fields(msgtype, form):
        _add_field(plan, described, form)


def _fields(msgtype: str, form: str) -> list[Any]:
    if form == ROS1:
        return ros1_codec().described(msgtype)
    return [described for _, described in typestore().fielddefs[msgtype][1]]


def _add_field(plan: _Plan, described: Any, form: str) -> None:
    kind, detail = described
    if kind == Nodetype.NAME:
        plan.objects += 1
        _add_message(plan, detail, form)
    elif kind == Nodetype.BASE:
        _add_base(plan, detail[0], form)
    elif kind == Nodetype.ARRAY:
        element, length = detail
        if element[0] == Nodetype.BASE and element[1][0] != "string":
            size = _SIZES[element[1][0]]
            plan.add_fixed(size if form == CDR else 1, size * length)
        else:
            for _ in range(length):
                _add_field(plan, element, form)
    else:
        _add_sequence(plan, detail[0], form)


def _add_base(plan: _Plan, base: str, form: str) -> None:
    if base != "string":
        plan.add_fixed(_SIZES[base] if form == CDR else 1, _SIZES[base])
        return
    _add_length(plan, form)
    plan.steps.append(_Text())


def _add_length(plan: _Plan, form: str) -> None:
    """Adds the padding before a length, which CDR aligns."""
    if form == CDR:
        plan.steps.append(_Fixed(_LENGTH_BYTES, 0))


def _add_sequence(plan: _Plan, element: Any, form: str) -> None:
    _add_length(plan, form)
    kind, detail = element
    if kind == Nodetype.NAME:
        inner = _Plan()
        _add_message(inner, detail, form)
        plan.steps.append(_Sequence(element=inner))
    elif detail[0] == "string":
        inner = _Plan()
        _add_base(inner, "string", form)
        plan.steps.append(_Sequence(element=inner))
    else:
        size = _SIZES[detail[0]]
        plan.steps.append(_Sequence(size if form == CDR else 1, size))
