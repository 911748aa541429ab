"""Tests rclpy's times, timers, loggers, handles and parameters in a running simulation."""

import logging

import pytest

from volery.core.errors import GraphError, NodeError
from volery.graph.messages import String, message_type
from volery.graph.nodes.logger import LoggingSeverity
from volery.graph.nodes.node import Context, Node
from volery.graph.nodes.ros_time import ClockType, Duration, Time
from volery.graph.parameters import ParameterNotDeclaredError, ParameterSetting, ParameterType

Setting = ParameterSetting


@pytest.fixture
def made(simulate, flat_data):
    """A simulation and a node in it."""
    simulation = simulate(flat_data)
    context = Context(simulation.graph, simulation._engine, lambda: simulation.time_ns)
    return simulation, Node("shape", context=context, namespace="/uav1")


def test_times_and_durations():
    time = Time(seconds=2, nanoseconds=5, clock_type=ClockType.ROS_TIME)
    assert Time.from_msg(time.to_msg()) == time
    assert (time + Duration(seconds=1.5)).seconds_nanoseconds() == (3, 500_000_005)
    assert (time - Time.from_msg((time - Duration(seconds=2)).to_msg())).nanoseconds == 2 * 10**9
    assert Duration(seconds=-1) < Duration(nanoseconds=1)
    assert Duration.from_msg(Duration(seconds=-0.5).to_msg()).nanoseconds == -500_000_000
    with pytest.raises(TypeError, match="ROS_TIME and SYSTEM_TIME"):
        _ = time - Time(seconds=1)
    with pytest.raises(ValueError, match="not be negative"):
        Time(nanoseconds=-1)


