"""Topics and services: typed, ordered, nothing built for nobody."""

import numpy as np
import pytest

from volery.core.errors import GraphError
from volery.graph.graph import Graph
from volery.graph.messages import LaserScan, String, Twist, header, message_type, typestore


@pytest.fixture
def graph():
    return Graph(lambda: 42)


def test_delivery_keeps_order_even_when_callbacks_publish(graph):
    a, b = graph.advertise("/a", String), graph.advertise("/b", String)
    got = []
    graph.subscribe("/a", lambda m: (got.append(m.message.data), b.publish(String("reply"))))
    graph.subscribe("/b", lambda m: got.append(m.message.data))
    a.publish(String("1"))
    a.publish(String("2"))
    assert got == []
    graph.deliver()
    assert got == ["1", "2", "reply", "reply"]


def test_unwanted_messages_are_not_queued_and_wanted_tells(graph):
    publisher = graph.advertise("/a", String)
    assert not publisher.wanted
    subscription = graph.subscribe("/a", lambda _m: None)
    assert publisher.wanted
    subscription.cancel()
    assert not publisher.wanted
    graph.subscribe_all(lambda _m: None)
    assert publisher.wanted


def test_publication_carries_time_type_and_bytes(graph):
    publisher = graph.advertise("/a", String)
    got = []
    graph.subscribe("/a", got.append)
    publisher.publish(String("hi"))
    graph.deliver()
    (message,) = got
    assert (message.topic, message.msgtype, message.time_ns) == ("/a", "std_msgs/msg/String", 42)
    assert typestore().deserialize_cdr(message.cdr, message.msgtype).data == "hi"
    assert message.cdr is message.cdr  # made once


@pytest.mark.parametrize("name", ["a", "/", "/a b", "//a", "/a/", "/1a", ""])
def test_bad_names_are_refused(graph, name):
    with pytest.raises(GraphError, match="no valid name"):
        graph.advertise(name, String)


def test_types_are_kept(graph):
    publisher = graph.advertise("/a", String)
    with pytest.raises(GraphError, match="carries std_msgs/msg/String, not"):
        graph.advertise("/a", Twist)
    with pytest.raises(GraphError, match="carries std_msgs/msg/String, not"):
        publisher.publish(header(0, "x"))
    with pytest.raises(GraphError, match="unknown message type"):
        graph.advertise("/b", "no_msgs/msg/Thing")
    with pytest.raises(GraphError, match="no topic '/c'"):
        graph.subscribe("/c", lambda _m: None)


def test_services(graph):
    response = message_type("std_srvs/srv/Trigger_Response")
    graph.offer("/uav1/land", "std_srvs/srv/Trigger", lambda _r: response(True, "landing"))
    assert graph.call("/uav1/land").message == "landing"
    assert graph.services() == {"/uav1/land": "std_srvs/srv/Trigger"}
    with pytest.raises(GraphError, match="nobody offers"):
        graph.call("/uav2/land")
    with pytest.raises(GraphError, match="offered already"):
        graph.offer("/uav1/land", "std_srvs/srv/Trigger", lambda _r: None)


def test_laser_scan_bytes_survive_a_round_trip():
    ranges = np.linspace(0.1, 30.0, 1081, dtype=np.float32)
    scan = LaserScan(
        header(5, "laser"), -2.3, 2.3, 0.004, 1e-5, 0.025, 0.1, 30.0, ranges, ranges[:0]
    )
    store = typestore()
    again = store.deserialize_cdr(store.serialize_cdr(scan, scan.__msgtype__), scan.__msgtype__)
    np.testing.assert_array_equal(again.ranges, ranges)
