"""Decodes messages from the records of a log, from ROS 1 or ROS 2."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from volery.bridges.logs.budgets import MAX_DEFINITION_BYTES, MAX_NESTED_TYPES
from volery.bridges.logs.records import LogRecord, LogTopic
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr
from volery.graph.codecs.ros1 import ros1_codec, ros2_name
from volery.graph.messages import add_definitions
from volery.graph.typestore import typestore

_SEPARATOR = re.compile(r"^=+\s*$", re.MULTILINE)
_NESTED = re.compile(r"\s*MSG:\s*(\S+)[^\n]*\n?")
_TYPE = re.compile(r"([A-Za-z]\w{0,99})/(?:msg/)?([A-Za-z]\w{0,99})", re.ASCII)
_DEFINITION_FORMS = {"ros1msg", "ros2msg"}


class Decoded(NamedTuple):
    """A message and its type."""

    msgtype: str
    message: Any


class LogDecoder:
    """Decodes records; learns unknown types from the definitions in the log."""

    def __init__(self) -> None:
        self._types: dict[LogTopic, str | GraphError] = {}

    def type_of(self, topic: LogTopic) -> str:
        """Returns the type of a topic's messages; learns unknown types.

        Raises `GraphError` as `decode`.
        """
        found = self._types.get(topic)
        if found is None:
            found = self._types[topic] = _type_of(topic)
        if isinstance(found, GraphError):
            raise found
        return found

    def decode(self, record: LogRecord) -> Decoded:
        """Returns the message of a record; its arrays are read-only.

        Raises
        ------
        GraphError
            The type is unknown or differs from the local one, or the bytes do not fit it.

        """
        found = self.type_of(record.topic)
        if record.topic.encoding == "ros1":
            return Decoded(found, ros1_codec().decode(record.data, found))
        return Decoded(found, decode_cdr(record.data, found))


def _type_of(topic: LogTopic) -> str | GraphError:
    """Returns the type of a topic's messages, or the error that prevents decoding."""
    try:
        if topic.encoding not in ("ros1", "cdr"):
            raise GraphError(
                f"messages encoded as '{topic.encoding}' are not decoded, only cdr and ros1"
            )
        name = ros2_name(topic.msgtype) if topic.encoding == "ros1" else topic.msgtype
        if name not in typestore().types:
            _learn(name, topic)
        if topic.encoding == "ros1" and topic.digest:
            ours = ros1_codec().md5(name)
            if ours != topic.digest:
                raise GraphError(
                    f"the log's {name} differs from the local one: md5 {topic.digest}, not {ours}"
                )
    except GraphError as error:
        return error
    return name


def _learn(name: str, topic: LogTopic) -> None:
    """Registers a type, and the types that it nests, from the log's text."""
    if topic.schema_encoding not in _DEFINITION_FORMS or not topic.definition.strip():
        raise GraphError(f"type {name} is not known, and the log does not define it")
    if len(topic.definition) > MAX_DEFINITION_BYTES:
        raise GraphError(
            f"the definition of {name} has more than {MAX_DEFINITION_BYTES} characters"
        )
    first, *others = _SEPARATOR.split(topic.definition)
    if len(others) > MAX_NESTED_TYPES:
        raise GraphError(f"the definition of {name} nests more than {MAX_NESTED_TYPES} types")
    texts = {name: first}
    for other in others:
        head = _NESTED.match(other)
        if head is not None:
            texts[head[1]] = other[head.end() :]
    with tempfile.TemporaryDirectory(prefix="volery-types-") as folder:
        for long_name, text in texts.items():
            parts = _TYPE.fullmatch(long_name)
            if parts is None:
                raise GraphError(f"the log has a type with the name '{long_name[:100]}'")
            if f"{parts[1]}/msg/{parts[2]}" not in typestore().types:
                path = Path(folder, parts[1], "msg", f"{parts[2]}.msg")
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
        add_definitions(folder, foreign=True)
