"""MCAP files with every option of its writers have the counts that its own reader finds."""

from __future__ import annotations

import itertools
import struct
from collections import Counter

import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.typesys import Stores, get_typestore

from volery.bridges.logs.reader import summarize
from volery.bridges.logs.recovery import recover
from volery.core.errors import GraphError, RecordingError
from volery.graph.message_copies import message_checker
from volery.logs import open_log

TEXT = b"\0\1\0\0" + struct.pack("<I", 3) + b"hi\0"
BINARY = b"\x0a\xff\xfe\0"
"""A schema that is no text, as those of protobuf."""
OPTIONS = [
    dict(zip(("compression", "use_chunking", "repeat", "use_statistics", "index_types"), values,
             strict=True))
    for values in itertools.product(
        CompressionType, *[(True, False)] * 3, (IndexType.ALL, IndexType.NONE)
    )
]  # fmt: skip


def write(path, repeat=True, **options):
    with path.open("wb") as file:
        writer = Writer(
            file, chunk_size=200, repeat_channels=repeat, repeat_schemas=repeat, **options
        )
        writer.start()
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        binary = writer.register_schema("x.Y", "protobuf", BINARY)
        channels = [
            (writer.register_channel("/text", "cdr", text), TEXT),
            (writer.register_channel("/binary", "protobuf", binary), b"\x08\x01"),
            (writer.register_channel("/without", "json", 0), b"{}"),
        ]
        writer.register_channel("/silent", "cdr", text)
        for k, (channel, data) in itertools.product(range(20), channels):
            writer.add_message(channel, 10 * k, data, 10 * k, k)
        writer.add_attachment(1, 1, "a.txt", "text/plain", b"x" * 50)
        writer.add_metadata("m", {"a": "b"})
        writer.finish()
    return path


def counts(path):
    """Counts by topic: those of `summarize`, which must equal those of `open_log`."""
    with open_log(path) as log:
        whole = {name: count.messages for name, count in log.topics.items() if count.messages}
        read = Counter(message.topic.topic for message in log._source.records(log.topics, 0, 999))
    short = summarize(path)
    assert {t.topic: t.messages for t in short.topics if t.messages} == whole == dict(read)
    assert (log.problem, short.problem) == ("", "")
    return whole


@pytest.mark.parametrize("options", OPTIONS, ids=lambda o: "-".join(map(str, o.values())))
def test_counts(tmp_path, options):
    path = write(tmp_path / "log.mcap", **options)
    with path.open("rb") as file:
        theirs = Counter(channel.topic for _, channel, _ in NonSeekingReader(file).iter_messages())
    assert counts(path) == theirs == {"/text": 20, "/binary": 20, "/without": 20}


def test_records_with_more_fields_than_this_version_has(tmp_path):
    """Readers ignore bytes at the end of a record."""
    data = write(tmp_path / "plain.mcap", compression=CompressionType.NONE).read_bytes()
    records, position = [data[:8]], 8
    while position < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, position)
        body = data[position + 9 : position + 9 + length]
        extra = b"\1\xff\xff" if opcode in (1, 3, 4, 7, 8, 11, 14) else b""
        records.append(struct.pack("<BQ", opcode, len(body) + len(extra)) + body + extra)
        position += 9 + length
    padded = tmp_path / "padded.mcap"
    padded.write_bytes(b"".join(records) + data[-8:])
    assert counts(padded) == {"/text": 20, "/binary": 20, "/without": 20}


def test_a_recovered_log_keeps_schemas_of_other_formats(tmp_path):
    path = write(tmp_path / "cut.mcap")
    path.write_bytes(path.read_bytes()[:-20])
    found = recover(path).path
    with found.open("rb") as file:
        summary = make_reader(file).get_summary()
    channels = {channel.topic: channel.schema_id for channel in summary.channels.values()}
    schemas = {number: schema.data for number, schema in summary.schemas.items()}
    assert channels["/without"] == 0
    assert schemas[channels["/binary"]] == BINARY
    assert counts(found) == {"/text": 20, "/binary": 20, "/without": 20}
    with open_log(found) as log:
        assert log["/text"]["data"].tolist() == ["hi"] * 20


@pytest.fixture
def one(tmp_path):
    """Returns a function that writes one message with a schema, and opens the log."""

    def write(name, form, text, data, encoding="cdr"):
        path = tmp_path / "one.mcap"
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start()
            schema = writer.register_schema(name, form, text.encode("latin-1")) if form else 0
            channel = writer.register_channel("/probe", encoding, schema)
            writer.add_message(channel, 1, data, 1)
            writer.finish()
        return open_log(path)["/probe"]

    return write


def cdr(*numbers):
    return b"\0\1\0\0" + struct.pack(f"<{len(numbers)}i", *numbers)


LINE = "=" * 80 + "\n"


