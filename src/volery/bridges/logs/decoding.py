"""Decodes messages from the records of a log, from ROS 1 or ROS 2.

Messages in CDR may be compressed one by one, as `ros2 bag record --compression-mode message` does.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import zstandard
from rosbags.serde import SerdeError

from volery.bridges.logs.budgets import MAX_CHUNK_BYTES
from volery.bridges.logs.logged_types import as_type, is_part_of, learn_type
from volery.bridges.logs.records import LogRecord, LogTopic
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr
from volery.graph.codecs.ros1 import ros1_codec, ros2_name
from volery.graph.typestore import typestore

_ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of what zstd compressed; those of CDR are zero."""


class Decoded(NamedTuple):
    """A message and its type."""

    msgtype: str
    message: Any


class _Types(NamedTuple):
    """Types of a topic: of its bytes, and of the messages made from them."""

    logged: str
    msgtype: str


class LogDecoder:
    """Decodes records by the definitions in the log; learns from them what is not known."""

    def __init__(self) -> None:
        self._types: dict[LogTopic, _Types | GraphError] = {}

    def type_of(self, topic: LogTopic) -> str:
        """Returns the type of a topic's messages; learns unknown types.

        Raises `GraphError` as `decode`.
        """
        return self._types_of(topic).msgtype

    def decode(self, record: LogRecord) -> Decoded:
        """Returns the message of a record; its arrays are read-only.

        Raises
        ------
        GraphError
            The type is unknown, or the bytes do not fit it.

        """
        logged, msgtype = self._types_of(record.topic)
        try:
            message = _read(record, logged)
        except GraphError:
            if logged == msgtype:
                raise
            # some recorders cut definitions off, so that only the first fields are left
            return Decoded(msgtype, _read(record, msgtype))
        return Decoded(msgtype, message if logged == msgtype else as_type(message, msgtype))

    def _types_of(self, topic: LogTopic) -> _Types:
        found = self._types.get(topic)
        if found is None:
            found = self._types[topic] = _types_of(topic)
        if isinstance(found, GraphError):
            raise found
        return found


def _read(record: LogRecord, msgtype: str) -> Any:
    """Returns the message of a record; texts of other writers are read where they must."""
    data = record.data
    if record.topic.encoding == "ros1":
        decode = ros1_codec().decode
    else:
        decode, data = decode_cdr, _unpacked(data) if data.startswith(_ZSTD) else data
    try:
        return decode(data, msgtype)
    except GraphError as error:
        if not isinstance(error.__context__, UnicodeDecodeError | SerdeError):
            raise
        return decode(data, msgtype, is_tolerant=True)


def _unpacked(data: bytes) -> bytes:
    decompressor = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES)
    try:
        with decompressor.stream_reader(data) as stream:
            unpacked = stream.read(MAX_CHUNK_BYTES + 1)
    except zstandard.ZstdError as error:
        raise GraphError(f"a message compressed by zstd is damaged: {error}") from None
    if len(unpacked) > MAX_CHUNK_BYTES:
        raise GraphError(f"a message unpacks to more than {MAX_CHUNK_BYTES} bytes")
    return unpacked


def _full_name(topic: LogTopic) -> str:
    """Returns the name of a topic's type in ROS 2 style; some writers leave out `msg/`."""
    name = topic.msgtype
    if not name:
        raise GraphError("the log names no type: a channel without schema")
    if topic.encoding == "ros1" or name.count("/") == 1:
        return ros2_name(name)
    return name


def _types_of(topic: LogTopic) -> _Types | GraphError:
    """Returns the types of a topic, or the error that prevents decoding."""
    try:
        if topic.encoding not in ("ros1", "cdr"):
            raise GraphError(
                f"messages encoded as '{topic.encoding}' are not decoded, only cdr and ros1"
            )
        name = _full_name(topic)
        is_ros1 = topic.encoding == "ros1"
        is_known = name in typestore().types
        if is_known and is_ros1 and topic.digest == ros1_codec().md5(name):
            return _Types(name, name)
        logged, problem = learn_type(name, topic)
        if problem and is_ros1 and topic.digest:
            ours = ros1_codec().md5(name)
            if ours != topic.digest:
                raise GraphError(
                    f"the log's {name} differs from the local one (md5 {topic.digest}, not {ours})"
                    f", and its own definition cannot be used: {problem}"
                )
        is_local = is_known and logged != name and is_part_of(logged, name)
    except GraphError as error:
        return error
    return _Types(logged, name if is_local else logged)
