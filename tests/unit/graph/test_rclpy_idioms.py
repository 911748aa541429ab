"""Nodes written for rclpy: coroutines, bytes, waiting for transforms, clocks, late imports."""

import subprocess
import sys
import textwrap
import threading
from types import SimpleNamespace

import pytest

from volery.core.errors import GraphError, NodeError
from volery.graph.graph import Graph
from volery.graph.messages import String, Transform, TransformStamped, Vector3, header
from volery.graph.nodes import qos_events
from volery.graph.nodes.node import Context
from volery.graph.nodes.qos_events import PublisherEventCallbacks, SubscriptionEventCallbacks
from volery.graph.nodes.rclpy_modules import Node, contents
from volery.graph.nodes.ros_time import Clock, ClockType, ROSClock
from volery.graph.nodes.service_client import Future
from volery.graph.nodes.tf2 import Buffer, TransformListener
from volery.graph.parameters import ParameterSetting

TRIGGER = "std_srvs/srv/Trigger"


@pytest.fixture
def node():
    return Node("idioms", context=Context(Graph(lambda: 7), SimpleNamespace(), lambda: 7))


def contents_of(module):
    return {**contents(), **qos_events.contents()}[module]


def receive(node, callback):
    """Call a callback of the node with a message."""
    node.create_subscription(String, "text", callback)
    node.create_publisher(String, "text").publish(String("go"))
    node._context.graph.deliver()


def test_a_callback_awaits_a_service(node):
    node.create_service(TRIGGER, "ask", lambda request, response: answered(response))
    client, heard = node.create_client(TRIGGER, "ask"), []

    def answered(response):
        response.message = "yes"
        return response

    async def on_text(message):
        response = await client.call_async()
        heard.append((message.data, response.message))

    receive(node, on_text)
    assert heard == [("go", "yes")]


def test_a_callback_goes_on_when_its_future_is_done(node):
    future, heard = Future(), []

    async def on_text(message):
        heard.append("before")
        heard.append(await future)

    receive(node, on_text)
    assert heard == ["before"]
    future.set_result("after")
    assert heard == ["before", "after"]


def test_failures_after_an_await_name_the_callback(node):
    future = Future()

    async def on_text(message):
        await future
        raise KeyError("x")

    receive(node, on_text)
    with pytest.raises(NodeError, match=r"message on /text \(on_text\).*KeyError"):
        future.set_result(None)


def test_only_futures_are_awaited(node):
    class Forever:
        def __await__(self):
            yield self

    async def on_text(message):
        await Forever()

    with pytest.raises(NodeError, match="futures of rclpy only"):
        receive(node, on_text)


def test_a_service_may_be_a_coroutine_that_does_not_wait(node):
    done, pending = Future(), Future()
    done.set_result("done")

    async def respond(request, response):
        response.message = await done
        return response

    async def wait(request, response):
        await pending
        return response

    node.create_service(TRIGGER, "respond", respond)
    node.create_service(TRIGGER, "wait", wait)
    assert node.create_client(TRIGGER, "respond").call().message == "done"
    with pytest.raises(GraphError, match="a service responds at once"):
        node.create_client(TRIGGER, "wait").call()


def test_messages_as_bytes(node):
    coding = contents()["rclpy.serialization"]
    data = coding["serialize_message"](String("as bytes"))
    assert coding["deserialize_message"](data, String).data == "as bytes"
    raw, plain = [], []
    node.create_subscription(String, "text", raw.append, 1, raw=True)
    node.create_subscription(String, "text", lambda message: plain.append(message.data), 1)
    node.create_publisher(String, "text").publish(data)
    node._context.graph.deliver()
    assert (raw, plain) == ([data], ["as bytes"])


def moved(child, time_ns=7, x=2.0):
    return TransformStamped(header(time_ns, "map"), child, Transform(Vector3(x, 0.0, 0.0)))


def test_waiting_for_a_transform(node):
    buffer, heard = Buffer(node=node), []

    async def on_text(message):
        found = await buffer.lookup_transform_async("map", "probe")
        heard.append(found.transform.translation.x)

    receive(node, on_text)
    future = buffer.wait_for_transform_async("map", "probe", None)
    buffer.set_transform(moved("other"))
    assert (heard, future.done()) == ([], False)
    buffer.set_transform(moved("probe"))
    assert (heard, future.result()) == ([2.0], True)
    assert buffer.wait_for_transform_async("map", "probe", None).done()


def test_a_transform_that_is_there_is_reported_after_the_callback(node):
    """Callbacks take locks, which the report takes too."""
    soon, lock, heard = [], threading.Lock(), []
    node._context.timers.at = lambda time_ns, action: soon.append((time_ns, action))
    buffer = Buffer()
    TransformListener(buffer, node)
    buffer.set_transform(moved("probe"))

    def on_ready(future):
        with lock:
            heard.append(future.result())

    def on_text(message):
        with lock:
            buffer.wait_for_transform_async("map", "probe", None).add_done_callback(on_ready)

    receive(node, on_text)
    ((time_ns, report),) = soon
    report()
    assert (time_ns, heard) == (7, [True])


