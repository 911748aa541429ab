"""Nodes and tools on a ROS 2 graph, over DDS."""

from __future__ import annotations

import threading

import pytest
from live_graph import LiveGraph
from ros2_bench import DOMAIN, Other
from ros_tcp_client import until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.nodes.host import NodeHost
from volery.bridges.ros2.bridge import Ros2Bridge
from volery.bridges.ros2.client import Ros2Client
from volery.bridges.ros2.environment import Ros2Environment
from volery.cli.topics import list_topics
from volery.core.errors import GraphError
from volery.graph.connection import call_and_wait
from volery.graph.messages import Clock, String, Time, message_type
from volery.graph.nodes.node import Node
from volery.graph.parameter_values import parameter_message, plain_of

TRIGGER = "std_srvs/srv/Trigger"
STRING = "std_msgs/msg/String"
Triggered = message_type(f"{TRIGGER}_Response")
TERMS = Ros2Environment(domain_id=DOMAIN + 5)


class Parrot(Node):
    """Repeats what it receives, serves, and reads a parameter each time anew."""

    def __init__(self, **options):
        super().__init__("parrot", **options)
        self.word = self.declare_parameter("word", "polly", read_only=False)
        self.out = self.create_publisher(String, "said", 10)
        self.create_subscription(String, "heard", self.on_word)
        self.create_service(TRIGGER, "do", lambda _q, response: Triggered(True, self.word.value))
        self.stamps = []

    def on_word(self, message):
        self.stamps.append(self.get_clock().now_ns())
        self.out.publish(String(f"{self.word.value} {message.data}"))