def test_timers_are_cancelled_restarted_and_destroyed(made):
    simulation, node = made
    rings = []
    timer = node.create_timer(0.1, lambda: rings.append(simulation.time_ns // 10**6))
    idle = node.create_timer(0.1, lambda: rings.append("idle"), autostart=False)
    simulation.run(0.25)
    timer.cancel()
    assert (timer.is_canceled(), idle.is_canceled()) == (True, True)
    simulation.run(0.25)
    timer.reset()
    assert timer.time_until_next_call() == 100_000_000
    simulation.run(0.05)
    timer.reset()  # a watchdog that is fed
    simulation.run(0.25)
    assert rings == [100, 200, 650, 750]
    entries = len(simulation._engine.timer_agenda._heap)
    assert node.destroy_timer(timer)
    assert not node.destroy_timer(timer)
    assert len(simulation._engine.timer_agenda._heap) == entries - 1
    simulation.run(0.3)
    assert len(rings) == 4


def test_the_period_of_a_timer_may_change(made):
    simulation, node = made
    rings = []
    timer = node.create_timer(0.1, lambda: rings.append(simulation.time_ns // 10**6))
    assert timer.clock.now() == node.get_clock().now()
    simulation.run(0.15)
    timer.timer_period_ns = 20_000_000
    simulation.run(0.05)
    timer.cancel()
    timer.timer_period_ns = 10_000_000
    simulation.run(0.05)
    assert rings == [100, 170, 190]
    with pytest.raises(GraphError, match="timer period"):
        timer.timer_period_ns = 0


def test_snapshots_hold_what_timers_do(made):
    simulation, node = made
    rings = []
    timer = node.create_timer(0.3, lambda: rings.append(simulation.time_ns // 10**6))
    timer.timer_period_ns = 100_000_000
    simulation.run(0.05)
    timer.reset()
    state, base = simulation._engine.get_state(), node.save_base_state()
    simulation.run(0.2)
    timer.timer_period_ns = 300_000_000
    timer.cancel()
    first = list(rings)
    rings.clear()
    simulation._engine.set_state(state)
    node.restore_base_state(base)
    simulation.run(0.2)
    assert rings == first == [150, 250]


def test_handles_can_be_destroyed(made):
    simulation, node = made
    received = []
    publisher = node.create_publisher(String, "text", 10)
    subscription = node.create_subscription(String, "text", lambda m: received.append(m.data), 10)
    assert publisher.get_subscription_count() == 1
    assert publisher.topic_name == subscription.topic_name == "/uav1/text"
    publisher.publish(String(data="a"))
    simulation.run(0.01)
    assert node.destroy_subscription(subscription)
    publisher.publish(String(data="b"))
    simulation.run(0.01)
    assert received == ["a"]
    assert node.destroy_publisher(publisher)
    service = node.create_service("std_srvs/srv/Trigger", "do", lambda _q, response: response)
    client = node.create_client("std_srvs/srv/Trigger", "do")
    assert client.wait_for_service(timeout_sec=1.0)
    assert node.destroy_service(service)
    assert not client.wait_for_service(timeout_sec=1.0)
    with pytest.raises(GraphError, match="cannot wait"):
        any(client.wait_for_service(timeout_sec=1.0) for _ in range(2000))


def test_levels_once_throttle_and_children(made, caplog):
    simulation, node = made
    logger = node.get_logger()
    caplog.set_level(logging.DEBUG, "volery.nodes")

    def speak():
        logger.info("once", once=True)
        logger.info("throttled", throttle_duration_sec=0.25)
        logger.info("not first", skip_first=True)
        logger.debug("low")

    node.create_timer(0.1, speak)
    simulation.run(0.45)
    said = [record.getMessage() for record in caplog.records if record.name.endswith("shape")]
    assert said == ["once", "throttled", "not first", "not first", "throttled", "not first"]
    assert caplog.records[0].node_time == "0.100000000"
    child = logger.get_child("part")
    assert child.name == "uav1.shape.part"
    logger.set_level(LoggingSeverity.ERROR)
    assert (child.warning("w"), child.error("e")) == (False, True)


@pytest.mark.parametrize(
    ("kind", "limits", "good", "bad"),
    [
        ("integer", (0, 12, 5), (0, 5, 10, 12), (7, 11, 13, -5)),
        ("floating_point", (-1.0, 1.0, 0.1), (-1.0, -0.7, 0.3, 1.0), (0.05, 0.31)),
        ("floating_point", (0.0, 1.0, 0.0), (0.05, 0.31), (1.1,)),
    ],
)
def test_a_parameter_keeps_the_steps_of_its_range(made, kind, limits, good, bad):
    _, node = made
    names = {"integer": "IntegerRange", "floating_point": "FloatingPointRange"}
    bounds = message_type(f"rcl_interfaces/msg/{names[kind]}")(*limits)
    descriptor = message_type("rcl_interfaces/msg/ParameterDescriptor")
    node.declare_parameter("p", limits[0], descriptor(**{f"{kind}_range": [bounds]}))
    for value in good:
        assert node.set_parameters([Setting("p", value=value)])[0].successful, value
    for value in bad:
        assert not node.set_parameters([Setting("p", value=value)])[0].successful, value
    assert getattr(node.describe_parameter("p"), f"{kind}_range")[0].step == limits[2]


def test_parameters_as_in_rclpy(made):
    _, node = made
    descriptor = message_type("rcl_interfaces/msg/ParameterDescriptor")
    bounds = message_type("rcl_interfaces/msg/FloatingPointRange")
    speed = descriptor(
        description="m/s", floating_point_range=[bounds(from_value=0.0, to_value=5.0)]
    )
    node.declare_parameters("", [("speed", 1.0, speed), ("names", ["a"]), ("count", 3)])
    node.declare_parameter("fixed", 1, descriptor(read_only=True))
    assert node.get_parameter("speed").get_parameter_value().double_value == 1.0
    assert node.get_parameter("names").get_parameter_value().string_array_value == ["a"]
    assert node.get_parameter("count").type_ is ParameterType.INTEGER
    assert node.describe_parameter("speed").floating_point_range[0].to_value == 5.0

    def set_to(name, value):
        return node.set_parameters([Setting(name, value=value)])[0]

    assert set_to("speed", 2.0).successful
    assert "0 to 5" in set_to("speed", 9.0).reason
    assert "read-only" in set_to("fixed", 2).reason
    asked = []

    def on_set(settings):
        asked.append([(s.name, s.value) for s in settings])
        result = message_type("rcl_interfaces/msg/SetParametersResult")
        return result(successful=settings[0].value != 4.0, reason="not four")

    node.add_on_set_parameters_callback(on_set)
    assert set_to("speed", 4.0).reason == "not four"
    both = [Setting("speed", value=3.0), Setting("speed", ParameterType.DOUBLE, 9.0)]
    assert not node.set_parameters_atomically(both).successful
    assert node.get_parameter("speed").value == 2.0
    assert asked == [[("speed", 4.0)]]
    with pytest.raises(ParameterNotDeclaredError):
        node.set_parameters([Setting("wings", value=2)])
    with pytest.raises(ValueError, match="not a DOUBLE"):
        Setting("speed", ParameterType.DOUBLE, "fast")


def test_a_service_that_fails_is_named_and_the_simulation_goes_on(made, caplog):
    simulation, node = made

    def fail(_request, _response):
        return 1 / 0

    node.create_service("std_srvs/srv/Trigger", "do", fail)
    logs = []
    simulation.graph.subscribe_all(lambda p: logs.append(p) if p.topic == "/rosout" else None)
    session = simulation.gateway.open("a client")
    from volery.graph.service_reply import ServiceReply

    failures = []
    session.call("/uav1/do", None, ServiceReply(print, failures.append))
    simulation.run(0.02)
    assert "in its service /uav1/do (fail): ZeroDivisionError" in str(failures[0])
    assert [p.message.level for p in logs] == [50]
    assert "ZeroDivisionError" in caplog.text
    with pytest.raises(NodeError, match=r"/uav1/shape failed at 0.020 s in its service"):
        simulation.graph.call("/uav1/do")


def test_names_of_users_attributes_do_not_collide(simulate, flat_data):
    simulation = simulate(flat_data)
    context = Context(simulation.graph, simulation._engine, lambda: simulation.time_ns)

    class Wilful(Node):
        def __init__(self):
            super().__init__("wilful", context=context)
            self._name = self._timers = self._parameters = self._logger = self._held = None
            self._thinker = self._namespace = self._destroyed = self._run = None
            self.count = 0
            self.create_timer(0.01, self.on_timer)

        def on_timer(self):
            self.count += 1
            self.get_logger().debug("fine")

    node = Wilful()
    simulation.run(0.05)
    assert node.count == 5
    node.destroy_node()
