from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery.bridges.logs import log_writer
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.reader import summarize
from volery.core.errors import RecordingError
from volery.graph.messages import Published
from volery.graph.typestore import typestore

Flight = Callable[[float], list[Published]]
FORMATS = [".mcap", ".bag"]


def record(path: Path, messages: list[Published]) -> None:
    log = create_log(path)
    for message in messages:
        log.write(message)
    log.close()


def test_mcap_opens_as_foxglove_wants_it(tmp_path: Path, flight: Flight) -> None:
    messages = flight(2.0)
    path = tmp_path / "flight.mcap"
    record(path, messages)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(messages)
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count >= 1
        schemas = {s.name: s for s in summary.schemas.values()}
        assert set(schemas) == {p.msgtype for p in messages}
        for schema in schemas.values():
            assert schema.encoding == "ros2msg"
        text = schemas["nav_msgs/msg/Odometry"].data.decode()
        # every nested definition, each once, in the form of ros2msg
        for nested in (
            "geometry_msgs/PoseWithCovariance",
            "std_msgs/Header",
            "geometry_msgs/Point",
        ):
            assert text.count(f"\nMSG: {nested}\n") == 1
        assert all(c.message_encoding == "cdr" for c in summary.channels.values())
        stored = [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]
    assert Counter(stored) == Counter((p.topic, p.time_ns, p.cdr) for p in messages)


def test_mcap_schemas_suffice_to_decode(tmp_path: Path, flight: Flight) -> None:
    """A reader that knows no types but those in the file gets our messages back."""
    messages = flight(0.2)
    path = tmp_path / "flight.mcap"
    record(path, messages)
    expected = [p.message for p in messages if p.topic == "/uav1/laser/horizontal/scan"]
    with path.open("rb") as file:
        found = list(make_reader(file).iter_messages(topics=["/uav1/laser/horizontal/scan"]))
    store = get_typestore(Stores.EMPTY)
    for schema, _, _ in found[:1]:
        assert schema is not None
        store.register(get_types_from_msg(schema.data.decode(), schema.name))
    for want, (_, _, raw) in zip(expected, found, strict=True):
        got = store.deserialize_cdr(raw.data, "sensor_msgs/msg/LaserScan")
        np.testing.assert_array_equal(got.ranges, want.ranges)  # type: ignore[attr-defined]
        assert got.header.stamp.nanosec == want.header.stamp.nanosec  # type: ignore[attr-defined]


def test_bag_holds_ros1_messages(tmp_path: Path, flight: Flight) -> None:
    messages = flight(0.5)
    path = tmp_path / "flight.bag"
    record(path, messages)
    ros1 = get_typestore(Stores.ROS1_NOETIC)
    with Reader(path) as reader:
        md5 = {c.msgtype: c.digest for c in reader.connections}
        raw = [(c.topic, c.msgtype, t, bytes(d)) for c, t, d in reader.messages()]
    # md5 sums as ROS 1 itself prints them with `rosmsg md5`
    assert md5["sensor_msgs/msg/LaserScan"] == "90c7ef2dc6895d81024acba2ac42f369"
    assert md5["sensor_msgs/msg/Range"] == "c005c34273dc426c67a020a87bc24148"
    assert md5["sensor_msgs/msg/Imu"] == "6a62c6daae103f4ff57a132d6f95cec2"
    assert md5["nav_msgs/msg/Odometry"] == "cd5e73d190d741a2f92e81eda573aca7"
    assert md5["tf2_msgs/msg/TFMessage"] == "94810edda583a504dfda3829e70d7eec"
    assert md5["rosgraph_msgs/msg/Clock"] == "a9c97c1d230cfc112e270351a944ee47"
    assert Counter((t, s) for t, _, s, _ in raw) == Counter((p.topic, p.time_ns) for p in messages)
    scans = [d for t, _, _, d in raw if t == "/uav1/laser/horizontal/scan"]
    wanted = [p.message for p in messages if p.topic == "/uav1/laser/horizontal/scan"]
    for k, (data, want) in enumerate(zip(scans, wanted, strict=True)):
        got = ros1.deserialize_ros1(data, "sensor_msgs/msg/LaserScan")
        assert got.header.seq == k  # type: ignore[attr-defined]
        np.testing.assert_array_equal(got.ranges, want.ranges)  # type: ignore[attr-defined]
    ranges = [d for t, _, _, d in raw if t == "/uav1/range"]
    assert ros1.deserialize_ros1(ranges[0], "sensor_msgs/msg/Range").range == 2.5  # type: ignore[attr-defined]


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_message_decodes_with_rosbags(tmp_path: Path, flight: Flight, suffix: str) -> None:
    messages = flight(0.2)
    path = tmp_path / f"flight{suffix}"
    record(path, messages)
    with AnyReader([path], default_typestore=typestore()) as reader:
        decoded = [reader.deserialize(d, c.msgtype) for c, _, d in reader.messages()]
    assert len(decoded) == len(messages)


