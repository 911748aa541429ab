"""Tests the node interface: names, parameters, timers and services as in rclpy."""

import pytest

from volery.core.errors import GraphError
from volery.graph.graph import Graph
from volery.graph.messages import String
from volery.graph.nodes.node import Context, Node


class FakeTimers:
    def __init__(self):
        self.entries = []

    def every(self, period_s, callback, *, wanted=None):
        self.entries.append((period_s, callback))

    def forget(self, callback):
        self.entries = [entry for entry in self.entries if entry[1] != callback]


@pytest.fixture
def context():
    return Context(Graph(lambda: 7), FakeTimers(), lambda: 7)


def test_names_resolve_like_ros(context):
    node = Node("watcher", context=context, namespace="/uav1")
    assert node.resolve("scan") == "/uav1/scan"
    assert node.resolve("/clock") == "/clock"
    assert node.resolve("~/state") == "/uav1/watcher/state"
    assert (node.get_name(), node.get_namespace()) == ("watcher", "/uav1")


def test_publish_and_subscribe(context):
    node = Node("a", context=context, namespace="/uav1")
    got = []
    node.create_subscription(String, "text", lambda m: got.append(m.data), 5)
    node.create_publisher(String, "text", 5).publish(String("x"))
    context.graph.deliver()
    assert got == ["x"]
    assert node.get_clock().now_ns() == 7


def test_latched_publishers_serve_late_subscribers(context):
    node = Node("late", context=context, namespace="/uav1")
    node.create_publisher(String, "map", latched=True).publish(String("m"))
    node.create_publisher(String, "plain").publish(String("p"))
    context.graph.deliver()
    got = []
    for topic in ("map", "plain"):
        node.create_subscription(String, topic, lambda message: got.append(message.data))
    context.graph.deliver()
    assert got == ["m"]


def test_parameters(context):
    node = Node("a", context=context, parameter_overrides={"speed": 3, "sped": 1})
    assert node.declare_parameter("speed", 1.0).value == 3
    assert node.get_parameter("speed").value == 3
    assert node.unused_overrides() == ["sped"]
    with pytest.raises(GraphError, match="not declared"):
        node.get_parameter("other")
    wrong = Node("b", context=context, parameter_overrides={"speed": "fast"})
    with pytest.raises(GraphError, match="must be like"):
        wrong.declare_parameter("speed", 1.0)


def test_timers_and_services(context):
    node = Node("a", context=context, namespace="/uav1")
    node.create_timer(0.1, lambda: None)
    assert context.timers.entries[0][0] == 0.1
    with pytest.raises(GraphError, match="timer period"):
        node.create_timer(0.0, lambda: None)

    def answer(_request, response):
        response.success = True
        return response

    node.create_service("std_srvs/srv/Trigger", "go", answer)
    client = node.create_client("std_srvs/srv/Trigger", "go")
    assert client.service_is_ready()
    assert client.call().success
    with pytest.raises(GraphError, match="queue depth"):
        node.create_publisher(String, "t", -1)


def test_a_parameter_is_declared_once(context):
    node = Node("a", context=context)
    node.declare_parameter("speed", 1.0)
    with pytest.raises(GraphError, match="already"):
        node.declare_parameter("speed", 2.0)
