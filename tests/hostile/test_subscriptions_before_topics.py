"""A client that subscribes to a topic which does not exist yet does not decide its type."""

from __future__ import annotations

import pytest

from volery.core.errors import GraphError
from volery.graph.graph import Graph
from volery.graph.messages import message_type
from volery.graph.subscription_queue import SubscriptionQueue

TOPIC = "/uav9/odom"
EMPTY, TEXT = "std_msgs/msg/Empty", "std_msgs/msg/String"
ENDED = f"topic '{TOPIC}' carries {TEXT}, not {EMPTY}"


@pytest.fixture
def graph():
    return Graph(lambda: 0)


def ignore(_message):
    """Receives a message."""


@pytest.mark.parametrize("by", ["advertise", "subscribe"])
def test_the_type_of_the_simulation_wins_and_the_subscriber_gets_an_error(graph, by):
    errors = []
    graph.attach(TOPIC, ignore, EMPTY, on_ended=errors.append)
    if by == "advertise":
        graph.advertise(TOPIC, TEXT)
    else:
        graph.subscribe(TOPIC, ignore, TEXT)
    assert graph.topic_type(TOPIC) == TEXT
    assert errors == [ENDED]
    with pytest.raises(GraphError, match="carries"):
        graph.attach(TOPIC, ignore, EMPTY)


def test_clients_of_several_types_wait_and_the_right_one_receives(graph):
    errors, got = [], []
    graph.attach(TOPIC, ignore, EMPTY, on_ended=errors.append)
    graph.attach(TOPIC, got.append, TEXT, on_ended=errors.append)
    graph.advertise(TOPIC, TEXT).publish(message_type(TEXT)("hello"))
    graph.deliver()
    assert [published.message.data for published in got] == ["hello"]
    assert errors == [ENDED]


def test_a_client_that_leaves_leaves_no_type_behind(graph):
    first = graph.attach(TOPIC, ignore, EMPTY)
    second = graph.attach(TOPIC, lambda _message: None, TEXT)
    first.cancel()
    assert graph.topic_type(TOPIC) == TEXT
    second.cancel()
    publisher = graph.advertise(TOPIC, EMPTY)
    publisher.cancel()
    graph.advertise(TOPIC, TEXT)
    assert graph.topic_type(TOPIC) == TEXT


def test_a_queue_that_ends_wakes_its_client_with_the_reason():
    woken = []
    queue = SubscriptionQueue(TOPIC, 5, lambda: woken.append(queue.failure))
    queue.end(ENDED)
    assert woken == [f"subscription of '{TOPIC}' ended: {ENDED}"]
    assert not queue.take()
