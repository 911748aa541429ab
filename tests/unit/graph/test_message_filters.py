"""`message_filters` synchronizes and keeps messages as in ROS 2."""

import pytest

from volery.core.errors import GraphError
from volery.graph.graph import Graph
from volery.graph.messages import PointStamped, String, header
from volery.graph.nodes.message_filters import (
    ApproximateTimeSynchronizer,
    Cache,
    SimpleFilter,
    Subscriber,
    TimeSynchronizer,
)
from volery.graph.nodes.node import Context
from volery.graph.nodes.rclpy_modules import Node
from volery.graph.nodes.ros_time import Time

MS = 1_000_000


def stamped(time_ms):
    return PointStamped(header=header(time_ms * MS, "map"))


def times_of(*messages):
    stamps = [message.header.stamp for message in messages]
    return tuple(s.sec * 1000 + s.nanosec // MS for s in stamps)


@pytest.fixture
def pair():
    """Two filters, and the sets of times, ms, that a synchronizer passes on."""
    return SimpleFilter(), SimpleFilter(), []


@pytest.fixture
def node():
    now_ns = [0]
    context = Context(Graph(lambda: now_ns[0]), None, lambda: now_ns[0])
    made = Node("filters", context=context, namespace="/uav1")
    made.test_now_ns = now_ns
    return made


def test_equal_stamps_meet_in_any_order(pair):
    left, right, received = pair
    both = TimeSynchronizer([left, right], 10)
    both.registerCallback(lambda a, b, word: received.append((*times_of(a, b), word)), "extra")
    for time_ms in (10, 20, 30):
        left.signalMessage(stamped(time_ms))
    for time_ms in (30, 10, 40):
        right.signalMessage(stamped(time_ms))
    assert received == [(30, 30, "extra"), (10, 10, "extra")]


def test_a_queue_keeps_the_newest(pair):
    left, right, received = pair
    TimeSynchronizer([left, right], 2).registerCallback(lambda a, b: received.append(times_of(a)))
    for time_ms in (10, 20, 30):
        left.signalMessage(stamped(time_ms))
    for time_ms in (10, 20, 30):
        right.signalMessage(stamped(time_ms))
    assert received == [(20,), (30,)]


def test_exact_times_need_a_header(pair):
    left, right, _ = pair
    TimeSynchronizer([left, right], 2)
    with pytest.raises(GraphError, match=r"String has no header"):
        left.signalMessage(String("x"))


def test_near_stamps_meet_the_nearest_first(pair):
    left, right, received = pair
    both = ApproximateTimeSynchronizer([left, right], 10, 0.02)
    both.registerCallback(lambda a, b: received.append(times_of(a, b)))
    for time_ms in (100, 112, 200):
        left.signalMessage(stamped(time_ms))
    right.signalMessage(stamped(110))
    right.signalMessage(stamped(115))
    right.signalMessage(stamped(220))  # a difference of slop is too much
    right.signalMessage(stamped(219))
    assert received == [(112, 110), (100, 115), (200, 219)]


def test_three_inputs_all_within_the_slop():
    inputs, received = [SimpleFilter() for _ in range(3)], []
    every = ApproximateTimeSynchronizer(inputs, 10, 0.02)
    every.registerCallback(lambda *messages: received.append(times_of(*messages)))
    inputs[0].signalMessage(stamped(100))
    inputs[1].signalMessage(stamped(125))
    inputs[2].signalMessage(stamped(112))  # near both, which are too far apart
    assert received == []
    inputs[1].signalMessage(stamped(111))
    assert received == [(100, 111, 112)]


def test_subscribers_of_a_node_and_messages_without_header(node):
    received, cached = [], []
    point = Subscriber(node, PointStamped, "point", qos_profile=5)
    text = Subscriber(node, String, "text")
    both = ApproximateTimeSynchronizer([point, text], 5, 0.1, allow_headerless=True)
    both.registerCallback(lambda a, b: received.append((times_of(a), b.data)))
    Cache(text, 3).registerCallback(cached.append)  # ignores messages without header
    points = node.create_publisher(PointStamped, "point")
    texts = node.create_publisher(String, "text")
    node.test_now_ns[0] = 1_050 * MS
    texts.publish(String("at arrival"))
    points.publish(stamped(1_000))
    node._context.graph.deliver()
    assert received == [((1_000,), "at arrival")]
    assert cached == []
    assert (point.getTopic(), text.topic) == ("point", "text")
    text.unsubscribe()
    assert node.count_subscribers("text") == 0


def test_all_by_the_time_of_arrival(node):
    received = []
    inputs = [Subscriber(node, PointStamped, name) for name in ("a", "b")]
    both = ApproximateTimeSynchronizer(inputs, 5, 0.1, sync_arrival_time=True)
    both.registerCallback(lambda a, b: received.append(times_of(a, b)))
    for name, time_ms in (("a", 0), ("b", 9_000)):
        node.create_publisher(PointStamped, name).publish(stamped(time_ms))
    node._context.graph.deliver()
    assert received == [(0, 9_000)]


def test_a_cache_is_asked_by_time():
    source = SimpleFilter()
    cache = Cache(source, 3)
    assert (cache.getLast(), cache.getLatestTime(), cache.getOldestTime()) == (None, None, None)
    for time_ms in (10, 20, 30, 40):
        source.signalMessage(stamped(time_ms))

    def at(time_ms):
        return Time.from_msg(stamped(time_ms).header.stamp)

    assert [times_of(m) for m in cache.getInterval(at(20), at(30))] == [(20,), (30,)]
    assert times_of(cache.getElemAfterTime(at(21))) == (30,)
    assert times_of(cache.getElemBeforeTime(at(39))) == (30,)
    assert cache.getElemBeforeTime(at(10)) is None
    assert cache.getElemAfterTime(at(41)) is None
    assert times_of(cache.getLast()) == (40,)
    assert (cache.getOldestTime(), cache.getLastestTime()) == (at(20), at(40))
    with pytest.raises(ValueError, match="ends before"):
        cache.getInterval(at(30), at(20))
