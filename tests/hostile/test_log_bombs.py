"""Logs that unpack without end, describe more than there is, or define endless messages."""

from __future__ import annotations

import bz2
import os
import sqlite3
import struct
import tracemalloc
import zlib
from contextlib import closing
from functools import cache

import lz4.frame
import pytest
import zstandard

from volery.bridges.logs import budgets, content, decoding, mcap_format, recordings_quota, unpacking
from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.playback import Playback
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.recorded_flight import read_flight
from volery.bridges.logs.records import BAG_MAGIC, MCAP_MAGIC, LogRecord, LogTopic, LogWalk
from volery.bridges.logs.recovery import recover
from volery.core.errors import GraphError, RecordingError
from volery.graph.codecs import definition_store
from volery.graph.graph import Graph
from volery.graph.messages import Published, String
from volery.logs import open_log
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.replay.slam.sources import open_source
from volery.runtime.services.recording import RecordingServices
from volery.server import log_check
from volery.server.bounded_process import BoundedError, ProcessBounds, run_bounded

CHUNK = 4 << 20
"""Bound of a chunk in these tests, in the place of 256 MiB."""
BOMB = 40 << 20

MAKERS = {
    "lz4": lz4.frame.compress,
    "zstd": zstandard.compress,
    "bz2": bz2.compress,
}


def mcap_record(opcode, body):
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value):
    return struct.pack("<I", len(value)) + value


def mcap_chunk(compression, packed, size, crc=0):
    head = struct.pack("<QQQI", 0, 0, size, crc) + text(compression.encode())
    return mcap_record(6, head + struct.pack("<Q", len(packed)) + packed)


def mcap_schema(number, definition, name=b"a/msg/B"):
    body = text(name) + text(b"ros2msg") + text(definition)
    return mcap_record(3, struct.pack("<H", number) + body)


def mcap_channel(number, schema=0, topic=b"/t"):
    body = text(topic) + text(b"cdr") + text(b"")
    return mcap_record(4, struct.pack("<HH", number, schema) + body)


def bag_field(name, value):
    return struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value


def bag_record(data, **fields):
    head = b"".join(bag_field(name.encode(), value) for name, value in fields.items())
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


@cache
def zeros_packed(compression):
    """`BOMB` zeros."""
    return MAKERS[compression](bytes(BOMB))


def bomb(path, compression, stated_size):
    """A file with one chunk that unpacks to `BOMB` zeros, and says so or another size."""
    packed = zeros_packed(compression)
    if path.suffix == ".mcap":
        path.write_bytes(MCAP_MAGIC + mcap_chunk(compression, packed, stated_size))
    else:
        size = struct.pack("<I", stated_size)
        chunk = bag_record(packed, op=b"\x05", compression=compression.encode(), size=size)
        path.write_bytes(BAG_MAGIC + chunk)
    assert path.stat().st_size < BOMB // 100


@pytest.fixture
def small_chunks(monkeypatch):
    for module in (budgets, unpacking):
        monkeypatch.setattr(module, "MAX_CHUNK_BYTES", CHUNK)


def peak_of(job):
    """Bytes that a job takes at most; `RecordingError` may end it."""
    tracemalloc.start()
    try:
        job()
    except RecordingError:
        pass
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return peak


def walked(path):
    walk = LogWalk(path)
    for _ in walk:
        pass
    return walk


