"""Nodes written for rclpy: coroutines, bytes, waiting for transforms, clocks, late imports."""

import math
import subprocess
import sys
import textwrap
import threading
from types import SimpleNamespace

import pytest

from volery.core.errors import GraphError, NodeError
from volery.graph.graph import Graph
from volery.graph.messages import (
    LaserScan,
    String,
    Transform,
    TransformStamped,
    Vector3,
    header,
    message_type,
)
from volery.graph.nodes import qos_events
from volery.graph.nodes.node import Context
from volery.graph.nodes.qos_events import PublisherEventCallbacks, SubscriptionEventCallbacks
from volery.graph.nodes.rclpy_modules import Node, contents
from volery.graph.nodes.ros_time import Clock, ClockType, Duration, ROSClock
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
    client, received = node.create_client(TRIGGER, "ask"), []

    def answered(response):
        response.message = "yes"
        return response

    async def on_text(message):
        response = await client.call_async()
        received.append((message.data, response.message))

    receive(node, on_text)
    assert received == [("go", "yes")]


def test_a_callback_goes_on_when_its_future_is_done(node):
    future, received = Future(), []

    async def on_text(message):
        received.append("before")
        received.append(await future)

    receive(node, on_text)
    assert received == ["before"]
    future.set_result("after")
    assert received == ["before", "after"]


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
    buffer, received = Buffer(node=node), []

    async def on_text(message):
        found = await buffer.lookup_transform_async("map", "probe")
        received.append(found.transform.translation.x)

    receive(node, on_text)
    future = buffer.wait_for_transform_async("map", "probe", None)
    buffer.set_transform(moved("other"))
    assert (received, future.done()) == ([], False)
    buffer.set_transform(moved("probe"))
    assert (received, future.result()) == ([2.0], True)
    assert buffer.wait_for_transform_async("map", "probe", None).done()


def test_a_transform_that_is_there_is_reported_after_the_callback(node):
    """Callbacks take locks, which the report takes too."""
    soon, lock, received = [], threading.Lock(), []
    node._context.timers.at = lambda time_ns, action: soon.append((time_ns, action))
    buffer = Buffer()
    TransformListener(buffer, node)
    buffer.set_transform(moved("probe"))

    def on_ready(future):
        with lock:
            received.append(future.result())

    def on_text(message):
        with lock:
            buffer.wait_for_transform_async("map", "probe", None).add_done_callback(on_ready)

    receive(node, on_text)
    ((time_ns, report),) = soon
    report()
    assert (time_ns, received) == (7, [True])


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
    received = []

    def on_set(settings):
        received.append([(setting.name, setting.value) for setting in settings])

    node.add_post_set_parameters_callback(on_set)
    node.declare_parameter("speed", 1.0)
    node.set_parameters([ParameterSetting("speed", value=2)])
    node.set_parameters([ParameterSetting("speed", value="fast")])  # is refused
    node._context.graph.parameters.get("/idioms", "speed").set(3.0)
    assert received == [[("speed", 1.0)], [("speed", 2)], [("speed", 3.0)]]


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
    subprocess.run([sys.executable, "fly.py"], check=True, timeout=900, cwd=tmp_path)


def test_other_missing_modules_stay_missing():
    program = "import volery, importlib.util as u; assert u.find_spec('my_msgs') is None"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=900)


def test_a_callback_with_two_arguments_receives_the_times_too(node):
    received = []
    node.create_subscription(String, "text", lambda message, info: received.append(info), 1)
    node.create_subscription(String, "text", lambda message, more=3: received.append(more), 1)
    node.create_subscription(String, "text", received.append, 1)
    node.create_publisher(String, "text").publish(String("go"))
    node._context.graph.deliver()
    info, more, message = received
    assert (info["source_timestamp"], info["received_timestamp"]) == (7, 7)
    assert (more, message.data) == (3, "go")


def test_a_callback_may_be_replaced(node):
    received = []
    subscription = node.create_subscription(String, "text", print, 1)
    subscription.callback = lambda message, info: received.append(message.data)
    node.create_publisher(String, "text").publish(String("go"))
    node._context.graph.deliver()
    assert received == ["go"]
    assert subscription.get_publisher_count() == 1


def test_what_a_node_has_created_can_be_listed(node):
    out = node.create_publisher(String, "text", 5)
    inside = node.create_subscription(String, "text", print, 1)
    service = node.create_service(TRIGGER, "ask", lambda request, response: response)
    assert [*node.publishers][1:] == [out]
    assert [*node.subscriptions] == [inside]
    assert [*node.services] == [service]
    assert (out.qos_profile.depth, inside.msg_type, out.wait_for_all_acked()) == (5, String, True)
    assert node.count_services("ask") == 1
    assert node.get_fully_qualified_node_names() == ["/idioms"]
    assert node.wait_for_node("/idioms", 1.0)
    assert node.context.ok()
    with out, node:
        pass
    assert node.count_publishers("text") == 0
    assert not node.wait_for_node("/idioms", 1.0)


