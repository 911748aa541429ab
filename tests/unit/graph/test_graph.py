"""Tests topics and services: types, order, and no messages without subscribers."""

from types import SimpleNamespace

import numpy as np
import pytest

from volery.core.errors import GraphError
from volery.graph.graph import MAX_UNUSED, Graph
from volery.graph.messages import LaserScan, String, Twist, header, message_type
from volery.graph.typestore import typestore


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


def test_unwanted_messages_are_not_queued_and_publishers_know_their_subscribers(graph):
    publisher = graph.advertise("/a", String)
    assert not publisher.has_subscribers
    subscription = graph.subscribe("/a", lambda _m: None)
    assert publisher.has_subscribers
    subscription.cancel()
    assert not publisher.has_subscribers
    graph.subscribe_all(lambda _m: None)
    assert publisher.has_subscribers


def test_passive_subscribers_cause_no_actions(graph):
    publisher, other = graph.advertise("/a", String), graph.advertise("/b", String)
    got = []
    passive = graph.subscribe("/a", got.append, passive=True)
    graph.attach("/a", got.append)
    graph.subscribe_all(got.append)
    assert not publisher.causes_actions
    publisher.publish(String("1"))
    graph.deliver()
    assert len(got) == 3
    active = graph.subscribe("/a", lambda _m: other.publish(String("reply")))
    assert publisher.causes_actions
    active.cancel()
    assert not publisher.causes_actions
    graph.subscribe_all(got.append, lambda topic: topic == "/a", is_machine=True)
    assert publisher.causes_actions
    assert not other.causes_actions
    passive.cancel()
    publisher.publish(String("2"))
    graph.deliver()
    assert len(got) == 6


def test_passive_subscribers_that_act_are_refused(graph):
    publisher, other = graph.advertise("/a", String), graph.advertise("/b", String)
    graph.create_service("/c", "std_srvs/srv/Trigger", lambda request: request)
    for action, text in (
        (lambda _m: other.publish(String("reply")), "publishes on '/b'"),
        (lambda _m: graph.call("/c"), "calls '/c'"),
        (lambda _m: graph.call_async("/c", None, None), "calls '/c'"),
    ):
        subscription = graph.subscribe("/a", action, passive=True)
        publisher.publish(String("1"))
        with pytest.raises(GraphError, match=f"'/a' is declared passive, but its callback {text}"):
            graph.deliver()
        subscription.cancel()
    other.publish(String("still"))
    graph.deliver()


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


@pytest.fixture
def clock():
    return SimpleNamespace(now_ns=0)


@pytest.fixture
def timed(clock):
    return Graph(lambda: clock.now_ns)


def texts(got):
    return [message.message.data for message in got]


def test_a_late_subscriber_gets_the_last_latched_message_once(timed, clock):
    latched = timed.advertise("/map", String, latched=True)
    plain = timed.advertise("/map", String)
    assert latched.has_subscribers  # though it has none yet
    for word in ("old", "new"):
        latched.publish(String(word))
    plain.publish(String("gone"))
    timed.deliver()
    clock.now_ns = 7
    late, later = [], []
    timed.subscribe("/map", late.append)
    assert late == []  # with the next delivery, like everything
    timed.deliver()
    timed.deliver()
    assert [(m.message.data, m.time_ns) for m in late] == [("new", 7)]
    timed.subscribe("/map", later.append)
    timed.deliver()
    assert (texts(late), texts(later)) == (["new"], ["new"])
    (info,) = timed.topics()
    assert (info.latched, info.messages, info.subscribers) == (True, 3, 2)


def test_messages_in_transit_come_after_the_latched_one(timed):
    latched = timed.advertise("/map", String, latched=True)
    latched.publish(String("1"))
    timed.deliver()
    latched.publish(String("2"))
    got = []
    timed.subscribe("/map", got.append)
    timed.deliver()
    assert texts(got) == ["1", "2"]


def test_every_latched_publisher_and_recorders(timed):
    a, b = (timed.advertise("/tf_static", String, latched=True) for _ in range(2))
    other = timed.advertise("/other", String, latched=True)
    for publisher, word in ((b, "b1"), (a, "a1"), (other, "o1"), (b, "b2")):
        publisher.publish(String(word))
    timed.deliver()
    got, everything = [], []
    timed.subscribe("/tf_static", got.append)
    timed.subscribe_all(everything.append)
    timed.deliver()
    assert texts(got) == ["b2", "a1"]  # by their first messages
    assert texts(everything) == ["b2", "a1", "o1"]
    gone = []
    timed.subscribe("/tf_static", gone.append).cancel()
    timed.deliver()
    assert gone == []


