"""Debian's rosbag reads the bags that runs record."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from filling import filled
from ros1_bench import (
    HERE,
    SYSTEM_PYTHON,
    Program,
    peer,
    require_ros1,
    running,
    shared_master,
    tool,
)

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recovery import recover
from volery.graph.messages import Published, String, Time, message_type
from volery.graph.typestore import typestore

require_ros1()

STRING = "std_msgs/msg/String"
Duration = message_type("builtin_interfaces/msg/Duration")
TYPES = [name for name in typestore().names() if "/msg/" in name]
NOT_IN_ROS1 = ("builtin_interfaces/",)
"""Packages without messages of their own in ROS 1: they are its basic types."""
TEXT = "the same words again and again, so that blocks of LZ4 refer to earlier ones " * 20


def record(path, messages, *, whole=True):
    """Writes a bag; whole: with its index."""
    log = create_log(path)
    for k, (topic, msgtype, message) in enumerate(messages):
        log.write(Published(topic, msgtype, 10**9 + k * 10**6, message))
    log.flush()
    if whole:
        log.close()
    else:
        log.abort()


def read(path):
    """Type, number of messages and whether they are the recorded bytes, by topic."""
    with Program(SYSTEM_PYTHON, str(HERE / "bag_reader.py"), str(path)) as program:
        return program.next()


def with_valid_times(value):
    """ROS 1 reads other times, too, but rewrites them."""
    if isinstance(value, list):
        return [with_valid_times(item) for item in value]
    if isinstance(value, Time | Duration):
        return type(value)(abs(value.sec), value.nanosec % 10**9)
    if not dataclasses.is_dataclass(value):
        return value
    fields = [field.name for field in dataclasses.fields(value) if field.init]
    return type(value)(*[with_valid_times(getattr(value, name)) for name in fields])


def words(count):
    return [("/words", STRING, String(f"{k} {TEXT}")) for k in range(count)]


@pytest.mark.parametrize("count", [1, 3000])
def test_rosbag_reads_every_message(tmp_path, count):
    """One in a small chunk; some megabytes in several chunks of many blocks."""
    record(tmp_path / "run.bag", words(count))
    assert "does not need any migrations" in tool("rosbag", "check", str(tmp_path / "run.bag"))
    assert read(tmp_path / "run.bag") == {"/words": ["std_msgs/String", count, True]}


def test_rosbag_knows_messages_of_every_type(tmp_path):
    """Each with the definition and the sum that the bag gives, and with the recorded content."""
    rng = np.random.default_rng(5)
    kinds = [name for name in TYPES if not name.startswith(NOT_IN_ROS1)]
    record(
        tmp_path / "run.bag",
        [
            (f"/{name.replace('/', '_')}", name, with_valid_times(filled(name, rng)))
            for name in kinds
        ],
    )
    assert read(tmp_path / "run.bag") == {
        f"/{name.replace('/', '_')}": [name.replace("/msg/", "/"), 1, True] for name in kinds
    }


def test_rosbag_reads_what_was_recovered(tmp_path):
    record(tmp_path / "cut.bag", words(1000), whole=False)
    recovered = recover(tmp_path / "cut.bag")
    assert read(recovered.path) == {"/words": ["std_msgs/String", 1000, True]}


def test_rosbag_plays_a_bag(tmp_path):
    shared_master()
    record(tmp_path / "run.bag", words(200))
    with peer("listen", "/words", "--count=200") as listener:
        assert listener.next() == "ready"
        # It drops what does not fit into its queue, and at its end what has not been sent.
        options = ("--wait-for-subscribers", "--queue=1000", "--keep-alive")
        with running("rosbag", "play", *options, str(tmp_path / "run.bag")):
            received = [listener.next()[0] for _ in range(200)]
    assert received == [f"{k} {TEXT}"[:100] for k in range(200)]
