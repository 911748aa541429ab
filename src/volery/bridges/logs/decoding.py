"""Decodes messages from the records of a log, from ROS 1 or ROS 2."""

from __future__ import annotations

from typing import Any, NamedTuple

from volery.bridges.logs.logged_types import as_type, is_part_of, learn_type
from volery.bridges.logs.records import LogRecord, LogTopic
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr
from volery.graph.codecs.ros1 import ros1_codec, ros2_name
from volery.graph.typestore import typestore


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
        decode = ros1_codec().decode if record.topic.encoding == "ros1" else decode_cdr
        message = decode(record.data, logged)
        return Decoded(msgtype, message if logged == msgtype else as_type(message, msgtype))

    def _types_of(self, topic: LogTopic) -> _Types:
        found = self._types.get(topic)
        if found is None:
            found = self._types[topic] = _types_of(topic)
        if isinstance(found, GraphError):
            raise found
        return found


def _types_of(topic: LogTopic) -> _Types | GraphError:
    """Returns the types of a topic, or the error that prevents decoding."""
    try:
        if topic.encoding not in ("ros1", "cdr"):
            raise GraphError(
                f"messages encoded as '{topic.encoding}' are not decoded, only cdr and ros1"
            )
        name = ros2_name(topic.msgtype) if topic.encoding == "ros1" else topic.msgtype
        is_ros1 = topic.encoding == "ros1"
        is_known = name in typestore().types
        if is_known and is_ros1 and topic.digest == ros1_codec().md5(name):
            return _Types(name, name)
        logged = learn_type(name, topic)
        if logged == name and is_ros1 and topic.digest:
            ours = ros1_codec().md5(name)
            if ours != topic.digest:
                raise GraphError(
                    f"the log's {name} differs from the local one: md5 {topic.digest}, not {ours}"
                )
        is_local = is_known and logged != name and is_part_of(logged, name)
    except GraphError as error:
        return error
    return _Types(logged, name if is_local else logged)
