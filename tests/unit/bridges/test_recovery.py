from __future__ import annotations

import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.records import LogWalk
from volery.bridges.logs.recovery import recover, recovered_name
from volery.core.errors import RecordingError
from volery.graph.messages import Published
from volery.graph.typestore import typestore

Flight = Callable[[float], list[Published]]
FORMATS = [".mcap", ".bag"]


def cut(path: Path, messages: list[Published], keep: float) -> int:
    """Record, then keep only a fraction of the file's bytes; returns the number recorded."""
    log = create_log(path, compression="none")
    for k, message in enumerate(messages):
        log.write(message)
        if k % 100 == 99:
            log.flush()
    log.close()
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * keep)])
    return len(messages)


def walked(path: Path) -> LogWalk:
    walk = LogWalk(path)
    for _ in walk:
        pass
    return walk


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("keep", [0.999, 0.7, 0.3])
def test_recovered_log_is_whole(tmp_path: Path, flight: Flight, suffix: str, keep: float) -> None:
    path = tmp_path / f"flight{suffix}"
    total = cut(path, flight(2.0), keep)
    left = summarize(path)
    assert "cut off" in left.problem
    assert total * keep * 0.6 <= left.messages <= total
    recovery = recover(path)
    assert recovery.path == recovered_name(path) == tmp_path / f"flight.recovered{suffix}"
    assert recovery.messages == left.messages
    whole = summarize(recovery.path)
    assert whole.problem == ""
    assert whole.topics == left.topics
    assert (whole.start_ns, whole.end_ns) == (left.start_ns, left.end_ns)
    with AnyReader([recovery.path], default_typestore=typestore()) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_cut_is_survived(tmp_path: Path, flight: Flight, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    cut(path, flight(0.3), 1.0)
    data = path.read_bytes()
    for length in range(len(data) - 1, 0, -997):
        path.write_bytes(data[:length])
        try:
            summary = summarize(path)
        except RecordingError:
            assert length < 20
        else:
            assert summary.problem


@pytest.mark.parametrize("suffix", FORMATS)
def test_damaged_chunk_is_left_out(tmp_path: Path, flight: Flight, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    log = create_log(path)
    sizes = []
    for k, message in enumerate(flight(1.0)):
        log.write(message)
        if k % 100 == 99:
            log.flush()
            sizes.append(path.stat().st_size)
    log.abort()
    data = bytearray(path.read_bytes())
    middle = (sizes[0] + sizes[1]) // 2
    data[middle : middle + 2000] = bytes(2000)
    path.write_bytes(data)
    summary = summarize(path)
    assert "1 damaged chunk left out" in summary.problem
    assert summary.messages == 300


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_stub_is_refused_and_nothing_written(tmp_path: Path, flight: Flight, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    cut(path, flight(0.2), 1.0)
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(RecordingError, match=r"holds no readable message.*nothing is written"):
        recover(path)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", FORMATS)
def test_existing_target_is_kept(tmp_path: Path, flight: Flight, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    cut(path, flight(0.2), 0.9)
    with pytest.raises(RecordingError, match="exists already"):
        recover(path, path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"hello, I am no log at all", "neither an MCAP log nor a ROS 1 bag"),
        (b"#ROSBAG V1.2\n....", "neither"),
    ],
)
def test_no_log(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(content)
    for job in (summarize, recover):
        with pytest.raises(RecordingError, match=message):
            job(path)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(RecordingError, match="cannot read the log"):
            summarize(path)


def test_a_length_that_lies_claims_no_memory(tmp_path: Path, flight: Flight) -> None:
    path = tmp_path / "flight.bag"
    cut(path, flight(0.2), 1.0)
    with path.open("ab") as file:
        file.write(struct.pack("<I", 0xFFFFFFF0) + b"x")
    tracemalloc.start()
    try:
        assert "cut off" in walked(path).problem
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()