@pytest.mark.parametrize(
    ("name", "text", "data", "field", "value"),
    [
        ("std_msgs/String", "string data", TEXT, "data", "hi"),  # without msg/
        ("short_probe_msgs/Thing", f"Sub s\n{LINE}MSG: short_probe_msgs/Sub\nint32 b\n", cdr(2),
         "s.b", 2),
        ("own_probe_msgs/msg/Thing", f"Header h\n{LINE}MSG: own_probe_msgs/Header\nint32 z\n",
         cdr(9), "h.z", 9),
        ("latin_probe_msgs/msg/Thing", "# \xb0C\nint32 z # 5 \xb5m\n", cdr(9), "z", 9),
        ("word_probe_msgs/msg/Thing", "int32 from\nint32 lambda 3\n", cdr(9, 8), "lambda_", 8),
        ("octet_probe_msgs/msg/Thing", "byte[2] a [0, 255]\nbyte[] b [200]\nint32 c\n",
         b"\0\1\0\0\1\2\0\0" + struct.pack("<Ii", 0, 7), "c", 7),
        ("act_probe_msgs/action/Go_FeedbackMessage",
         "int32 order\n---\nint32 done\n---\nint32 part\n",
         b"\0\1\0\0" + bytes(16) + struct.pack("<i", 4), "feedback.part", 4),
        ("act_probe_msgs/srv/Add_Response", "int32 a\n---\nint32 sum\n", cdr(5), "sum", 5),
    ],
)  # fmt: skip
def test_definitions_as_writers_hold_them(one, name, text, data, field, value):
    found = one(name, "ros2msg", text, data)
    assert found[field].tolist() == [value]
    assert found.refused == 0


def test_messages_with_keywords_as_fields_are_checked_before_they_are_published(one):
    found = one("word_probe_msgs/msg/Thing", "ros2msg", "int32 from\nint32 lambda 3\n", cdr(9, 8))
    (logged,) = found.messages()
    check = message_checker("word_probe_msgs/msg/Thing")
    check(logged.message)
    logged.message.from_ = "nine"
    with pytest.raises(GraphError, match="from_ must be an int32"):
        check(logged.message)


def test_events_of_services(one):
    """A log holds the file of the service for them (REP 2012)."""
    store = get_typestore(Stores.ROS2_JAZZY)
    info = store.types["service_msgs/msg/ServiceEventInfo"]
    stamp = store.types["builtin_interfaces/msg/Time"](1, 2)
    import numpy as np

    head = store.serialize_cdr(
        info(3, stamp, np.zeros(16, np.uint8), 77), "service_msgs/msg/ServiceEventInfo"
    )
    data = bytes(head) + struct.pack("<Iiii", 1, 4, 0, 0)[:8] + struct.pack("<I", 0)
    found = one("event_probe_msgs/srv/Add_Event", "ros2msg", "int32 a\n---\nint32 sum\n", data)
    (message,) = (each.message for each in found.messages())
    assert (message.info.sequence_number, message.request[0].a, message.response) == (77, 4, [])


def test_a_definition_that_is_cut_off_does_not_hide_the_known_type(one):
    """`string name` alone would be 20 of the bytes."""
    store = get_typestore(Stores.ROS2_JAZZY)
    frame = store.types["std_msgs/msg/Header"](
        store.types["builtin_interfaces/msg/Time"](1, 2), "map"
    )
    data = bytes(store.serialize_cdr(frame, "std_msgs/msg/Header"))
    found = one("std_msgs/msg/Header", "ros2msg", "builtin_interfaces/Time stamp\n", data)
    assert found["frame_id"].tolist() == ["map"]


@pytest.mark.parametrize(
    ("name", "form", "text", "data", "words"),
    [
        ("q::Thing", "omgidl", "struct Thing { long a; };", cdr(1), "log defines it as 'omgidl'"),
        ("", "", "", TEXT, "the log names no type: a channel without schema"),
        ("new_probe_msgs/msg/C", "unknown", "", cdr(1), "C is not known, and the log does not"),
        ("new_probe_msgs/msg/C", "ros2msg", "", cdr(1), "C is not known, and the log does not"),
        ("new_probe_msgs/msg/A", "ros2msg", "wstring a\n", cdr(0), "A:1: wstring is not supported"),
        ("std_msgs/msg/Int32", "ros2msg", "int32 data\n", b"\0\7\0\0" + bytes(4),
         "none of its 1 message can be decoded; the first: std_msgs/msg/Int32: not CDR of "),
        ("idl_probe/msg/U", "ros2idl", "module a {\n union U;\n};", cdr(0), "Could not parse"),
    ],
)  # fmt: skip
def test_what_cannot_be_decoded_is_said_in_one_line(one, name, form, text, data, words):
    with pytest.raises(RecordingError) as caught:
        len(one(name, form, text, data))
    message = str(caught.value)
    assert message.startswith("/probe cannot be read: ")
    assert words in message
    assert "\n" not in message
