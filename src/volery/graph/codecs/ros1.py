"""Encodes the graph's ROS 2 messages as ROS 1 bytes, and decodes them.

The two generations share most definitions. They differ in the header's `seq`, in a few fields that
ROS 2 added (`Range.variance`) or renamed (`CameraInfo.D` became `d`), and in packages that moved
(`rosapi`). A ROS 1 coder is compiled once per type; it reads and creates ROS 2 messages directly:

    codec = Ros1Codec()
    data = codec.encode(scan, "sensor_msgs/msg/LaserScan", seq=7)
    scan = codec.decode(data, "sensor_msgs/msg/LaserScan")
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable
from functools import cache
from hashlib import md5
from typing import Any

from rosbags.interfaces import Msgdef, Nodetype
from rosbags.serde.ros1 import (
    generate_deserialize_ros1,
    generate_getsize_ros1,
    generate_serialize_ros1,
)
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.store import Typestore

from volery.core.errors import GraphError
from volery.graph.codecs.cdr import CODING_ERRORS, is_number_array, own_array
from volery.graph.codecs.definition_store import EMPTY_MEMBER, DefinitionStore, element_type
from volery.graph.codecs.foreign_texts import TolerantStore
from volery.graph.codecs.ros1_names import ros1_name, ros2_name
from volery.graph.codecs.zero import value_maker
from volery.graph.typestore import typestore

__all__ = ["Ros1Codec", "ros1_codec", "ros1_name", "ros2_name"]

HEADER = "std_msgs/msg/Header"
_BASIC = {"builtin_interfaces/msg/Time": "time", "builtin_interfaces/msg/Duration": "duration"}
_OLD_FIELDS = {"default": "default_value"}
"""Fields that ROS 2 renamed other than in case."""
_SPARE_ELEMENTS = 1024
"""Elements that an array may have beyond the bytes of its message: empty messages."""

_STAMP_AND_SEQ = struct.Struct("<IiII")


class _Call:
    """The typestore of the generated coders during one call."""

    __slots__ = ("get_msgdef", "max_sequence_length", "seq")

    def __init__(self, get_msgdef: Callable[[str], Any], longest: int, seq: int) -> None:
        self.get_msgdef = get_msgdef
        self.max_sequence_length = longest
        self.seq = seq


class Ros1Codec:
    """Encodes and decodes messages of the graph for ROS 1. Thread-safe."""

    def __init__(self, ros2: DefinitionStore | None = None) -> None:
        self._ros2 = typestore() if ros2 is None else ros2
        self._ros1 = get_typestore(Stores.ROS1_NOETIC)
        self._coders: dict[str, Msgdef[Any]] = {}
        self._tolerant = TolerantStore(self._coder)
        self._sums: dict[str, str] = {}
        self._lock = threading.RLock()

    def encode(self, message: Any, msgtype: str, seq: int = 0) -> bytes:
        """Encodes a message as ROS 1 bytes.

        msgtype: ROS 2 name; parts of services are named `std_srvs/srv/SetBool_Request`. seq: the
        `seq` of all headers, modulo 2**32. Raises `GraphError` if the type is unknown or the
        message does not fit the type.
        """
        coder = self._coder(msgtype)
        call: Any = _Call(self._coder, 0, seq & 0xFFFFFFFF)
        try:
            size = coder.getsize_ros1(0, message, call)
            data = bytearray(size)
            end = coder.serialize_ros1(memoryview(data), 0, message, call)
        except CODING_ERRORS as error:
            raise GraphError(f"the message does not fit {msgtype}: {error}") from None
        if end != size:
            raise GraphError(f"the message does not fit {msgtype}: {end} bytes, not {size}")
        return bytes(data)

    def decode(
        self, data: bytes | bytearray | memoryview, msgtype: str, *, is_tolerant: bool = False
    ) -> Any:
        """Decodes a message from ROS 1 bytes.

        The message's arrays are read-only and independent of `data`. Fields that ROS 1 lacks are
        zero. Raises `GraphError` if the type is unknown or the bytes are not one message of that
        type: too short, too long, a wrong length, text that is not UTF-8. is_tolerant: text of
        other writers is read; see `foreign_texts`.
        """
        owned = data if type(data) is bytes else bytes(data)
        get_coder = self._tolerant.get_msgdef if is_tolerant else self._coder
        coder = get_coder(msgtype)
        call: Any = _Call(get_coder, len(owned) + _SPARE_ELEMENTS, 0)
        try:
            message, end = coder.deserialize_ros1(owned, 0, coder.cls, call)
        except CODING_ERRORS as error:
            raise GraphError(
                f"{msgtype}: {len(owned)} bytes are not a message of this type: {error}"
            ) from None
        if end != len(owned):
            raise GraphError(f"{msgtype}: the message has {end} bytes, {len(owned)} were given")
        return message

    def learn(self, msgtype: str) -> None:
        """Compiles the coder of a type, some milliseconds; raises `GraphError` if unknown."""
        self._coder(msgtype)

    def fields(self, msgtype: str) -> list[tuple[str, str | None]]:
        """Returns the ROS 1 fields in order, each with its ROS 2 name, None without one."""
        new = {name.lower(): name for name, _ in self._ros2.fielddefs[msgtype][1]}
        return [
            (name, new.get(name.lower()) or new.get(_OLD_FIELDS.get(name, name)))
            for name, _ in self._ros1_fields(msgtype)
        ]

    def described(self, msgtype: str) -> list[Any]:
        """Returns the types of the ROS 1 fields in order, as `rosbags` describes them.

        Raises `GraphError` if the type is unknown.
        """
        return [described for _, described in self._ros1_fields(msgtype)]

    def md5(self, msgtype: str) -> str:
        """Returns the ROS 1 md5 sum of a message type or service (`std_srvs/srv/SetBool`).

        Raises `GraphError` if the type is unknown.
        """
        if msgtype not in self._sums:
            if msgtype in _BASIC:
                text = f"{_BASIC[msgtype]} data"
            else:
                text = "".join(self._text(part, summed=True) for part in self._parts(msgtype))
            self._sums[msgtype] = md5(text.encode(), usedforsecurity=False).hexdigest()
        return self._sums[msgtype]

    def definition_text(self, msgtype: str) -> str:
        """Returns the ROS 1 definition of a message type or service with its nested types.

        Raises `GraphError` if the type is unknown.
        """
        if msgtype in _BASIC:
            return f"{_BASIC[msgtype]} data\n"
        others = [
            f"{'=' * 80}\nMSG: {ros1_name(name)}\n{_ended(self._text(name))}"
            for name in self.nested_types(msgtype)
        ]
        return self.own_definition_text(msgtype) + "".join(others)

    def own_definition_text(self, msgtype: str) -> str:
        """Returns the ROS 1 definition of a type without its nested types, as in its file.

        Raises `GraphError` if the type is unknown.
        """
        return "---\n".join(_ended(self._text(part)) for part in self._parts(msgtype))

    def nested_types(self, msgtype: str) -> list[str]:
        """Returns the ROS 2 names of all nested types. Raises `GraphError` for an unknown type."""
        nested: list[str] = []
        for part in self._parts(msgtype):
            self._collect(part, nested)
        return nested

    def _parts(self, msgtype: str) -> list[str]:
        """Returns the message types of a name: the type itself, or a service's two."""
        if msgtype in self._ros2.fielddefs:
            return [msgtype]
        parts = [f"{msgtype}_Request", f"{msgtype}_Response"]
        if all(part in self._ros2.fielddefs for part in parts):
            return parts
        raise GraphError(f"unknown type '{msgtype}'")

    def _definition(self, msgtype: str) -> tuple[str, Any]:
        """Returns a type's name and definition in ROS 1."""
        if msgtype in self._ros1.fielddefs:
            return msgtype, self._ros1.fielddefs[msgtype]
        if msgtype not in self._ros2.fielddefs:
            raise GraphError(f"unknown message type '{msgtype}'")
        package, kind, name = msgtype.split("/")
        # A moved package may have files under its old name, for types that the move changed.
        old_package, _ = ros1_name(msgtype).split("/")
        old = f"{old_package}/{kind}/{name}"
        found = old if package != old_package and old in self._ros2.fielddefs else msgtype
        return found, self._ros2.fielddefs[found]

    def _ros1_fields(self, msgtype: str) -> list[tuple[str, Any]]:
        _, (_, fields) = self._definition(msgtype)
        return [(name, described) for name, described in fields if name != EMPTY_MEMBER]

    def _text(self, msgtype: str, *, summed: bool = False) -> str:
        """Returns a type's definition in normal form, nested types as names or md5 sums."""
        found, (constants, _) = self._definition(msgtype)
        lines = []
        for name, base, value in constants:
            text = self._ros2.constant_text(found, name)
            lines.append(f"{base} {name}={value if text is None else text}")
        for name, described in self._ros1_fields(msgtype):
            kind, detail = described
            is_list = kind in (Nodetype.ARRAY, Nodetype.SEQUENCE)
            inner, inner_detail = detail[0] if is_list else described
            brackets = ""
            if is_list:
                brackets = f"[{detail[1]}]" if kind == Nodetype.ARRAY else "[]"
            if inner == Nodetype.BASE:
                typename = inner_detail[0] + brackets
            elif inner_detail in _BASIC:
                typename = _BASIC[inner_detail] + brackets
            elif summed:
                typename = self.md5(inner_detail)  # ROS 1 drops the brackets here
            else:
                typename = ros1_name(inner_detail) + brackets
            lines.append(f"{typename} {name}")
        return "\n".join(lines)

    def _collect(self, msgtype: str, nested: list[str]) -> None:
        for _, described in self._ros1_fields(msgtype):
            inner = element_type(described)
            if inner and inner not in _BASIC and inner not in nested:
                nested.append(inner)
                self._collect(inner, nested)

    def _coder(self, msgtype: str) -> Msgdef[Any]:
        coder = self._coders.get(msgtype)
        if coder is None:
            with self._lock:
                if msgtype not in self._coders:
                    self._coders[msgtype] = self._compile(msgtype)
                coder = self._coders[msgtype]
        return coder

    def _compile(self, msgtype: str) -> Msgdef[Any]:
        if msgtype not in self._ros2.fielddefs:
            raise GraphError(f"unknown message type '{msgtype}'")
        fields = self._ros1_fields(msgtype)
        names = self.fields(msgtype)
        entries: Any = []
        for (name, described), (_, new) in zip(fields, names, strict=True):
            if new is None and msgtype != HEADER:
                raise GraphError(f"{msgtype} has no field for ROS 1's '{name}'")
            entries.append((normalize_fieldname(new or name), described))
        store: Any = _Call(self._coder, 0, 0)
        if msgtype == HEADER:
            sized: tuple[Any, int] = (_header_size, 0)
            serialize: Any = _serialize_header
        else:
            sized = generate_getsize_ros1(entries, store)
            serialize = generate_serialize_ros1(entries, store)
        unused: Any = _unused
        getsize, size = sized
        return Msgdef(
            name=msgtype,
            fields=entries,
            cls=self._maker(msgtype, fields, names),
            size_cdr=0,
            getsize_cdr=unused,
            serialize_cdr_le=unused,
            serialize_cdr_be=unused,
            deserialize_cdr_le=unused,
            deserialize_cdr_be=unused,
            size_ros1=size,
            getsize_ros1=getsize,
            serialize_ros1=serialize,
            deserialize_ros1=generate_deserialize_ros1(entries, store),
            getsize_ros1_to_cdr=unused,
            ros1_to_cdr=unused,
            getsize_cdr_to_ros1=unused,
            cdr_to_ros1=unused,
        )

    def _maker(
        self, msgtype: str, fields: list[tuple[str, Any]], names: list[tuple[str, str | None]]
    ) -> Any:
        """Returns a function that creates the ROS 2 message from the ROS 1 field values."""
        cls: Any = self._ros2.types[msgtype]
        position = {new: k for k, (_, new) in enumerate(names) if new is not None}
        arrays = [k for k, (_, described) in enumerate(fields) if is_number_array(described)]
        new_fields = [f for f in self._ros2.fielddefs[msgtype][1] if f[0] != EMPTY_MEMBER]
        order = [position.get(name) for name, _ in new_fields]
        if order == list(range(len(fields))):
            if not arrays:
                return cls

            def make(*values: Any) -> Any:
                owned = list(values)
                for k in arrays:
                    owned[k] = own_array(owned[k])
                return cls(*owned)

            return make
        zeros = [value_maker(described) for _, described in new_fields]
        plan = list(zip(order, zeros, strict=True))

        def rearrange(*values: Any) -> Any:
            owned = list(values)
            for k in arrays:
                owned[k] = own_array(owned[k])
            return cls(*[zero() if k is None else owned[k] for k, zero in plan])

        return rearrange


@cache
def ros1_codec() -> Ros1Codec:
    """Returns the codec of the process, so that compiled coders are shared."""
    return Ros1Codec()


def _ended(text: str) -> str:
    return f"{text}\n" if text else ""


def _header_size(position: int, header: Any, _: Typestore) -> int:
    return position + _STAMP_AND_SEQ.size + len(header.frame_id.encode())


def _serialize_header(data: memoryview, position: int, header: Any, call: Any) -> int:
    frame = header.frame_id.encode()
    stamp = header.stamp
    _STAMP_AND_SEQ.pack_into(data, position, call.seq, stamp.sec, stamp.nanosec, len(frame))
    position += _STAMP_AND_SEQ.size
    end = position + len(frame)
    data[position:end] = frame
    return end


def _unused(*_: Any) -> Any:
    raise NotImplementedError("ROS 1 coders do not support CDR")