@pytest.mark.parametrize("suffix", FORMATS)
def test_summary(tmp_path: Path, flight: Flight, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    record(path, flight(2.0))
    summary = summarize(path)
    assert summary.problem == ""
    assert summary.messages == 800
    assert (summary.start_ns, summary.end_ns) == (0, 1_975_000_000)
    scan = next(t for t in summary.topics if t.topic == "/uav1/laser/horizontal/scan")
    assert scan.messages == 80
    assert scan.msgtype == "sensor_msgs/msg/LaserScan"
    assert scan.rate_hz == pytest.approx(40.0)


def test_a_topic_without_messages_has_no_rate(tmp_path: Path) -> None:
    """As recorders of ROS 2 leave them."""
    path = tmp_path / "silent.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        _, channel = (writer.register_channel(name, "cdr", schema) for name in ("/a", "/b"))
        for k in range(11):
            writer.add_message(channel, k * 10**8, b"", k * 10**8)
        writer.finish()
    assert {t.topic: t.rate_hz for t in summarize(path).topics} == {"/a": 0.0, "/b": 10.0}


@pytest.mark.parametrize("suffix", FORMATS)
def test_empty_run_gives_a_whole_log(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    record(path, [])
    summary = summarize(path)
    assert (summary.messages, summary.problem) == (0, "")


@pytest.mark.parametrize("name", ["flight.txt", "flight", "flight.db3"])
def test_unknown_suffix(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordingError, match=r"\.mcap .*\.bag"):
        create_log(tmp_path / name)


@pytest.mark.parametrize("suffix", FORMATS)
def test_existing_file_is_kept(tmp_path: Path, flight: Flight, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    path.write_bytes(b"precious")
    with pytest.raises(RecordingError, match="exists already"):
        create_log(path)
    assert path.read_bytes() == b"precious"
    create_log(path, overwrite=True).close()
    assert summarize(path).messages == 0


@pytest.mark.parametrize("suffix", FORMATS)
def test_folder_that_cannot_be_made(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot create the log"):
        create_log(tmp_path / "file" / f"flight{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(RecordingError, match="folder"):
        create_log(tmp_path / f"folder{suffix}")


@pytest.mark.parametrize("suffix", FORMATS)
def test_unfinished_log_is_readable_up_to_its_last_chunk(
    tmp_path: Path, flight: Flight, suffix: str
) -> None:
    path = tmp_path / f"flight{suffix}"
    log = create_log(path)
    messages = flight(2.0)
    for message in messages[:400]:
        log.write(message)
    log.flush()
    for message in messages[400:500]:
        log.write(message)
    log.abort()
    summary = summarize(path)
    assert summary.messages == 400
    assert "cut off" in summary.problem


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_chunk_is_closed_after_a_while(
    tmp_path: Path, flight: Flight, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"flight{suffix}"
    log = create_log(path)
    first, second = flight(0.1)[:2]
    log.write(first)
    before = path.stat().st_size
    later = time.monotonic() + 3.0
    monkeypatch.setattr(log_writer.time, "monotonic", lambda: later)
    log.write(second)
    assert path.stat().st_size > before
    log.abort()
    assert summarize(path).messages == 2


@pytest.mark.parametrize("suffix", FORMATS)
def test_full_disk(
    tmp_path: Path, flight: Flight, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"flight{suffix}"
    log = create_log(path)
    messages = flight(1.0)
    for message in messages[:200]:
        log.write(message)
    log.flush()
    size = path.stat().st_size
    true_pwrite = os.pwrite

    def full(descriptor: int, data: bytes, offset: int) -> int:
        if offset > size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return true_pwrite(descriptor, bytes(data)[:1000], offset)

    monkeypatch.setattr(os, "pwrite", full)
    for message in messages[200:]:
        log.write(message)
    with pytest.raises(RecordingError, match=rf"flight\{suffix}.*No space left on device"):
        log.flush()
    log.close()
    assert path.stat().st_size == size
    assert summarize(path).messages == log.messages == 200


@pytest.mark.parametrize("suffix", FORMATS)
def test_file_size_limit_stops_the_run_with_one_error(
    tmp_path: Path, flight: Flight, suffix: str
) -> None:
    path = tmp_path / f"flight{suffix}"
    log = create_log(path)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_500_000, hard))
    try:
        with pytest.raises(RecordingError, match="File too large") as first:  # noqa: PT012
            for message in flight(30.0):
                log.write(message)
        with pytest.raises(RecordingError) as again:
            log.write(flight(0.1)[0])
        assert again.value is first.value
        log.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)
    summary = summarize(path)
    assert summary.messages == log.messages > 100
    assert "cut off" in summary.problem


@pytest.mark.parametrize("suffix", FORMATS)
def test_messages_are_those_that_can_be_read(
    tmp_path: Path, flight: Flight, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("volery.bridges.logs.log_writer.CHUNK_WALL_S", float("inf"))
    log = create_log(tmp_path / f"flight{suffix}")
    counts = []
    for message in flight(10.0):
        log.write(message)
        counts.append(log.messages)
    log.close()
    assert counts[0] == 0
    assert 0 < counts[-1] < len(counts)  # a chunk of a megabyte is written, the rest is not yet
    assert log.messages == summarize(log.path).messages == len(counts)


KILLED = """
import sys, time
sys.path[:0] = sys.argv[2:]
from conftest import make_flight
from volery.bridges.logs.log_writer import create_log
log = create_log(sys.argv[1])
messages = make_flight(20.0)
for message in messages:
    log.write(message)
print("written", flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("suffix", FORMATS)
def test_killed_run_leaves_whole_chunks(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    here = Path(__file__)
    command = [sys.executable, "-c", KILLED, path, here.parent, here.parents[2]]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "written\n"
        process.kill()
    assert process.returncode == -signal.SIGKILL
    summary = summarize(path)
    assert "cut off" in summary.problem
    # 8000 messages of 5 MB in all: at most the last megabyte is lost
    assert summary.messages > 5500
    assert summary.start_ns == 0