def test_frames_as_yaml():
    buffer = Buffer()
    assert buffer.all_frames_as_yaml() == "{}"
    for time_ns in (1_000_000_000, 3_000_000_000):
        buffer.set_transform(moved("probe", time_ns))
    text = buffer.all_frames_as_yaml()
    assert text.splitlines()[:2] == ["probe:", "  parent: 'map'"]
    assert "  rate: 0.500\n" in text
    assert "  buffer_length: 2.000\n" in text


def test_values_are_reported_after_they_are_set(node):
    heard = []

    def on_set(settings):
        heard.append([(setting.name, setting.value) for setting in settings])

    node.add_post_set_parameters_callback(on_set)
    node.declare_parameter("speed", 1.0)
    node.set_parameters([ParameterSetting("speed", value=2)])
    node.set_parameters([ParameterSetting("speed", value="fast")])  # is refused
    node._context.graph.parameters.get("/idioms", "speed").set(3.0)
    assert heard == [[("speed", 1.0)], [("speed", 2)], [("speed", 3.0)]]


def test_a_callback_before_a_value_is_set_may_add_others(node):
    def prepare(settings):
        more = [ParameterSetting("high", value=s.value + 1.0) for s in settings if s.name == "low"]
        return [*settings, *more]

    node.declare_parameter("low", 1.0)
    node.declare_parameter("high", 2.0)
    node.add_pre_set_parameters_callback(prepare)
    node.set_parameters([ParameterSetting("low", value=3.0)])
    assert node.get_parameter("high").value == 4.0
    outside = node._context.graph.parameters.get("/idioms", "low")
    outside.set(5.0)
    assert (node.get_parameter("low").value, node.get_parameter("high").value) == (5.0, 6.0)
    node.add_pre_set_parameters_callback(lambda _: [ParameterSetting("high", value="x")])
    with pytest.raises(GraphError, match=r"'high' must be like 2\.0"):
        outside.set(6.0)


def test_clocks_without_a_node_have_the_time_of_the_computer():
    assert Clock().clock_type == ClockType.SYSTEM_TIME
    assert ROSClock().clock_type == ClockType.ROS_TIME
    assert ROSClock().now().nanoseconds > 1e18
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    assert steady.now() <= steady.now()


def test_events_that_never_occur_are_accepted_and_others_refused(node):
    events = SubscriptionEventCallbacks(message_lost=print)
    node.create_subscription(String, "text", print, 1, event_callbacks=events)
    with pytest.raises(GraphError, match="no matched events"):
        PublisherEventCallbacks(matched=print)


def test_services_are_not_introspected(node):
    state = contents_of("rclpy.service_introspection")["ServiceIntrospectionState"]
    client = node.create_client(TRIGGER, "ask")
    service = node.create_service(TRIGGER, "ask", lambda request, response: response)
    for each in (client, service):
        each.configure_introspection(node.get_clock(), 10, state.OFF)
        with pytest.raises(GraphError, match="no service events"):
            each.configure_introspection(node.get_clock(), 10, state.CONTENTS)


def test_a_script_imports_node_files_after_volery(tmp_path):
    """In a process of its own, with no ROS on the path."""
    (tmp_path / "avoid.py").write_text(
        "from geometry_msgs.msg import Twist\n"
        "from message_filters import Subscriber\n"
        "from rclpy.impl.logging_severity import LoggingSeverity\n"
        "from rclpy.node import Node\n"
        "from sensor_msgs_py import point_cloud2\n"
        "class Avoid(Node):\n"
        "    message = Twist\n"
    )
    program = """
        import sys
        import volery
        assert "numpy" not in sys.modules, "import volery imports nothing"
        from avoid import Avoid
        from volery.scenario import NodeEntry
        assert NodeEntry(node=Avoid).node == "avoid:Avoid"
        assert Avoid.message.__msgtype__ == "geometry_msgs/msg/Twist"
        from volery.graph.nodes.imports import withdraw_ros_imports
        withdraw_ros_imports()
        for name in ("rclpy", "geometry_msgs", "no_such_msgs"):
            try:
                __import__(name)
            except ModuleNotFoundError:
                continue
            raise AssertionError(name)
    """
    (tmp_path / "fly.py").write_text(textwrap.dedent(program))
    subprocess.run([sys.executable, "fly.py"], check=True, timeout=300, cwd=tmp_path)


def test_other_missing_modules_stay_missing():
    program = "import volery, importlib.util as u; assert u.find_spec('my_msgs') is None"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=300)