@pytest.mark.parametrize("stated_size", [BOMB, 1 << 20, 0])
@pytest.mark.parametrize(
    ("suffix", "compression"),
    [(".mcap", "lz4"), (".mcap", "zstd"), (".bag", "lz4"), (".bag", "bz2")],
)
def test_a_chunk_costs_no_more_than_a_chunk_may(
    tmp_path, small_chunks, suffix, compression, stated_size
):
    """Whether the chunk states its size or lies; a player, a summary and a walk stop there."""
    path = tmp_path / f"bomb{suffix}"
    bomb(path, compression, stated_size)
    for read in (summarize, walked, Playback, read_flight, recover):
        assert peak_of(lambda read=read: read(path)) < 3 * CHUNK, read
    assert "1 damaged chunk left out, at byte" in walked(path).problem
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("compression", [*MAKERS, "none", ""])
def test_a_chunk_is_unpacked_to_the_byte(compression):
    data = bytes(range(256)) * 5000
    packed = MAKERS.get(compression, bytes)(data)
    assert unpacking.unpack(compression, packed, len(data)) == data
    for size in (len(data) - 1, len(data) + 1):
        with pytest.raises(ValueError, match="bytes, not to"):
            unpacking.unpack(compression, packed, size)
    with pytest.raises(ValueError, match=r"not to|damaged"):
        unpacking.unpack(compression, packed[:-100], len(data))


def test_chunks_of_a_hundred_megabytes_are_read(tmp_path):
    """As some recorders write them for images."""
    message = bytes(1_000_000)
    records = [mcap_record(5, struct.pack("<HIQQ", 1, k, k, k) + message) for k in range(100)]
    data = mcap_channel(1) + b"".join(records)
    path = tmp_path / "large.mcap"
    packed = lz4.frame.compress(data)
    path.write_bytes(MCAP_MAGIC + mcap_chunk("lz4", packed, len(data), zlib.crc32(data)))
    walk = LogWalk(path)
    assert sum(1 for _ in walk) == 100
    assert walk.damage.count == 0


def test_many_chunks_cost_no_more_than_a_file_may(tmp_path, monkeypatch):
    """131 KB that would unpack for ever: 1 GiB and 256 times the file's size, then it is left."""
    monkeypatch.setattr(budgets, "_FREE_BYTES", 8 << 20)
    chunk = mcap_chunk("zstd", zstandard.compress(zeros := padding(1 << 20)), len(zeros))
    path = tmp_path / "bomb.mcap"
    path.write_bytes(MCAP_MAGIC + mcap_channel(1) + chunk * 200)
    for read in (summarize, walked, Playback, recover):
        with pytest.raises(RecordingError, match=r"bomb.mcap: unpacks to more than .* GB"):
            read(path)
    assert list(tmp_path.iterdir()) == [path]


def padding(size):
    """A message of channel 1, full of zeros."""
    return mcap_record(5, struct.pack("<HIQQ", 1, 0, 5, 5) + bytes(size))


def test_topics_and_definitions_are_limited(tmp_path, monkeypatch):
    monkeypatch.setattr(budgets, "MAX_TOPICS", 100)
    path = tmp_path / "many.mcap"
    path.write_bytes(MCAP_MAGIC + b"".join(mcap_channel(k) for k in range(300)) + padding(1))
    for read in (summarize, Playback):
        with pytest.raises(RecordingError, match="describes more than 100 topics"):
            read(path)
    definition = b"# " + bytes([32]) * budgets.MAX_DEFINITION_BYTES
    path.write_bytes(MCAP_MAGIC + mcap_schema(1, definition) + mcap_channel(1) + padding(1))
    assert "message definition of 1048" in walked(path).problem


def test_messages_of_a_chunk_are_limited(tmp_path, monkeypatch):
    monkeypatch.setattr(mcap_format, "MAX_CHUNK_MESSAGES", 1000)
    data = padding(0) * 1001
    path = tmp_path / "many.mcap"
    path.write_bytes(MCAP_MAGIC + mcap_channel(1) + mcap_chunk("", data, len(data)))
    assert "more than 1000 messages in one chunk" in walked(path).problem


def test_a_player_keeps_few_large_chunks(tmp_path, monkeypatch):
    from volery.bridges.logs import chunks

    monkeypatch.setattr(chunks, "KEPT_BYTES", 3 << 20)
    data = mcap_chunk("", one := padding(1 << 20), len(one))
    path = tmp_path / "large.mcap"
    path.write_bytes(MCAP_MAGIC + mcap_channel(1) + data * 10)
    playback = Playback(path)
    assert sum(kept.memory_bytes for kept in playback.log._kept.values()) < 4 << 20
    playback.close()
    assert content.Content((), b"12345").memory_bytes == 5