def test_a_callback_may_subscribe(timed):
    timed.advertise("/map", String, latched=True).publish(String("m"))
    timed.deliver()
    got = []
    go = timed.advertise("/go", String)
    timed.subscribe("/go", lambda _m: timed.subscribe("/map", got.append))
    go.publish(String("now"))
    timed.deliver()
    assert texts(got) == ["m"]


@pytest.mark.parametrize("name", ["a", "/", "/a b", "//a", "/a/", "/1a", ""])
def test_bad_names_are_refused(graph, name):
    with pytest.raises(GraphError, match="invalid name"):
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
    graph.create_service("/uav1/land", "std_srvs/srv/Trigger", lambda _r: response(True, "landing"))
    assert graph.call("/uav1/land").message == "landing"
    assert graph.services() == {"/uav1/land": "std_srvs/srv/Trigger"}
    with pytest.raises(GraphError, match="has no server"):
        graph.call("/uav2/land")
    with pytest.raises(GraphError, match="already has a server"):
        graph.create_service("/uav1/land", "std_srvs/srv/Trigger", lambda _r: None)


def test_laser_scan_bytes_survive_a_round_trip():
    ranges = np.linspace(0.1, 30.0, 1081, dtype=np.float32)
    scan = LaserScan(
        header(5, "laser"), -2.3, 2.3, 0.004, 1e-5, 0.025, 0.1, 30.0, ranges, ranges[:0]
    )
    store = typestore()
    again = store.deserialize_cdr(store.serialize_cdr(scan, scan.__msgtype__), scan.__msgtype__)
    np.testing.assert_array_equal(again.ranges, ranges)


def test_a_call_without_a_request_is_one_of_zeros(graph):
    response = message_type("std_srvs/srv/SetBool_Response")
    graph.create_service("/arm", "std_srvs/srv/SetBool", lambda r: response(r.data, f"{r.data}"))
    assert graph.call("/arm").message == "False"


def test_topics_that_come_and_go_do_not_pile_up(graph):
    stays = graph.advertise("/stays", String)
    graph.advertise("/idle", String).cancel()
    for k in range(2 * MAX_UNUSED):
        graph.advertise(f"/t{k}", String).cancel()
        graph.subscribe(f"/s{k}", lambda _: None, String).cancel()
        if k == 3:  # is among the unused, and is used again
            back = graph.advertise("/idle", String)
    names = {t.name for t in graph.topics()}
    assert {"/stays", "/idle"} <= names
    assert len(names) == MAX_UNUSED + 2
    assert graph.topic_type("/t0") is None
    graph.advertise("/t0", Twist)  # the next publisher may choose another type
    for one in (stays, back):
        one.cancel()
    assert f"/s{2 * MAX_UNUSED - 1}" in names


def test_a_latched_message_in_transit_goes_with_its_publisher(graph):
    graph.subscribe("/a", lambda _: None, String)
    publisher = graph.advertise("/a", String, latched=True)
    publisher.publish(String("in transit"))
    publisher.cancel()
    graph.deliver()
    late = []
    graph.subscribe("/a", late.append)
    graph.deliver()
    assert late == []


def test_what_is_shown_reaches_clients_outside_alone(timed):
    publisher = timed.advertise("/live", String)
    inside, everything, outside = [], [], []
    timed.subscribe("/live", inside.append)
    timed.subscribe_all(everything.append)
    assert not publisher.has_external_subscribers
    subscription = timed.attach("/live", outside.append)
    assert publisher.has_external_subscribers
    assert publisher.num_external_subscriptions == 1
    publisher.publish_external(String("now"))
    assert texts(outside) == ["now"]  # at once, without a delivery
    timed.deliver()
    assert inside == everything == []
    publisher.publish(String("to all"))
    timed.deliver()
    assert [texts(got) for got in (inside, everything, outside)] == [
        ["to all"],
        ["to all"],
        ["now", "to all"],
    ]
    subscription.cancel()
    assert not publisher.has_external_subscribers
    publisher.publish_external(String("none"))
    assert len(outside) == 2
    with pytest.raises(GraphError, match="carries"):
        publisher.publish_external(Twist(None, None))
    publisher.cancel()
    timed.attach("/live", outside.append)
    publisher.publish_external(String("gone"))
    assert len(outside) == 2


def test_what_is_kept_is_shown_again(timed):
    publisher = timed.advertise("/map", String, latched=True)
    publisher.publish(String("m"))
    timed.deliver()
    inside, outside = [], []
    timed.subscribe("/map", inside.append)
    timed.attach("/map", outside.append)
    timed.deliver()
    timed.republish_latched()
    assert (texts(inside), texts(outside)) == (["m"], ["m", "m"])
