"""Sessions of ROS-TCP fed with frames that make sense in part, or none, without sockets."""

from __future__ import annotations

import contextlib
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_graph import HandGraph
from ros_tcp_client import cdr_string, frame, ros1_string

from volery.bridges.ros_tcp.payloads import payloads_of
from volery.bridges.ros_tcp.session import EndpointSession
from volery.bridges.ros_tcp.unity import Selection, UnitySession
from volery.bridges.ros_tcp.wire import RosTcpFrameParser
from volery.core.errors import BridgeError, GraphError
from volery.graph.messages import Published, String, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
Response = message_type(f"{TRIGGER}_Response")


class Bench(HandGraph):
    """A graph in this thread, with something on it."""

    def __init__(self):
        super().__init__()
        self.publisher = self.graph.advertise("/out", STRING, latched=True)
        self.graph.subscribe("/uav1/cmd_vel", lambda _: None, "geometry_msgs/msg/Twist")
        self.graph.create_service("/do", TRIGGER, lambda _request: Response(True, "done"))
        self.before = self.counts()

    def counts(self):
        topics = {
            t.name: (t.publishers, t.subscribers)
            for t in self.graph.topics()
            if t.publishers or t.subscribers
        }
        return topics, set(self.graph.services())


def drain(session):
    """Frames that the session would send."""
    parser, found = RosTcpFrameParser(), []
    while parts := session.outbox.gather():
        for part in parts:
            found += parser.feed(part)
    return found


names = st.sampled_from(["/out", "/do", "/in", "/a", "b", "/uav1/cmd_vel", "/a b", "", "__x", "/ü"])
types = st.sampled_from(
    ["std_msgs/String", "std_msgs/msg/String", "geometry_msgs/Twist", "std_srvs/Trigger", "x", ""]
)
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=5,
)
fields = st.fixed_dictionaries(
    {},
    optional={
        "topic": names | anything,
        "message_name": types | anything,
        "queue_size": st.integers(-2, 10_000) | anything,
        "latch": st.booleans() | anything,
        "srv_id": st.integers(0, 3) | st.integers(1001, 1003) | anything,
        "text": st.text(max_size=10) | anything,
        "metadata": st.sampled_from(['{"protocol": "ROS1"}', '{"protocol": "ROS2"}']) | anything,
    },
)
COMMANDS = """publish subscribe ros_service unity_service request response topic_list
remove_publisher remove_subscriber remove_ros_service remove_unity_service handshake error log warn
no"""
commands = st.sampled_from([f"__{name}" for name in COMMANDS.split()])
payloads = st.one_of(
    st.binary(max_size=50),
    st.text(max_size=10).map(ros1_string),
    st.text(max_size=10).map(cdr_string),
    st.just(bytes(48)),
    st.just(b"\0\1\0\0" + bytes(48)),
)
steps = st.lists(
    st.one_of(
        st.tuples(commands, fields.map(lambda f: json.dumps(f).encode())),
        st.tuples(commands, st.binary(max_size=20)),
        st.tuples(names, payloads),
        st.sampled_from(["work", "publish", "call", "drain", "keepalive"]),
    ),
    max_size=25,
)


def play(bench, session, script):
    """Feed a session; returns replies that were neither answered nor failed while it lived."""
    parser, calls = RosTcpFrameParser(), []
    for step in script:
        if step == "work":
            bench.work_off()
        elif step == "publish":
            bench.publisher.publish(String("x"))
            bench.work_off()
        elif step == "call":
            for service in bench.graph.services():
                calls.append(ServiceReply(lambda _: None, lambda _: None))
                bench.graph.call_async(service, None, calls[-1])
        elif step == "drain":
            drain(session)
        else:
            data = bytes(8) if step == "keepalive" else frame(*step)
            for one in parser.feed(data):
                session.take(one)
    return calls


@pytest.mark.parametrize("generation", ["ros1", "ros2"])
@settings(max_examples=150)
@given(script=steps)
def test_no_client_breaks_the_endpoint(generation, script):
    bench = Bench()
    session = EndpointSession(bench.gateway, "fuzz", generation, 10, lambda: None)
    calls = play(bench, session, script)
    bench.work_off()
    for one in drain(session):
        if one.destination.startswith("__"):
            json.loads(bytes(one.payload))
    session.close()
    bench.work_off()
    assert bench.counts() == bench.before
    assert all(call.done for call in calls)
    assert not bench.gateway.sessions()


@pytest.mark.parametrize("generation", [None, "ros1", "ros2"])
@settings(max_examples=80)
@given(script=steps)
def test_no_endpoint_breaks_the_connector(generation, script):
    bench = Bench()
    session = UnitySession(bench.gateway, "fuzz", Selection(), 10, lambda _: None, lambda: None)
    if generation is not None:
        session.begin(generation)
    with contextlib.suppress(BridgeError):  # a handshake without sense
        play(bench, session, script)
        session.refresh()
    bench.work_off()
    drain(session)
    session.close()
    bench.work_off()
    assert bench.counts() == bench.before


