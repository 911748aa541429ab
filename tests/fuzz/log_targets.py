"""Logs: MCAP files, ROS 1 bags and ULogs as other programs, damage and crashes leave them."""

from __future__ import annotations

import contextlib
import struct
from collections import Counter
from functools import cache

from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter
from scratch_files import path_of

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.records import LogWalk
from volery.bridges.logs.recovery import recover
from volery.core.errors import GraphError, RecordingError
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.messages import String, Twist, Vector3
from volery.logs.ulog_source import UlogSource
from volery.mavlink.autopilot.logs.ulog import UlogTopic, header, logged_text, text_info

STRING = "std_msgs/msg/String"
TWIST = "geometry_msgs/msg/Twist"
_TWIST = Twist(Vector3(1.0, 2.0, 3.0), Vector3(0.0, 0.0, 0.5))
_SHORTEST = 14
"""Bytes of the longer magic: what is in front of the first record."""


@cache
def _mcaps():
    """Without checksums, else none but the first change would be seen."""
    found = []
    for compression in (CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD):
        for chunks in (True, False):
            path = path_of("seed.mcap")
            with path.open("wb") as file:
                writer = Writer(
                    file,
                    chunk_size=300,
                    compression=compression,
                    use_chunking=chunks,
                    enable_crcs=False,
                )
                writer.start(profile="ros2", library="fuzz")
                for name, text, message in (
                    (STRING, b"string data\n", String("hello")),
                    (TWIST, b"Vector3 linear\nVector3 angular\n", _TWIST),
                ):
                    schema = writer.register_schema(name, "ros2msg", text)
                    channel = writer.register_channel(f"/{name[-5:]}", "cdr", schema)
                    data = encode_cdr(message, name)
                    for k in range(4):
                        writer.add_message(channel, k, data, k, k)
                writer.finish()
            found.append(path.read_bytes())
    return found


@cache
def _bags():
    found = []
    codec = ros1_codec()
    for compression in (None, BagWriter.CompressionFormat.LZ4, BagWriter.CompressionFormat.BZ2):
        path = path_of("seed.bag")
        path.unlink(missing_ok=True)
        writer = BagWriter(path)
        if compression is not None:
            writer.set_compression(compression)
        with writer:
            for name, message in ((STRING, String("hello")), (TWIST, _TWIST)):
                text, md5 = codec.definition_text(name), codec.md5(name)
                connection = writer.add_connection(f"/{name[-5:]}", name, msgdef=text, md5sum=md5)
                for k in range(4):
                    writer.write(connection, k * 10**9, codec.encode(message, name))
        found.append(path.read_bytes())
    return found


def mcap(mutator):
    """MCAP files."""
    return _read(mutator, _mcaps(), "x.mcap")


def bag(mutator):
    """ROS 1 bags."""
    return _read(mutator, _bags(), "x.bag")


@cache
def _ulogs():
    nested = UlogTopic(3, "status", "uint64_t timestamp; bool on; float[2] x")
    plain = UlogTopic(4, "plain", "uint8_t n; uint64_t timestamp; double d")
    report = ulog_message("F", b"report:uint64_t timestamp;status[2] inner;uint8_t[3] _padding0;")
    head = [header(5), report, nested.definition(), nested.subscription()]
    head += [plain.definition(), plain.subscription(), text_info("sys_name", "fuzz")]
    head.append(ulog_message("A", b"\x01\x05\x00report"))
    data = []
    for k in range(6):
        data += [nested.sample((k, True, 1.0, 2.0)), plain.sample((k, 10 * k, 0.5))]
        data.append(ulog_message("D", b"\x05\x00" + bytes(8 + 2 * 17)))
        data.append(logged_text(4, k, "text"))
    whole = b"".join(head + data)
    return [whole, whole[:-5]]


def ulog_message(kind, payload):
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def ulog(mutator):
    """Logs of PX4."""
    path, seeds = path_of("x.ulg"), _ulogs()
    path.write_bytes(seeds[0][:16] + mutator.bytes(seeds)[16:])
    with contextlib.suppress(RecordingError):
        source = UlogSource(path)
        records = source.records(source.topics.keys(), 0, 1 << 62)
        found = Counter(record.topic.topic for record in records)
        assert found == {name: topic.messages for name, topic in source.topics.items()}
    return 1


def _read(mutator, seeds, name):
    path = path_of(name)
    data = mutator.bytes(seeds)
    path.write_bytes(mutator.pick(seeds)[:_SHORTEST] + data[_SHORTEST:])
    out = path.with_name(f"out-{name}")
    out.unlink(missing_ok=True)
    decoder, walk = LogDecoder(), LogWalk(path)
    with contextlib.suppress(RecordingError):
        for record in walk:
            if record.topic.msgtype in (STRING, TWIST):  # others would be learnt for ever
                with contextlib.suppress(GraphError):
                    decoder.decode(record)
    with contextlib.suppress(RecordingError):
        summary = summarize(path)
        assert summary.messages >= 0
    with contextlib.suppress(RecordingError):
        recovery = recover(path, out)
        assert summarize(out).messages == recovery.messages
    return 1
