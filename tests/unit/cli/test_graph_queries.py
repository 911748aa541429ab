"""What `volery topic hz` and `volery service call` make of what a graph answers."""

import pytest

from volery.cli.node import _check_namespace
from volery.cli.services import refusal_of
from volery.cli.topics import Window
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type


@pytest.mark.parametrize("line", [Window.rate_line, Window.bandwidth_line])
def test_a_rate_is_not_repeated_where_nothing_comes(line):
    window = Window(100)
    for k in range(5):
        window.add(0.1 * k, 1000)
    assert window.take_line(line).startswith("average")
    assert window.take_line(line) == "no new messages"
    window.add(0.5, 1000)
    assert window.take_line(line).startswith("average")


def test_a_refusal_of_a_trigger_is_found():
    response = message_type("std_srvs/srv/Trigger_Response")
    assert refusal_of(response(True, "")) is None
    assert refusal_of(response(False, "uav1 has crashed")) == "uav1 has crashed"


def test_a_refusal_of_the_standard_is_found():
    response = zero_message("simulation_interfaces/srv/GetSimulationState_Response")
    response.result = message_type("simulation_interfaces/msg/Result")(result=1, error_message="")
    assert refusal_of(response) is None
    response.result = message_type("simulation_interfaces/msg/Result")(
        result=3, error_message="paused"
    )
    assert refusal_of(response) == "paused"


def test_answers_without_a_word_on_success_are_no_refusals():
    assert refusal_of(zero_message("rosapi_msgs/srv/Topics_Response")) is None


class Topics:
    """A graph that says which topics it has."""

    def __init__(self, *topics):
        self._topics = dict.fromkeys(topics, "nav_msgs/msg/Odometry")

    def topic_types(self):
        return self._topics


class Silent:
    """A graph that cannot say which topics it has, such as that of ROS 1 without rosapi."""

    def call(self, service, request, reply):
        reply.fail(GraphError(f"service '{service}' has no server"))


def test_a_node_without_its_uav_is_warned_of(capsys):
    graph = Topics("/uav1/odom", "/uav2/odom", "/clock")
    _check_namespace(graph, "/uav9")
    assert "no topic below /uav9; its UAVs: uav1, uav2" in capsys.readouterr().err
    for namespace in ("/uav1", "uav2", "/"):
        _check_namespace(graph, namespace)
    _check_namespace(Topics(), "/uav9")  # without a list of topics
    _check_namespace(Silent(), "/uav9")
    assert capsys.readouterr().err == ""