def test_a_message_that_cannot_be_encoded_is_reported_once():
    bench = Bench()
    session = EndpointSession(bench.gateway, "c", "ros1", 10, lambda: None)
    for one in RosTcpFrameParser().feed(
        frame("__subscribe", b'{"topic": "/out", "message_name": "std_msgs/String"}')
    ):
        session.take(one)
    for _ in range(3):
        bench.publisher.publish(String(3))
        bench.work_off()
        found = [(f.destination, bytes(f.payload)) for f in drain(session)]
    assert found == []
    assert bench.counts() == bench.before


def subscribe(session, topic, **more):
    fields = {"topic": topic, "message_name": "std_msgs/String", **more}
    for one in RosTcpFrameParser().feed(frame("__subscribe", json.dumps(fields).encode())):
        session.take(one)


def test_messages_keep_their_order_across_topics():
    """Who waits for a message on one topic has all that was published before on others."""
    bench = Bench()
    session = EndpointSession(bench.gateway, "c", "ros1", 3, lambda: None)
    subscribe(session, "/out")
    subscribe(session, "/in")
    publishers = {"/out": bench.publisher, "/in": bench.graph.advertise("/in", STRING)}
    order = ["/out", "/in", "/in", "/out", "/out", "/in"]
    for topic in order:
        publishers[topic].publish(String(topic))
    bench.work_off()
    session.complain("first")
    assert [f.destination for f in drain(session)] == ["__error", *order]


def test_lost_messages_leave_the_others_in_order():
    bench = Bench()
    session = EndpointSession(bench.gateway, "c", "ros1", 2, lambda: None)
    subscribe(session, "/out")
    subscribe(session, "/in")
    drain(session)
    large, other = String("x" * 100_000), bench.graph.advertise("/in", STRING)

    def publish(*what):
        for publisher, message in what:
            publisher.publish(message)
        bench.work_off()

    publish((other, large), (bench.publisher, String("1")))
    assert len(session.outbox.gather()) == 2  # the large one fills a batch; "1" has its turn next
    publish((other, String("2")), (bench.publisher, String("3")), (bench.publisher, String("4")))
    assert [bytes(f.payload)[4:] for f in drain(session)] == [b"2", b"3", b"4"]


def test_a_client_says_how_many_messages_may_wait():
    bench = Bench()
    session = EndpointSession(bench.gateway, "c", "ros1", 2, lambda: None)
    subscribe(session, "/out", queue_size=5)
    drain(session)
    for k in range(9):
        bench.publisher.publish(String(str(k)))
    bench.work_off()
    assert [bytes(f.payload)[4:] for f in drain(session)] == [b"4", b"5", b"6", b"7", b"8"]


def large_messages():
    from volery.graph import messages as m

    bits = np.random.default_rng(3).integers(0, 256, 40_000).astype(np.uint8)
    head = m.header(7, "ünï")
    fields = [m.PointField("x", 0, 7, 1), m.PointField("longer", 4, 7, 1)]
    grid = message_type("nav_msgs/msg/OccupancyGrid")
    info = message_type("nav_msgs/msg/MapMetaData")
    pose = m.Pose(m.Point(1.0, 2.0, 3.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    image = message_type("sensor_msgs/msg/Image")
    for is_dense in (True, False):
        yield m.PointCloud2(head, 1, 2500, fields, False, 16, 40_000, bits, is_dense)
    yield image(head, 200, 200, "mono8", 0, 200, bits)
    yield image(head, 100, 200, "mono8", 0, 200, bits[::2])
    yield image(head, 1, 10, "mono8", 0, 10, bits[:10])
    yield message_type("sensor_msgs/msg/CompressedImage")(head, "png", bits)
    yield grid(head, info(m.Time(0, 0), 0.1, 200, 200, pose), bits.view(np.int8))


@pytest.mark.parametrize("generation", ["ros1", "ros2"])
@pytest.mark.parametrize("message", list(large_messages()), ids=lambda m: type(m).__name__)
def test_large_messages_in_parts_are_the_same_bytes(generation, message):
    published = Published("/x", message.__msgtype__, 0, message)
    parts = payloads_of(generation).published(published)
    whole = published.ros1 if generation == "ros1" else published.cdr
    assert b"".join(parts) == whole
    assert (len(parts) > 1) == (message.data.nbytes > 16384 and message.data.flags.c_contiguous)


def test_a_large_message_that_does_not_fit_is_refused():
    (*_, message) = large_messages()
    message.data = message.data.astype(np.float64)
    published = Published("/x", message.__msgtype__, 0, message)
    for generation in ("ros1", "ros2"):
        with pytest.raises(GraphError, match="OccupancyGrid"):
            payloads_of(generation).published(published)


def test_a_queue_without_end_loses_nothing_or_says_so(monkeypatch):
    monkeypatch.setattr("volery.graph.subscription_queue.MAX_DEPTH", 100)
    bench = Bench()
    session = EndpointSession(bench.gateway, "c", "ros1", 2, lambda: None)
    subscribe(session, "/out", queue_size=0)
    drain(session)

    def publish(count):
        for k in range(count):
            bench.publisher.publish(String(f"{k}"))
        bench.work_off()
        return drain(session)

    assert len(publish(50)) == 50
    (error,) = publish(200)
    assert error.destination == "__error"
    assert b"too slow" in bytes(error.payload)
    assert publish(1) == []
