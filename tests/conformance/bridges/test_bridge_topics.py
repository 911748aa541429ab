"""Topics over every bridge."""

from __future__ import annotations

import numpy as np
import pytest
from bridge_bench import IMAGE, STRING
from ros_tcp_client import until

from volery.graph import messages as m

TEXTS = ["", "Grüße, 無人機 🚁", "a\0b", "\u202e rtl \u0301\U0010ffff", "x" * 70_000]
LARGE = 8 << 20
BURST = 5000
"""Messages at once, between two breaths of a bridge."""


def image(size):
    data = np.zeros(size, np.uint8)
    return m.message_type(IMAGE)(m.header(1, ""), 1, size, "mono8", 0, size, data)


def test_what_a_client_publishes_arrives(bench, client):
    seen = bench.ours.collect(bench.topic_in, bench.type_in)
    client.advertise(bench.topic_in)
    for k in range(5):
        client.publish(bench.topic_in, f"{k}")
        until(lambda k=k: len(seen) == k + 1)
    assert [bench.text(message) for message in seen] == [f"{k}" for k in range(5)]


def test_what_our_side_publishes_arrives_at_every_client(bench, client):
    publish = bench.ours.publisher(bench.topic_out, bench.type_out)
    clients = {id(c): c for c in (client, bench.another(client))}.values()
    for one in clients:
        one.subscribe(bench.topic_out)
        one.settle()
    for k in range(5):
        publish(bench.message(f"{k}"))
        assert [one.next() for one in clients] == [f"{k}"] * len(clients)


@pytest.mark.needs("texts")
def test_texts_of_any_letters_go_both_ways(bench, client):
    seen = bench.ours.collect(bench.topic_in)
    publish = bench.ours.publisher(bench.topic_out)
    client.advertise(bench.topic_in)
    client.subscribe(bench.topic_out)
    client.settle()
    for text in TEXTS:
        client.publish(bench.topic_in, text)
        publish(m.String(text))
        assert client.next() == text
    until(lambda: len(seen) == len(TEXTS))
    assert [message.data for message in seen] == TEXTS


def test_large_messages_go_out(bench, client):
    publish = bench.ours.publisher(bench.image_out, IMAGE)
    client.subscribe(bench.image_out, IMAGE)
    client.settle()
    publish(image(LARGE))
    assert client.next() == LARGE


@pytest.mark.needs("large messages in")
def test_large_messages_come_in(bench, client):
    seen = bench.ours.collect(bench.image_in, IMAGE)
    client.advertise(bench.image_in, IMAGE)
    client.publish_image(bench.image_in, LARGE)
    until(lambda: seen)
    assert seen[0].data.size == LARGE


@pytest.mark.needs("late joiners")
def test_late_subscribers_receive_latched_messages(bench, client):
    publish = bench.ours.publisher("/map", latched=True)
    publish(m.String("old"))
    publish(m.String("kept"))
    client.subscribe("/map")
    assert client.next() == "kept"


@pytest.mark.needs("late joiners", "advertising")
def test_what_a_client_latches_awaits_our_side(bench, client):
    early = bench.ours.collect("/plan")
    client.advertise("/plan", latched=True)
    client.publish("/plan", "kept")
    until(lambda: early)
    late = bench.ours.collect("/plan")
    until(lambda: late)
    assert late[0].data == "kept"


@pytest.mark.needs("reliability")
def test_reliable_subscribers_miss_nothing_of_a_burst(bench, client):
    publish = bench.ours.burst(bench.topic_out)
    client.subscribe_reliably(bench.topic_out)
    client.settle()
    publish([f"{k}" for k in range(BURST)])
    assert [client.next() for _ in range(BURST)] == [f"{k}" for k in range(BURST)]


@pytest.mark.needs("topics")
def test_thousands_of_topics(bench, client):
    names = range(bench.topics)
    publish = {k: bench.ours.publisher(f"/out{k}") for k in names}
    seen = {k: bench.ours.collect(f"/in{k}") for k in names}
    for k in names:
        client.advertise(f"/in{k}", STRING)
        client.subscribe(f"/out{k}", STRING)
    client.settle()
    for k in (0, bench.topics // 2, bench.topics - 1):
        publish[k](m.String(f"out {k}"))
        assert client.next() == f"out {k}"
        client.publish(f"/in{k}", f"in {k}")
        until(lambda k=k: seen[k])
        assert seen[k][0].data == f"in {k}"
