"""Any position of a log at once, held against a plain walk from its beginning."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter

from volery.bridges.logs import log_writer as bag_module
from volery.bridges.logs.log_formats import open_chunks
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.records import LogWalk
from volery.bridges.logs.timeline import Timeline, TimelinePosition
from volery.core.errors import RecordingError
from volery.graph import messages as m

JUMP_NS = 100_000_000
FORMATS = [".mcap", ".bag"]


def write(path, entries, chunk_every=7, end=True):
    """A log of (topic, ms) with a chunk each so many messages."""
    log = create_log(path, overwrite=True)
    for k, (topic, ms) in enumerate(entries):
        log.write(m.Published(topic, "std_msgs/msg/String", ms * 1_000_000, m.String(f"no {k}")))
        if k % chunk_every == chunk_every - 1:
            log.flush()
    if end:
        log.close()
    else:
        log.flush()
        log.abort()
    return path


def everything(log):
    line = Timeline(log)
    position, found, over = TimelinePosition(0, 0), [], False
    while not over:
        shown, position, over = line.take(position, 1 << 61, set(log.topics))
        found += shown
    return found


def walked(path):
    return [(r.topic.topic, r.time_ns, r.data, r.sequence) for r in LogWalk(path)]


def fields_of(shown):
    return [
        (s.record.topic.topic, s.record.time_ns, s.record.data, s.record.sequence) for s in shown
    ]


def on_the_line(times_ns):
    """Times with all jumps back taken out, one after the other."""
    shift, front, line = 0, -(1 << 62), []
    for t in times_ns:
        if t < front - JUMP_NS:
            shift, front = shift + front - t, t
        front = max(front, t)
        line.append(t + shift)
    return line


QUICK = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
TOPICS = st.sampled_from(["/a", "/b", "/rare"])
ENTRIES = st.lists(st.tuples(TOPICS, st.integers(1, 2000)), min_size=1, max_size=60)
ALMOST_SORTED = st.lists(st.tuples(TOPICS, st.integers(-30, 200)), min_size=1, max_size=60).map(
    lambda steps: [
        (topic, int(t) + 100)
        for (topic, _), t in zip(steps, np.cumsum([d for _, d in steps]).clip(0), strict=True)
    ]
)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("end", [True, False])
@QUICK
@given(entries=ENTRIES | ALMOST_SORTED, chunk_every=st.integers(1, 20))
def test_the_line_is_that_of_a_walk(tmp_path, suffix, end, entries, chunk_every):
    path = write(tmp_path / f"x{suffix}", entries, chunk_every, end)
    log = open_chunks(path)
    found = everything(log)
    assert fields_of(found) == walked(path)
    expected = on_the_line([ms * 1_000_000 for _, ms in entries])
    assert [s.time_ns for s in found] == expected
    line = Timeline(log)
    assert (line.start_ns, line.end_ns) == (min(expected), max(expected))
    assert bool(log.problem) is not end
    log.close()


@pytest.mark.parametrize("suffix", FORMATS)
@QUICK
@given(entries=ENTRIES | ALMOST_SORTED, chunk_every=st.integers(1, 20), at=st.floats(0.0, 1.1))
def test_any_time_is_found(tmp_path, suffix, entries, chunk_every, at):
    log = open_chunks(write(tmp_path / f"x{suffix}", entries, chunk_every))
    line, found = Timeline(log), everything(log)
    t = line.start_ns + int((line.end_ns - line.start_ns) * at)
    position = line.after(t)
    later = next((k for k, s in enumerate(found) if s.time_ns > t), len(found))
    shown = line.take(position, 1 << 61, set(log.topics)).shown
    assert fields_of(shown[:1]) == fields_of(found[later : later + 1])
    last = {s.channel: s for s in found[:later]}
    assert fields_of(line.last_before(position, set(log.topics))) == fields_of(
        sorted(last.values(), key=found.index)
    )
    since = t - 250_000_000
    rare = {channel for channel, topic in log.topics.items() if topic.topic == "/rare"}
    assert fields_of(line.since(position, since, rare)) == fields_of(
        [s for s in found[:later] if s.channel in rare and s.time_ns > since]
    )
    log.close()


@pytest.mark.parametrize("suffix", FORMATS)
def test_logs_cut_off_anywhere_are_read_as_far_as_they_go(tmp_path, suffix):
    whole = write(tmp_path / f"whole{suffix}", [("/a", k) for k in range(60)]).read_bytes()
    path = tmp_path / f"cut{suffix}"
    lengths = set()
    for size in (*range(14, len(whole), 37), *range(len(whole) - 150, len(whole))):
        path.write_bytes(whole[:size])
        log = open_chunks(path)
        assert log.problem
        found = everything(log)
        assert fields_of(found) == walked(path)
        lengths.add(len(found))
        log.close()
    assert len(lengths) > 5


@pytest.mark.parametrize("suffix", FORMATS)
def test_damaged_chunks_are_left_out(tmp_path, suffix):
    path = write(tmp_path / f"x{suffix}", [("/a", k) for k in range(60)], chunk_every=20)
    data = bytearray(path.read_bytes())
    log = open_chunks(path)
    span = log.chunks[1].span
    log.close()
    middle = span.position + span.length // 2
    data[middle : middle + 8] = b"\xff" * 8
    path.write_bytes(data)
    log = open_chunks(path)
    assert len(everything(log)) == len(walked(path)) == 40
    assert log.damaged == 1
    log.close()


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("indexed", [True, False])
def test_mcap_files_of_others(tmp_path, compression, chunked, indexed):
    file = io.BytesIO()
    options = {"use_chunking": chunked, "chunk_size": 500, "compression": compression}
    if not indexed:
        from mcap.writer import IndexType

        options["index_types"] = IndexType.NONE
    writer = Writer(file, **options)
    writer.start()
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    channels = [writer.register_channel(f"/{k}", "cdr", schema) for k in range(3)]
    for k in range(200):
        data = m.Published("/x", "std_msgs/msg/String", 0, m.String(str(k))).cdr
        writer.add_message(channels[k % 3], k * 1000, data, k * 1000, k)
    writer.finish()
    path = tmp_path / "x.mcap"
    path.write_bytes(file.getvalue())
    log = open_chunks(path)
    assert fields_of(everything(log)) == walked(path)
    assert sum(log.counts().values()) == 200
    assert not log.problem
    log.close()


def test_a_bag_of_others(tmp_path):
    path = tmp_path / "x.bag"
    with BagWriter(path) as writer:
        writer.chunk_threshold = 300
        connection = writer.add_connection(
            "/a", "std_msgs/msg/String", msgdef="string data", md5sum="0" * 32
        )
        for k in range(100):
            writer.write(connection, k * 1000, b"\x01\0\0\0x")
    log = open_chunks(path)
    assert fields_of(everything(log)) == walked(path)
    assert len(log.chunks) > 3
    log.close()


def test_what_is_no_log(tmp_path):
    with pytest.raises(RecordingError, match="cannot read"):
        open_chunks(tmp_path / "none.mcap")
    path = tmp_path / "x.mcap"
    for data, reason in ((b"", "empty"), (b"something else entirely", "neither")):
        path.write_bytes(data)
        with pytest.raises(RecordingError, match=reason):
            open_chunks(path)
    path.write_bytes(b"\x89MCAP0\r\n" + bytes(range(200)))
    log = open_chunks(path)
    assert everything(log) == []
    log.close()


def test_a_long_log_is_open_everywhere_at_once(tmp_path, monkeypatch):
    """64 MB in chunks of 1 MB: each leap reads a chunk or two."""
    monkeypatch.setattr(bag_module, "CHUNK_WALL_S", 1e9)
    log = create_log(tmp_path / "long.mcap", compression="none")
    noise = np.random.default_rng(1).integers(0, 256, 8192, dtype=np.uint8).tobytes().hex()
    for k in range(4000):
        log.write(m.Published("/a", "std_msgs/msg/String", k * 10_000_000, m.String(noise)))
    log.close()
    opened = time.process_time()
    chunks = open_chunks(tmp_path / "long.mcap")
    line = Timeline(chunks)
    assert time.process_time() - opened < 0.5
    assert len(chunks.chunks) > 50
    read = []
    monkeypatch.setattr(
        chunks, "_parse", lambda data, real=chunks._parse: read.append(1) or real(data)
    )
    for second in (31.0, 3.0, 39.0, 17.0):
        (last,) = line.last_before(line.after(int(second * 1e9)), set(chunks.topics))
        assert last.time_ns == second * 1e9
    assert len(read) <= 8
    chunks.close()