@pytest.mark.parametrize(
    ("method", "words"),
    [
        ("create_rate", "use a timer"),
        ("create_guard_condition", "use a timer"),
        ("get_publishers_info_by_topic", "count_publishers"),
        ("get_client_names_and_types_by_node", "get_topic_names_and_types"),
        ("set_descriptor", "declare_parameter"),
        ("add_waitable", "use a timer"),
    ],
)
def test_methods_that_are_refused_say_what_to_use(node, method, words):
    with pytest.raises(GraphError, match=words):
        getattr(node, method)("x")


@pytest.mark.parametrize(
    ("name", "topic"),
    [
        ("~", "/uav1/idioms"),
        ("~/a", "/uav1/idioms/a"),
        ("{node}/a", "/uav1/idioms/a"),
        ("{ns}/a", "/uav1/a"),
        ("{namespace}/a", "/uav1/a"),
        ("/a", "/a"),
    ],
)
def test_names_are_expanded(name, topic):
    context = Context(Graph(lambda: 7), SimpleNamespace(), lambda: 7)
    assert Node("idioms", context=context, namespace="/uav1").resolve_topic_name(name) == topic


def test_a_parameter_with_a_type_alone_has_no_value(node):
    errors = contents()["rclpy.exceptions"]
    uninitialized = errors["ParameterUninitializedException"]
    node.declare_parameter("speed", ParameterSetting.Type.DOUBLE)
    with pytest.raises(uninitialized, match="'speed' is declared without a value"):
        node.get_parameter("speed")
    assert issubclass(uninitialized, errors["ParameterException"])
    assert node.get_parameter_or("speed", ParameterSetting("speed", value=1.0)).value == 1.0
    (result,) = node.set_parameters([ParameterSetting("speed", value="fast")])
    assert not result.successful
    node.set_parameters([ParameterSetting("speed", value=2)])
    assert node.get_parameter("speed").value == 2.0
    node.declare_parameter("any")
    assert node.get_parameter("any").value is None


def test_profiles_by_number_and_by_old_and_short_names():
    names = contents_of("rclpy.qos")
    profile, reliability = names["QoSProfile"], names["ReliabilityPolicy"]
    old = reliability.RMW_QOS_POLICY_RELIABILITY_RELIABLE
    assert (
        old is reliability.RELIABLE is reliability(1) is reliability.get_from_short_key("Reliable")
    )
    numbered = profile(depth=1, reliability=1, durability=1, history=1)
    assert (numbered.reliable, numbered.latched) == (True, True)
    assert profile(depth=0).depth == profile().depth
    with pytest.raises(ValueError, match="9 is not a valid"):
        profile(reliability=9)
    presets = names["QoSPresetProfiles"]
    assert presets.get_from_short_key("sensor_data") is names["qos_profile_sensor_data"]
    assert names["qos_profile_action_status_default"].latched


def test_durations_are_multiplied():
    assert Duration(seconds=2) * 1.5 == Duration(seconds=3)
    assert str(Duration(seconds=1) * math.inf) == "Infinite"
    with pytest.raises(ValueError, match="nan"):
        Duration(seconds=1) * math.nan


def test_clocks_do_not_wait_and_do_not_jump(node):
    clock = node.get_clock()
    assert clock.ros_time_is_active
    assert not ROSClock().ros_time_is_active
    with pytest.raises(GraphError, match="use a timer"):
        clock.sleep_for(Duration(seconds=1))
    clock.create_jump_callback(None, post_callback=print).unregister()


def test_waiting_for_a_message_is_refused():
    with pytest.raises(GraphError, match="subscribe"):
        contents()["rclpy.wait_for_message"]["wait_for_message"](String, None, "text")


def test_requests_of_another_service_are_refused(node):
    node.create_service(TRIGGER, "ask", lambda request, response: response)
    client = node.create_client(TRIGGER, "ask")
    other = message_type("std_srvs/srv/SetBool_Request")()
    for wrong, found in ((other, "SetBool_Request"), ({}, "a dict")):
        with pytest.raises(GraphError, match=f"takes {TRIGGER}_Request, not .*{found}"):
            client.call(wrong)


def test_a_received_sequence_cannot_grow(node):
    received = []
    node.create_subscription(LaserScan, "scan", received.append, 1)
    node.create_publisher(LaserScan, "scan").publish(LaserScan(ranges=[1.0, 2.0]))
    node._context.graph.deliver()
    ranges = received[0].ranges
    with pytest.raises(AttributeError, match="its length is fixed"):
        ranges.append(3.0)
    assert (ranges == [1.0, 2.0], ranges != [1.0, 2.0]) == (False, True)  # as `array.array`
