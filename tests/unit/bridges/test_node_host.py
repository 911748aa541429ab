"""Nodes outside of the simulation: the same class, on a link."""

from __future__ import annotations

import time

import pytest
from live_graph import LiveGraph

from volery.bridges.nodes.deferred_connection import DeferredConnection
from volery.bridges.nodes.host import NodeHost
from volery.core.errors import GraphError, NodeError
from volery.graph.messages import Clock, String, Time, message_type
from volery.graph.nodes.node import Node
from volery.graph.service_reply import ServiceReply

TRIGGER = "std_srvs/srv/Trigger"
Response = message_type(f"{TRIGGER}_Response")


class World(LiveGraph):
    """A graph with a clock."""

    def __init__(self):
        self.now_ns = 0
        super().__init__(lambda: self.now_ns)
        self.clock = self.graph.advertise("/clock", Clock)

    def tick(self, time_ns):
        self.now_ns = time_ns
        stamp = Time(time_ns // 10**9, time_ns % 10**9)
        self.do(lambda: self.clock.publish(Clock(stamp)))


@pytest.fixture
def world():
    world = World()
    yield world
    world.close()


class Parrot(Node):
    """Repeats what it receives, on a timer too, and serves."""

    def __init__(self, **options):
        super().__init__("parrot", **options)
        self.word = self.declare_parameter("word", "polly").value
        self.times = []
        self.out = self.create_publisher(String, "said", 10)
        self.create_subscription(String, "heard", self.on_word)
        self.create_timer(0.5, self.on_timer)
        self.create_service(TRIGGER, "do", self.on_do)
        self.ask = self.create_client(TRIGGER, "/there/do")

    def on_word(self, message):
        if message.data == "break":
            raise ValueError("broken")
        self.out.publish(String(f"{self.word} {message.data}"))

    def on_timer(self):
        self.times.append(self.get_clock().now_ns())

    def on_do(self, _request, response):
        response.success, response.message = True, self.word
        return response


def spin_until(host, condition, timeout_s=60.0):
    end = time.monotonic() + timeout_s
    host.spin(lambda: condition() or time.monotonic() > end)
    assert condition()


def test_two_publishers_of_one_topic_on_one_connection(world):
    session = world.gateway.open("node")
    graph = NodeHost(session).context().graph
    first = graph.advertise("/probe", String, latched=True)
    second = graph.advertise("/probe", String)
    first.publish(String("seven"))
    first.cancel()
    second.publish(String("eight"))
    late = []
    world.do(lambda: world.graph.subscribe("/probe", late.append, String))
    world.do(lambda: None)
    assert [published.message.data for published in late] == ["eight"]
    second.cancel()
    second.cancel()
    assert session.info.publishes == ()


def test_topics_and_services_in_both_directions(world):
    session = world.gateway.open("node")
    host = NodeHost(session)
    node = Parrot(context=host.context(), namespace="/uav1", parameter_overrides={"word": "hi"})
    said, answers = [], []
    world.do(lambda: world.graph.subscribe("/uav1/said", said.append, String))
    world.do(
        lambda: world.graph.create_service("/there/do", TRIGGER, lambda _r: Response(True, "there"))
    )
    publisher = world.graph.advertise("/uav1/heard", String)
    world.do(lambda: publisher.publish(String("you")))
    spin_until(host, lambda: said)
    assert said[0].message.data == "hi you"

    assert node.ask.call().message == "there"
    node.ask.call_async().add_done_callback(lambda a: answers.append(a.result().message))
    other = world.gateway.open("caller")

    other.call("/uav1/do", None, ServiceReply(lambda r: answers.append(r.message), answers.append))
    spin_until(host, lambda: len(answers) == 2)
    assert sorted(answers) == ["hi", "there"]


def test_nodes_that_are_there_before_their_graph(world):
    opened = []

    def open_link():
        opened.append(world.gateway.open("node"))
        return opened[-1]

    late = DeferredConnection("node", open_link)
    host = NodeHost(late)
    node = Parrot(context=host.context(), namespace="/uav1", parameter_overrides={"word": "hi"})
    lost = node.create_publisher(String, "lost", 10)
    lost.publish(String("early"))
    node.create_subscription(String, "noise", node.on_word).cancel()
    host.spin_once(0.0)
    assert not opened
    said, early, answers = [], [], []
    world.do(lambda: world.graph.subscribe("/uav1/said", said.append, String))
    world.do(lambda: world.graph.subscribe("/uav1/lost", early.append, String))
    world.do(
        lambda: world.graph.create_service("/there/do", TRIGGER, lambda _r: Response(True, "there"))
    )
    late.join()
    late.join()
    assert len(opened) == 1
    publisher = world.graph.advertise("/uav1/heard", String)
    world.do(lambda: publisher.publish(String("you")))
    answer = node.ask.call_async()
    world.do(
        lambda: world.graph.call_async(
            "/uav1/do", None, ServiceReply(answers.append, answers.append)
        )
    )
    spin_until(host, lambda: said and answers and early and answer.done())
    assert [p.message.data for p in (*early, *said)] == ["early", "hi you"]
    assert answers[0].message == "hi"
    assert answer.result().message == "there"
    assert not any(info.name == "/uav1/noise" and info.subscribers for info in world.graph.topics())
    node.destroy_node()
    late.close()


def test_a_node_that_calls_a_service_at_its_start_joins_the_graph(world):
    world.do(
        lambda: world.graph.create_service("/there/do", TRIGGER, lambda _r: Response(True, "there"))
    )

    class Asking(Parrot):
        def __init__(self, **options):
            super().__init__(**options)
            self.answer = self.ask.call()

    late = DeferredConnection("node", lambda: world.gateway.open("node"))
    assert Asking(context=NodeHost(late).context(), namespace="/uav1").answer.message == "there"
    late.close()


def test_timers_can_be_put_off(world):
    host = NodeHost(world.gateway.open("node"), clock="wall")
    begin_ns = host.now_ns()
    node = Parrot(context=host.context())
    host.postpone(3 * 10**8)
    spin_until(host, lambda: node.times)
    assert node.times[0] - begin_ns >= 8 * 10**8


def test_a_service_without_a_server(world):
    host = NodeHost(world.gateway.open("node"))
    node = Parrot(context=host.context())
    with pytest.raises(GraphError, match="has no server"):
        node.ask.call()
    failed = []
    node.ask.call_async().add_done_callback(failed.append)
    spin_until(host, lambda: failed)
    assert "has no server" in str(failed[0].exception())
    with pytest.raises(GraphError, match="has no server"):
        failed[0].result()


def test_timers_go_by_the_simulated_clock(world):
    host = NodeHost(world.gateway.open("node"), clock="simulated")
    node = Parrot(context=host.context())
    assert node.get_clock().now_ns() == 0
    for time_ns in range(0, 2_000_000_001, 100_000_000):
        world.tick(time_ns)
    spin_until(host, lambda: host.now_ns() == 2_000_000_000)
    assert node.times == [500_000_000, 1_000_000_000, 1_500_000_000, 2_000_000_000]


def test_a_simulation_that_starts_again_keeps_timers_going(world):
    host = NodeHost(world.gateway.open("node"))
    node = Parrot(context=host.context())
    world.tick(10_000_000_000)
    spin_until(host, lambda: host.now_ns() == 10_000_000_000)
    world.tick(10_600_000_000)
    spin_until(host, lambda: len(node.times) == 1)
    world.tick(0)
    spin_until(host, lambda: host.now_ns() == 0)
    world.tick(600_000_000)
    spin_until(host, lambda: len(node.times) == 2)


def test_without_a_clock_the_computers_counts(world):
    host = NodeHost(world.gateway.open("node"), clock="wall")
    node = Parrot(context=host.context())
    begin_ns = time.time_ns()
    spin_until(host, lambda: node.times)
    assert begin_ns <= node.times[0] <= time.time_ns()


def test_what_a_node_breaks_ends_the_host_with_its_name(world):
    host = NodeHost(world.gateway.open("node"))
    Parrot(context=host.context(), namespace="/uav1")
    publisher = world.graph.advertise("/uav1/heard", String)
    world.do(lambda: publisher.publish(String("break")))
    with pytest.raises(NodeError, match="uav1/parrot"):
        host.spin(lambda: False)


def test_a_profile_renames(world):
    host = NodeHost(world.gateway.open("node"))
    Parrot(context=host.context({"/uav1/heard": "/mavros/text"}), namespace="/uav1")
    assert world.graph.topic_type("/mavros/text") == "std_msgs/msg/String"
    assert world.graph.topic_type("/uav1/heard") is None


def test_the_order_of_arrival_is_kept_across_topics(world):
    class Listener(Node):
        def __init__(self, **options):
            super().__init__("listener", **options)
            self.seen = []
            for topic in ("b", "a"):
                self.create_subscription(String, topic, lambda m: self.seen.append(m.data))

    host = NodeHost(world.gateway.open("node"))
    node = Listener(context=host.context())
    a, b = world.graph.advertise("/a", String), world.graph.advertise("/b", String)

    def speak():
        for k in range(5):
            (a if k % 2 else b).publish(String(str(k)))

    world.do(speak)
    spin_until(host, lambda: len(node.seen) == 5)
    assert node.seen == list("01234")


def test_cancelled_publishers_and_subscriptions_end_in_the_remote_graph(world):
    host = NodeHost(world.gateway.open("node"), clock="wall")
    first, second = (host.graph.subscribe("/a", print, String) for _ in range(2))
    publisher = host.graph.advertise("/b", String)

    def counts():
        return {t.name: (t.publishers, t.subscribers) for t in world.graph.topics()}

    assert (counts()["/a"], counts()["/b"]) == ((0, 1), (1, 0))
    first.cancel()
    assert counts()["/a"] == (0, 1)
    second.cancel()
    publisher.cancel()
    assert (counts()["/a"], counts()["/b"]) == ((0, 0), (0, 0))
