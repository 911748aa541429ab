"""Logs played into a graph: every message, its bytes and its time; damaged logs; positions."""

from __future__ import annotations

import heapq
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recording import Recorder
from volery.bridges.logs.replay import Replay
from volery.core.errors import GraphError, RecordingError
from volery.graph import messages as m
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.graph import Graph
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

FORMATS = [".mcap", ".bag"]
STEP_NS = 1_000_000


class World:
    """A graph, a clock of whole steps, and timers."""

    def __init__(self, start_ns=0):
        self.now_ns = start_ns
        self.graph = Graph(lambda: self.now_ns)
        self.received = []
        self._due = []
        self._added = 0
        self.calls = 0
        self.graph.subscribe_all(self.received.append)

    def at(self, time_ns, action):
        heapq.heappush(self._due, (max(time_ns, self.now_ns), self._added, action))
        self._added += 1

    def run(self, until_ns=None):
        self.graph.deliver()
        while self._due and (until_ns is None or self._due[0][0] <= until_ns):
            due_ns, _, action = heapq.heappop(self._due)
            self.now_ns = max(self.now_ns, -(-due_ns // STEP_NS) * STEP_NS)
            self.calls += 1
            action()
            self.graph.deliver()

    def kept(self):
        return list(self._due)

    def restore(self, now_ns, due):
        self.now_ns, self._due = now_ns, list(due)
        self.received.clear()

    def play(self, path, **options):
        replay = Replay(path, **options)
        replay.start(self.graph, self, lambda: self.now_ns)
        return replay


def fields_of(messages):
    return [(p.topic, p.msgtype, p.time_ns, p.cdr) for p in messages]


def write(path, messages):
    log = create_log(path)
    for message in messages:
        log.write(message)
    log.close()
    return path


def strings(path, *times_ms, topic="/a"):
    def published(k, t):
        return m.Published(topic, "std_msgs/msg/String", t * 1_000_000, m.String(str(k)))

    return write(path, [published(k, t) for k, t in enumerate(times_ms)])


def said(world, topic="/a"):
    return [(p.time_ns // 1_000_000, p.message.data) for p in world.received if p.topic == topic]


@pytest.fixture(scope="module")
def hover():
    """All messages of half a second of a hovering UAV."""
    received = []
    with Simulation(load_scenario("hover"), threads=1) as simulation:
        simulation.graph.subscribe_all(received.append)
        simulation.run(0.5)
    return received


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_recorded_flight_played_into_a_fresh_graph_is_the_same(tmp_path, suffix, hover):
    """Recorded as it flies, read back: topics, types, times, bytes and order."""
    path = tmp_path / f"hover{suffix}"
    with Simulation(load_scenario("hover"), threads=1) as simulation:
        recorder = Recorder(simulation.graph, create_log(path))
        recorder.start()
        simulation.run(0.5)
        recorder.stop()
    world = World()
    replay = world.play(path, exclude=())
    world.run()
    assert len(hover) > 100
    assert {p.topic for p in hover} >= {"/clock", "/uav1/odom", "/uav1/imu", "/tf_static"}
    assert fields_of(world.received) == fields_of(hover)
    info = replay.info
    assert (info.running, info.published, info.skipped) == (False, len(hover), 0)
    assert (info.problem, info.refused, info.laps) == ("", {}, 1)


def test_played_into_a_running_simulation(tmp_path, hover):
    path = write(tmp_path / "hover.mcap", hover)
    received = []
    with Simulation(load_scenario("hover"), threads=1) as simulation:
        simulation.run(0.1)
        began_ns = simulation.time_ns
        replay = Replay(path, topics=("/uav1/imu",), remap={"/uav1/**": "/ghost/**"})
        engine = simulation._engine
        simulation.post(lambda: replay.start(simulation.graph, engine, lambda: engine.time_ns))
        simulation.graph.subscribe("/ghost/imu", received.append, m.Imu)
        simulation.run(0.6)
    recorded = [p for p in hover if p.topic == "/uav1/imu"]
    first_ns = hover[0].time_ns
    assert [p.cdr for p in received] == [p.cdr for p in recorded]
    assert [p.time_ns for p in received] == [p.time_ns - first_ns + began_ns for p in recorded]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({}, [100, 110, 130]),
        ({"rate": 2.0}, [100, 105, 115]),
        ({"rate": 0.5}, [100, 120, 160]),
        ({"offset_s": 0.2}, [300, 310, 330]),
        ({"begin_s": 0.005}, [105, 125]),
        ({"begin_s": 0.005, "rate": 0.5}, [110, 150]),
        ({"topics": "/b"}, []),
        ({"exclude": "/a"}, []),
    ],
)
def test_when_messages_come(tmp_path, options, expected):
    path = strings(tmp_path / "x.mcap", 50, 60, 80)
    world = World(100_000_000)
    world.play(path, **options)
    world.run()
    assert [time for time, _ in said(world)] == expected


def test_messages_of_one_instant_keep_their_order(tmp_path):
    path = strings(tmp_path / "x.mcap", *[7] * 20, *[8] * 20)
    world = World()
    world.play(path)
    world.run()
    assert [text for _, text in said(world)] == [str(k) for k in range(40)]
    assert world.calls == 1


def test_a_message_out_of_order_comes_with_the_one_before(tmp_path):
    path = strings(tmp_path / "x.mcap", 10, 30, 5, 20, 40)
    world = World()
    world.play(path)
    world.run()
    assert said(world) == [(0, "0"), (20, "1"), (20, "2"), (20, "3"), (30, "4")]


def test_round_and_round(tmp_path):
    path = strings(tmp_path / "x.mcap", 50, 60, 70)
    world = World()
    replay = world.play(path, loop=True)
    world.run(95_000_000)
    assert said(world) == [(10 * k, str(k % 3)) for k in range(10)]
    assert replay.info.laps == 3
    replay.stop()
    world.run()
    assert len(said(world)) == 10


@pytest.mark.parametrize("options", [{"topics": "/none"}, {"begin_s": 1.0}])
def test_a_loop_without_messages_ends(tmp_path, options):
    world = World()
    replay = world.play(strings(tmp_path / "x.mcap", 50, 60), loop=True, **options)
    world.run()
    assert not replay.info.running


def test_a_loop_over_one_message_moves_on(tmp_path):
    world = World()
    world.play(strings(tmp_path / "x.mcap", 50), loop=True)
    world.run(10_500_000)
    assert len(said(world)) == 11


@pytest.mark.parametrize("suffix", FORMATS)
def test_static_transforms_await_late_subscribers(tmp_path, hover, suffix):
    path = write(tmp_path / f"hover{suffix}", hover)
    world = World()
    replay = world.play(path, begin_s=0.3)
    world.run()
    late = []
    world.graph.subscribe("/tf_static", late.append, m.TFMessage)
    world.graph.deliver()
    assert late[0].cdr == next(p for p in hover if p.topic == "/tf_static").cdr
    replay.stop()
    assert not world.graph.topics()[0].publishers


def test_a_restored_state_is_played_again(tmp_path):
    """What waits in a snapshot says where to read on, also after the end and before a lap's."""
    path = strings(tmp_path / "x.mcap", *range(0, 100, 10))
    world = World()
    world.play(path, loop=True)
    world.run(35_000_000)
    now_ns, due = world.now_ns, world.kept()
    for end_ns in (55_000_000, 350_000_000):
        world.run(end_ns)
        world.restore(now_ns, due)
        world.run(150_000_000)
        assert said(world) == [(t, str(t // 10 % 10)) for t in range(40, 160, 10)]


def test_one_replay_starts_once(tmp_path):
    world = World()
    replay = world.play(strings(tmp_path / "x.mcap", 1))
    with pytest.raises(RecordingError, match="before"):
        replay.start(world.graph, world, lambda: 0)


@pytest.mark.parametrize(
    "options",
    [{"rate": 0.0}, {"rate": float("nan")}, {"rate": -1.0}, {"offset_s": -1.0}, {"begin_s": 1e300}],
)
def test_numbers_out_of_range(tmp_path, options):
    with pytest.raises(RecordingError, match="replay"):
        Replay(strings(tmp_path / "x.mcap", 1), **options)


def test_what_is_no_log(tmp_path):
    (tmp_path / "x.mcap").write_text("hello")
    with pytest.raises(RecordingError, match="neither"):
        Replay(tmp_path / "x.mcap")
    with pytest.raises(RecordingError, match="No such file"):
        Replay(tmp_path / "y.mcap")
    with pytest.raises(GraphError, match="pattern"):
        Replay(strings(tmp_path / "z.mcap", 1), topics="a b")


def test_a_topic_of_another_type_is_left_out(tmp_path):
    world = World()
    world.graph.advertise("/a", m.Range)
    replay = world.play(strings(tmp_path / "x.mcap", 1, 2))
    world.run()
    assert replay.info.skipped == 2
    assert "carries" in replay.info.refused["/a"]


# ------------------------------------------------------------------------------- damaged logs


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_cut_log_is_played_up_to_the_cut(tmp_path, flight, suffix):
    # Range has no variance in ROS 1
    messages = [p for p in flight(12.0) if p.topic != "/uav1/range"]
    path = write(tmp_path / f"x{suffix}", messages)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    world = World()
    replay = world.play(path, exclude=())
    world.run()
    assert "cut off" in replay.info.problem
    count = len(world.received)
    assert 0 < count < len(messages)
    assert fields_of(world.received) == fields_of(messages[:count])


@pytest.mark.parametrize("suffix", FORMATS)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(harm=st.lists(st.tuples(st.floats(0, 1), st.binary(min_size=1, max_size=8)), max_size=5))
def test_no_damage_is_fatal(tmp_path_factory, suffix, harm):
    path = tmp_path_factory.getbasetemp() / f"harmed{suffix}"
    path.unlink(missing_ok=True)
    strings(path, *range(50))
    data = bytearray(path.read_bytes())
    for fraction, text in harm:
        offset = 20 + round(fraction * (len(data) - 20))
        data[offset : offset + len(text)] = text
    path.write_bytes(data)
    world = World()
    world.play(path)
    world.run(10_000_000_000)
    assert len(world.received) <= 50


def test_bytes_that_are_no_message_are_left_out(tmp_path):
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/a", "cdr", schema)
        good = encode_cdr(m.String("good"), "std_msgs/msg/String")
        lies = good[:4] + struct.pack("<I", 1 << 31) + good[8:]
        for k, data in enumerate((good, lies, b"", good[:7], good)):
            writer.add_message(channel, k * 1_000_000, data, 0)
        writer.finish()
    world = World()
    replay = world.play(path)
    world.run()
    assert said(world) == [(0, "good"), (4, "good")]
    assert replay.info.skipped == 3
    assert "std_msgs/msg/String" in replay.info.refused["/a"]


# ----------------------------------------------------------------------------- others' logs

SOUND = """
Header header
float32[] levels
acme_msgs/Tone loudest
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: acme_msgs/Tone
float64 pitch
string name
"""


def test_types_that_only_the_bag_knows(tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(SOUND, "acme_msgs/msg/Sound"))
    path = tmp_path / "x.bag"
    header = store.types["std_msgs/msg/Header"](
        7, store.types["builtin_interfaces/msg/Time"](1, 2), "f"
    )
    tone = store.types["acme_msgs/msg/Tone"](440.0, "a")
    levels = np.array([1.0, 2.0], np.float32)
    sound = store.types["acme_msgs/msg/Sound"](header, levels, tone)
    with BagWriter(path) as writer:
        connection = writer.add_connection("/sound", "acme_msgs/msg/Sound", typestore=store)
        data = store.serialize_ros1(sound, "acme_msgs/msg/Sound")
        writer.write(connection, 5_000_000, bytes(data))
    world = World()
    replay = world.play(path)
    world.run()
    assert replay.info.refused == {}
    (received,) = world.received
    assert received.msgtype == "acme_msgs/msg/Sound"
    assert received.message.loudest.name == "a"
    assert received.message.header.stamp.sec == 1
    assert received.message.levels.tolist() == [1.0, 2.0]


def test_a_type_of_the_same_name_that_is_another(tmp_path):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("int32 data\n", "std_msgs/msg/String"))
    path = tmp_path / "x.bag"
    with BagWriter(path) as writer:
        connection = writer.add_connection("/a", "std_msgs/msg/String", typestore=store)
        writer.write(connection, 5, b"\7\0\0\0")
    world = World()
    replay = world.play(path)
    world.run()
    assert replay.info.refused == {}
    (received,) = world.received
    assert received.msgtype.startswith("std_msgs_")
    assert received.msgtype.endswith("/msg/String")
    assert received.message.data == 7


@pytest.mark.parametrize(
    ("encoding", "schema", "name", "text", "words"),
    [
        ("json", "jsonschema", "x", b"{}", "json"),
        ("cdr", "ros2msg", "other_msgs/msg/New", b"", "not define"),
        ("cdr", "ros2idl", "other_msgs/msg/New", b"module", "in IDL is not readable"),
        ("cdr", "ros2msg", "../../msg/New", b"int8 x\n", "name"),
        ("cdr", "ros2msg", "other_msgs/msg/New", b"no/Such x\n", "no/"),
    ],
)
def test_what_cannot_be_read_is_reported(tmp_path, encoding, schema, name, text, words):
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = writer.register_schema(name, schema, text)
        writer.add_message(writer.register_channel("/a", encoding, number), 1, b"", 1)
        writer.finish()
    world = World()
    replay = world.play(path)
    world.run()
    assert replay.info.skipped == 1
    assert words in replay.info.refused["/a"]