def nested(letter, array, depth):
    """A type within a type within a type."""
    parts = [f"MSG: bombs/{letter}{k}\n{letter}{k + 1}{array} x\n" for k in range(1, depth)]
    last = f"MSG: bombs/{letter}{depth}\nbool b\n"
    return "====\n".join([f"{letter}1{array} x\n", *parts, last])


DEFINITIONS = {
    "unrolled": "\n".join(f"string[4096] text{k}" for k in range(500)),
    "fields": "\n".join(f"bool b{k}" for k in range(6000)),
    "contentless": "Nothing[] many\n====\nMSG: bombs/Nothing\n",
    "deep": nested("L", "", 300),
    "wide": nested("W", "[4000]", 4),
    "itself": "Itself x\n",
    "many": "bool b\n" + "".join(f"====\nMSG: bombs/M{k}\nbool b\n" for k in range(600)),
}  # fmt: skip


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize("kind", DEFINITIONS)
def test_definitions_that_cost_too_much_are_refused(kind, encoding):
    name = f"bombs/msg/{kind.capitalize()}"
    form = "ros1msg" if encoding == "ros1" else "ros2msg"
    topic = LogTopic("/bomb", name, DEFINITIONS[kind], encoding, form)
    with pytest.raises(GraphError):
        LogDecoder().type_of(topic)


def test_types_learned_from_logs_are_limited(monkeypatch):
    monkeypatch.setattr(definition_store, "MAX_FOREIGN", 0)
    topic = LogTopic("/new", "bombs/msg/Harmless", "bool b\n", "cdr", "ros2msg")
    with pytest.raises(GraphError, match="is the limit"):
        LogDecoder().type_of(topic)


def test_a_ros2_bag_of_views_is_refused(tmp_path):
    """Rows without end, of nothing."""
    path = tmp_path / "bomb.db3"
    with closing(sqlite3.connect(path)) as base:
        base.execute(
            "CREATE VIEW messages AS "
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
            "SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(1000000) AS data FROM n"
        )
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        base.commit()
    with pytest.raises(RecordingError, match="'messages' is no plain table"):
        open_source(path)


def test_a_ros2_bag_whose_tables_have_no_readable_names_is_refused(tmp_path):
    path = tmp_path / "damaged.db3"
    with closing(sqlite3.connect(path)) as base:
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY)")
        base.commit()
    data = path.read_bytes().replace(b"messagesmessages", b"mes\xe4agesmessages")
    path.write_bytes(data.replace(b"CREATE TABLE", b"CREATE TABEL"))
    with pytest.raises(RecordingError, match="no bag of ROS 2"):
        open_source(path)


def test_a_compressed_file_of_a_ros2_bag_unpacks_within_the_limits(tmp_path, monkeypatch):
    monkeypatch.setattr(budgets, "_FREE_BYTES", 8 << 20)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "bag_0.db3.zstd").write_bytes(zstandard.compress(bytes(64 << 20)))
    for path in (bag, bag / "bag_0.db3.zstd"):
        with pytest.raises(RecordingError, match="unpacks to more than"):
            open_log(path)
    assert list(tmp_path.iterdir()) == [bag]


def test_a_compressed_message_of_a_ros2_bag_unpacks_within_the_limits(monkeypatch):
    monkeypatch.setattr(decoding, "MAX_CHUNK_BYTES", 1 << 20)
    topic = LogTopic("/bomb", "std_msgs/msg/String", "string data\n", "cdr", "ros2msg")
    small = zstandard.ZstdCompressionParameters(window_log=17)
    data = zstandard.ZstdCompressor(compression_params=small).compress(bytes(64 << 20))
    with pytest.raises(GraphError, match="unpacks to more than 1048576 bytes"):
        LogDecoder().decode(LogRecord(topic, 0, data, 0))


