"""`byte` is a signed number in ROS 1, where it is int8, and an octet in ROS 2; `char` is uint8."""

from __future__ import annotations

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.replay import Replay
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.logs import open_log

STATE = "my_robot/msg/State"
FIELDS = "byte b\nbyte[] some\nbyte[2] two\nchar c\nchar[] text\nint8 i\nuint8 u\n"
ROS1 = f"byte LOW=-1\nchar HIGH=200\n{FIELDS}"
IDL = """IDL: my_robot/msg/State
module my_robot { module msg {
  typedef octet octet__2[2];
  struct State {
    octet b; sequence<octet> some; octet__2 two; uint8 c; sequence<uint8> text; int8 i; uint8 u;
  };
}; };
"""
BYTES = [-1, 127, -128]
"""0xff, 0x7f, 0x80."""


def messages(state):
    for k, value in enumerate(BYTES):
        some = np.array(BYTES[: k + 1], np.int8)
        text = np.array([200, k], np.uint8)
        yield state(value, some, np.array([value, 1], np.int8), 200, text, value, 200)


def write(path, kind):
    """Writes the messages as a ROS 1 bag, or as CDR or ROS 1 bytes in an MCAP file."""
    is_ros1 = kind in ("bag", "ros1msg")
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(ROS1 if is_ros1 else FIELDS, STATE))
    encode = store.serialize_ros1 if is_ros1 else store.serialize_cdr
    data = [bytes(encode(message, STATE)) for message in messages(store.types[STATE])]
    if kind == "bag":
        with Writer(path) as writer:
            channel = writer.add_connection("/state", STATE, typestore=store)
            for k, each in enumerate(data):
                writer.write(channel, k, each)
        return path
    with path.open("wb") as file:
        mcap = McapWriter(file)
        mcap.start()
        text = {"ros1msg": ROS1, "ros2msg": FIELDS, "ros2idl": IDL}[kind]
        name = "my_robot/State" if is_ros1 else STATE
        schema = mcap.register_schema(name, kind, text.encode())
        channel = mcap.register_channel("/state", "ros1" if is_ros1 else "cdr", schema)
        for k, each in enumerate(data):
            mcap.add_message(channel, k, each, k)
        mcap.finish()
    return path


@pytest.mark.parametrize("kind", ["bag", "ros1msg", "ros2msg", "ros2idl"])
def test_columns_have_the_values_of_their_generation(tmp_path, kind):
    dtype = np.int8 if kind in ("bag", "ros1msg") else np.uint8
    values = np.array(BYTES, np.int8).view(dtype)
    with open_log(write(tmp_path / f"a.{'bag' if kind == 'bag' else 'mcap'}", kind)) as log:
        assert log.problem == ""
        data = log["/state"]
        assert data.refused == 0
        assert (data["b"].dtype, data["b"].tolist()) == (dtype, values.tolist())
        assert [some.tolist() for some in data["some"]] == [values[:k].tolist() for k in (1, 2, 3)]
        assert {some.dtype for some in data["some"]} == {np.dtype(dtype)}
        assert (data["two"].dtype, data["two"].tolist()) == (dtype, [[v, 1] for v in values])
        assert (data["c"].tolist(), data["c"].dtype) == ([200] * 3, np.uint8)
        assert data["text"].tolist() == [[200, k] for k in range(3)]
        assert (data["i"].tolist(), data["u"].tolist()) == (BYTES, [200] * 3)
        table = data.to_pandas()
        assert table["b"].tolist() == values.tolist()
        assert table.to_csv().splitlines()[1].startswith(f"0.0,{values[0]},[{values[0]}],")
        assert data.padded("some", 0).tolist()[2] == values.tolist()
        message = next(data.messages()).message
        if kind in ("bag", "ros1msg"):
            assert (type(message).LOW, type(message).HIGH, message.b) == (-1, 200, -1)


class Timers:
    """A clock that goes on to the next time that is due."""

    def __init__(self):
        self.now_ns = 0
        self._due = []

    def at(self, time_ns, action):
        self._due.append((time_ns, action))

    def run(self, graph):
        while self._due:
            time_ns, action = self._due.pop(0)
            self.now_ns = max(self.now_ns, time_ns)
            action()
            graph.deliver()


def test_a_bag_with_negative_bytes_is_replayed(tmp_path):
    timers, received = Timers(), []
    graph = Graph(lambda: timers.now_ns)
    graph.subscribe_all(received.append)
    Replay(write(tmp_path / "a.bag", "bag")).start(graph, timers, lambda: timers.now_ns)
    timers.run(graph)
    assert [(p.message.b, p.message.two.tolist()) for p in received] == [(v, [v, 1]) for v in BYTES]
    assert [p.cdr[4] for p in received] == [0xFF, 0x7F, 0x80]


def test_a_graph_records_and_reads_bytes_of_either_generation(tmp_path):
    """Octets of ROS 2 become signed in a log of ROS 1, as its int8 has the same bits."""
    first = write(tmp_path / "first.mcap", "ros2msg")
    for suffix, dtype in ((".mcap", np.uint8), (".bag", np.int8)):
        copy = create_log(tmp_path / f"copy{suffix}")
        with open_log(first) as log:
            for at in log.messages():
                copy.write(Published(at.topic, STATE, at.time_ns, at.message))
        copy.close()
        with open_log(copy.path) as log:
            assert log["/state"]["b"].tolist() == np.array(BYTES, np.int8).view(dtype).tolist()
