"""Nodes that trigger each other without end, silent partners, posts after the end."""

from __future__ import annotations

import logging

import pytest
from whole_world import Client

from volery.core.errors import CommandError, NodeError
from volery.graph.graph import Graph
from volery.graph.messages import String
from volery.graph.nodes.node import Context, Node


class Echo(Node):
    """Answers what comes on one topic on another one."""

    def __init__(self, name, input_topic, output_topic, **options):
        super().__init__(name, **options)
        self.publisher = self.create_publisher(String, output_topic)
        self.create_subscription(String, input_topic, self.publisher.publish)


@pytest.fixture
def start(simulate, flat_data):
    simulation = simulate(flat_data)

    def start(name, input_topic, output_topic):
        engine = simulation._engine
        context = Context(simulation.graph, engine, lambda: simulation.time_ns)
        return Echo(name, input_topic, output_topic, namespace="/uav1", context=context)

    start.simulation = simulation
    return start


@pytest.mark.timeout(600, func_only=True)
def test_two_nodes_that_answer_each_other_are_named(start):
    start("ping", "/a", "/b")
    start("pong", "/b", "/a")
    start.simulation.graph.advertise("/a", String).publish(String("x"))
    with pytest.raises(NodeError, match="endlessly") as caught:
        start.simulation.step(1)
    for word in ("'/a'", "'/b'", "/uav1/ping", "/uav1/pong"):
        assert word in str(caught.value)


@pytest.mark.timeout(600, func_only=True)
def test_a_node_that_answers_itself_is_named(start):
    start("self", "/a", "/a")
    start.simulation.graph.advertise("/a", String).publish(String("x"))
    with pytest.raises(NodeError, match="/uav1/self"):
        start.simulation.step(1)


@pytest.mark.timeout(600, func_only=True)
def test_a_client_that_starts_such_a_loop_does_not_end_the_run(start, caplog):
    start("ping", "/a", "/b")
    start("pong", "/b", "/a")
    client = Client(start.simulation)
    with caplog.at_level(logging.WARNING):
        client.publish("/a", String("x"))
    assert "endlessly" in caplog.text
    assert "stranger" in caplog.text
    start.simulation.step(1)


@pytest.mark.timeout(600, func_only=True)
def test_a_loop_that_multiplies_ends_too(monkeypatch):
    monkeypatch.setattr("volery.graph.response_chains._MAX_RESPONSES_AT_ONCE", 5_000)
    graph = Graph(lambda: 0)
    publisher = graph.advertise("/a", String)

    def twice(published):
        publisher.publish(published.message)
        publisher.publish(published.message)

    graph.subscribe("/a", twice)
    publisher.publish(String("x"))
    with pytest.raises(NodeError, match="'/a'"):
        graph.deliver()


def test_many_answers_to_many_messages_are_no_loop():
    """As of a large swarm, in which each answers the one before, at many instants."""
    now = [0]
    graph, seen = Graph(lambda: now[0]), []
    topics = [f"/uav{k}/hello" for k in range(300)]
    publishers = [graph.advertise(topic, String) for topic in topics]
    for k, topic in enumerate(topics[:-1]):
        graph.subscribe(topic, lambda p, k=k: publishers[k + 1].publish(p.message))
    graph.subscribe(topics[-1], seen.append)
    for instant in range(100):
        now[0] = instant
        publishers[0].publish(String("x"))
        graph.deliver()
    assert len(seen) == 100


# ------------------------------------------------------------------------------ silent partners


class PressedError(Exception):
    """What the command line raises between two steps once Ctrl-C was pressed."""


@pytest.mark.timeout(600, func_only=True)
def test_ctrl_c_is_handled_while_a_partner_is_silent(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.clock.add_partner("silent", period_s=0.02, timeout_s=1e6)

    def look(_progress):
        if simulation.time_ns:
            raise PressedError

    with pytest.raises(PressedError):
        simulation.run(1.0, on_progress=look)


@pytest.mark.timeout(600, func_only=True)
def test_quit_is_handled_while_a_partner_is_silent(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.clock.add_partner("silent", period_s=0.02, timeout_s=1e6)
    simulation.post(simulation.clock.quit)
    simulation.run(1.0)
    assert simulation.clock.quitting


@pytest.mark.timeout(600, func_only=True)
def test_quit_at_a_barrier_ends_the_run(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.clock.add_partner("silent", period_s=0.02, timeout_s=1e6)

    def look(_progress):
        if simulation.time_ns:
            simulation.clock.quit()

    simulation.run(1.0, on_progress=look)
    assert simulation.time_ns == 20_000_000


# ----------------------------------------------------------------------------- after the end


def test_what_is_posted_after_close_fails(simulate, flat_data):
    simulation = simulate(flat_data)
    client = Client(simulation)
    waiting = simulation.post(lambda: 1)
    simulation.close()
    for future in (waiting, simulation.post(lambda: 1), client.session.post(lambda: 1)):
        with pytest.raises(CommandError, match="closed"):
            future.result(1.0)
    responses = []
    from volery.graph.service_reply import ServiceReply

    client.session.call("/get_entities", None, ServiceReply(responses.append, responses.append))
    assert "closed" in str(responses[0])