@pytest.mark.parametrize("name", ["../bag_0.db3", "/etc/passwd", "..\\bag_0.db3"])
def test_metadata_of_a_ros2_bag_names_no_file_elsewhere(tmp_path, name):
    folder = tmp_path / "bag"
    folder.mkdir()
    (tmp_path / "bag_0.db3").write_bytes(b"SQLite format 3\0")
    text = f"rosbag2_bagfile_information:\n  relative_file_paths: ['{name}']\n"
    (folder / "metadata.yaml").write_text(text)
    with pytest.raises(RecordingError, match=r"holds no \.mcap and no \.db3 file"):
        open_log(folder)


# ------------------------------------------------------------------------------------- the server


def test_logs_are_looked_into_in_a_process_that_ends(tmp_path, monkeypatch):
    """Past its memory or its time it ends; the page's process only says so."""
    path = tmp_path / "flight.mcap"
    log = create_log(path)
    log.write(Published("/text", "std_msgs/msg/String", 7, String("hello")))
    log.close()
    (tmp_path / "bad.bag").write_bytes(b"no log")
    good, bad = log_check.look_into([path, tmp_path / "bad.bag"])
    assert good == {"seconds": 0.0, "messages": 1, "problem": ""}
    assert "neither an MCAP log" in bad["error"]
    monkeypatch.setattr(log_check, "BOUNDS", ProcessBounds(3 << 30, 60, wall_s=0.05))
    (late,) = log_check.look_into([path], play=True)
    assert "takes too long" in late["error"]


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("bytearray(3 << 30)", "its reader failed"),
        ("all(iter(int, 1)) or [0 for _ in iter(int, 1)]", "long"),
    ],
)
def test_a_child_keeps_to_its_bounds(tmp_path, monkeypatch, program, why):
    module = tmp_path / "greedy_child.py"
    module.write_text(
        "from volery.server.bounded_process import ProcessBounds, bound_this_process\n"
        f"bound_this_process(ProcessBounds(2 << 30, 1, 1))\n{program}\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(BoundedError, match=why):
        run_bounded("greedy_child", (), ProcessBounds(2 << 30, 1, wall_s=120.0))


def test_recordings_are_limited_in_number_and_bytes(tmp_path, monkeypatch):
    for name in ("a.mcap", "b.bag", "c.txt"):
        (tmp_path / name).write_bytes(bytes(1000))
    monkeypatch.setattr(recordings_quota, "MAX_TOTAL_BYTES", 10_000)
    assert recordings_quota.room_left(tmp_path) == 8_000
    monkeypatch.setattr(recordings_quota, "MAX_TOTAL_BYTES", 2_000)
    with pytest.raises(RecordingError, match="the maximum; remove some"):
        recordings_quota.room_left(tmp_path)
    monkeypatch.setattr(recordings_quota, "MAX_RECORDINGS", 2)
    with pytest.raises(RecordingError, match="there are 2 recordings already"):
        recordings_quota.room_left(tmp_path)


def test_a_recording_ends_where_the_folder_is_full(tmp_path, monkeypatch):
    monkeypatch.setattr(recordings_quota, "MAX_TOTAL_BYTES", 100_000)
    graph = Graph(lambda: 0)
    recording = RecordingServices(graph, tmp_path, CommandLog(graph, lambda: (0, 0)))
    recording._start(type("Request", (), {"path": "flight.mcap", "topics": (), "exclude": ()}))
    publisher = graph.advertise("/text", "std_msgs/msg/String")
    for _ in range(30):
        publisher.publish(String(os.urandom(50_000).hex()))
        graph.deliver()
    with pytest.raises(RecordingError, match="the folder for recordings is full"):
        recording._stop(None)
    assert summarize(tmp_path / "flight.mcap").problem == ""
    assert (tmp_path / "flight.mcap").stat().st_size < 2_000_000