class Simulated(LiveGraph):
    """A graph with a clock behind the bridge."""

    def __init__(self):
        super().__init__()
        self.clock = self.graph.advertise("/clock", Clock)
        self.words = self.graph.advertise("/uav1/heard", STRING)
        self.said = []
        self.do(lambda: self.graph.subscribe("/uav1/said", self.said.append, STRING))
        self.graph.create_service("/ours", TRIGGER, lambda _q: Triggered(True, "ours"))
        self.bridges = BridgeHost(self.gateway)
        self.bridges.open(Ros2Bridge(TERMS))

    def tick(self, time_ns):
        stamp = Time(time_ns // 10**9, time_ns % 10**9)
        self.do(lambda: self.clock.publish(Clock(stamp)))

    def close(self):
        self.bridges.close()
        super().close()


@pytest.fixture(scope="module")
def simulated():
    made = Simulated()
    yield made
    made.close()


@pytest.fixture(scope="module")
def link(simulated):
    made = Ros2Client(TERMS, "/parrot_program")
    yield made
    made.close()


@pytest.fixture(scope="module")
def node(link):
    host = NodeHost(link)
    made = Parrot(context=host.context(), namespace="/uav1")
    thread = threading.Thread(target=host.spin)
    thread.start()
    yield made
    host.stop()
    thread.join()
    made.destroy_node()


@pytest.fixture(scope="module")
def other(simulated):
    made = Other(TERMS)
    yield made
    made.close()


def counts(simulated):
    return {t.name: (t.publishers, t.subscribers) for t in simulated.graph.topics()}


def test_a_node_of_ours_is_a_ros2_node(simulated, node):
    until(lambda: counts(simulated)["/uav1/heard"][1] == 1)  # the bridge has found its subscription
    until(lambda: counts(simulated)["/clock"][1] == 1)

    def clock_has_arrived():
        simulated.tick(5 * 10**9)
        return node.get_clock().now_ns() == 5 * 10**9

    until(clock_has_arrived)

    def answers():
        simulated.do(lambda: simulated.words.publish(String("hello")))
        return simulated.said

    until(answers)
    assert simulated.said[0].message.data == "polly hello"
    assert node.stamps[0] == 5 * 10**9  # it goes by the simulation's clock


def test_its_parameters_are_those_of_a_ros2_node(node, other):
    names = other.call("/uav1/parrot/list_parameters", "rcl_interfaces/srv/ListParameters").result
    assert names.names == ["use_sim_time", "word"]
    results = other.call(
        "/uav1/parrot/set_parameters",
        "rcl_interfaces/srv/SetParameters",
        parameters=[parameter_message("word", "coco"), parameter_message("word", 3)],
    ).results
    assert [r.successful for r in results] == [True, False]
    assert node.word.value == "coco"
    values = other.call(
        "/uav1/parrot/get_parameters", "rcl_interfaces/srv/GetParameters", names=["word"]
    ).values
    assert plain_of(values[0]) == "coco"


def test_its_services_are_called(node, other):
    assert other.call("/uav1/do", TRIGGER).message in ("polly", "coco")


def test_a_link_finds_topics_that_are_only_subscribed(simulated, link, other):
    other.subscribe("/wanted", STRING)
    until(lambda: link.topic_types().get("/wanted") == STRING)


def test_a_list_leaves_out_hidden_topics_and_names_the_graph(monkeypatch, capsys):
    class Found:
        where = "DDS domain 7 (this machine)"
        topics = {"/b": STRING, "/a/_action/status": STRING}  # noqa: RUF012

        def topic_types(self):
            return self.topics

        def close(self):
            pass

    monkeypatch.setattr("volery.cli.topics.open_link", lambda *_: Found())
    list_topics("ros2://7", types=False)
    assert capsys.readouterr().out == "/b\n"
    Found.topics = {}
    list_topics("ros2://7", types=False)
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", f"no topics found: {Found.where}\n")


def test_a_link_finds_topics_and_services(simulated, link):
    until(lambda: "/clock" in link.topic_types())
    assert link.topic_types()["/clock"] == "rosgraph_msgs/msg/Clock"
    until(lambda: "/ours" in link.service_types())
    assert link.service_types()["/ours"] == TRIGGER
    assert call_and_wait(link, "/ours", None, 60.0).message == "ours"


def test_a_link_says_what_is_not_there(link, monkeypatch):
    monkeypatch.setattr("volery.bridges.ros2.client._LONGEST_LOOK_S", 0.1)
    with pytest.raises(GraphError, match="service '/nowhere' has no server"):
        call_and_wait(link, "/nowhere", None, 60.0)
    with pytest.raises(GraphError, match="no topic '/nowhere'"):
        link.subscribe("/nowhere", wake=lambda: None)
    with pytest.raises(GraphError, match="not known"):
        link.advertise("/x", "no_pkg/msg/Nothing")
    with pytest.raises(GraphError, match="does not allow"):
        link.advertise("/1x", STRING)
    with pytest.raises(GraphError, match="needs"):
        call_and_wait(link, "/ours", String("x"), 60.0)
    with pytest.raises(GraphError, match="not advertised"):
        link.publish("/never", String("x"))


def test_a_latched_message_awaits_late_links(link):
    link.advertise("/kept", STRING, latched=True)
    link.publish("/kept", String("kept"))
    late = Ros2Client(TERMS, "/late")
    woken = threading.Event()
    queue = late.subscribe("/kept", STRING, wake=woken.set)
    assert woken.wait(60.0)
    assert [p.message.data for p in queue.take()] == ["kept"]
    late.close()
    link.unadvertise("/kept")
    assert link.published_type("/kept") is None


def test_a_client_that_has_left_does_nothing(simulated):
    link = Ros2Client(TERMS, "/leaver")
    link.create_service("/mine", TRIGGER, lambda _q, reply: reply.answer(Triggered(True, "")))
    with pytest.raises(GraphError, match="already"):
        link.create_service("/mine", TRIGGER, lambda _q, _r: None)
    link.destroy_service("/mine")
    link.close()
    link.close()
    with pytest.raises(GraphError, match="is closed"):
        link.advertise("/x", STRING)
