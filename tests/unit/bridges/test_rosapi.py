"""What clients learn about the graph."""

from __future__ import annotations

import math

import pytest
from rosbridge_bench import SET_BOOL, STEPS, STRING, TIME_NS, TRIGGER, Bench

from volery.bridges.rosbridge.rosapi import RosApi
from volery.graph.nodes.node import Context, Node


class Asked:
    """A graph with a client, and another one that asks rosapi."""

    def __init__(self, generation):
        self.bench = Bench(generation=generation)
        graph = self.bench.graph
        graph.advertise("/odom", "nav_msgs/msg/Odometry")
        graph.subscribe("/cmd", print, STRING)
        graph.create_service("/arm", SET_BOOL, print)
        graph.actions.create_server("/step", STEPS, print)
        self.api = RosApi(self.bench.gateway, generation, lambda: TIME_NS)
        self.api.start()
        self.worker = self.bench.peer("worker 1")
        self.worker.send("advertise", topic="/cmd", type=STRING)
        self.worker.send("subscribe", topic="/odom")
        self.worker.send("advertise_service", service="/do", type=TRIGGER)
        self.client = self.bench.peer("asks")

    def __call__(self, name, /, **args):
        self.client.send("call_service", service=f"/rosapi/{name}", args=args)
        (answer,) = self.client.read()
        return answer["values"]


class Flier(Node):
    """Declares parameters, one of which it reads each time anew."""

    def __init__(self, graph, **options):
        super().__init__("flier", context=Context(graph, None, lambda: 0), **options)
        self.declare_parameter("route", [[1.0, 2.0]])
        self.declare_parameter("far_m", math.inf)
        self.height = self.declare_parameter("height_m", 3.0, read_only=False)


@pytest.fixture
def ask():
    return Asked("ros2")


@pytest.fixture
def ask_as_ros1():
    return Asked("ros1")


def test_topics(ask):
    types = ["std_msgs/msg/String", "nav_msgs/msg/Odometry"]
    assert ask("topics") == {"topics": ["/cmd", "/odom"], "types": types}
    assert ask("topics_for_type", type="std_msgs/String") == {"topics": ["/cmd"]}
    assert ask("topic_type", topic="/odom") == {"type": "nav_msgs/msg/Odometry"}
    assert ask("topic_type", topic="/none") == {"type": ""}
    assert ask("publishers", topic="/odom") == {"publishers": ["/volery"]}
    assert ask("publishers", topic="/cmd") == {"publishers": ["/worker_1"]}
    assert ask("subscribers", topic="/odom") == {"subscribers": ["/worker_1"]}
    assert ask("subscribers", topic="/cmd") == {"subscribers": ["/volery"]}


def test_full_definitions(ask, ask_as_ros1):
    text = ask("topics_and_raw_types")["typedefs_full_text"][1]
    assert "MSG: geometry_msgs/Pose" in text
    assert "int32 sec" in text
    old = ask_as_ros1("topics_and_raw_types")
    assert old["types"] == ["std_msgs/String", "nav_msgs/Odometry"]
    assert "uint32 seq" in old["typedefs_full_text"][1]


def test_services(ask):
    assert {"/arm", "/do", "/rosapi/topics"} <= set(ask("services")["services"])
    assert ask("services_for_type", type="std_srvs/Trigger") == {"services": ["/do"]}
    assert ask("service_type", service="/arm") == {"type": SET_BOOL}
    assert ask("service_type", service="/none") == {"type": ""}
    assert ask("service_node", service="/do") == {"node": "/worker_1"}
    assert ask("service_node", service="/arm") == {"node": "/volery"}
    assert ask("service_providers", service="/do") == {"providers": ["/worker_1"]}
    assert ask("service_providers", service="/none") == {"providers": []}


def test_nodes(ask):
    assert ask("nodes")["nodes"] == ["/volery", "/rosapi", "/worker_1", "/asks"]
    worker = {"subscribing": ["/odom"], "publishing": ["/cmd"], "services": ["/do"]}
    assert ask("node_details", node="/worker_1") == worker
    own = {"subscribing": ["/cmd"], "publishing": ["/odom"], "services": ["/arm"]}
    assert ask("node_details", node="/volery") == own
    assert ask("node_details", node="/none")["services"] == []


def test_types(ask, ask_as_ros1):
    typedefs = ask("message_details", type="sensor_msgs/LaserScan")["typedefs"]
    assert [t["type"] for t in typedefs][:2] == ["sensor_msgs/LaserScan", "std_msgs/Header"]
    scan = typedefs[0]
    assert scan["fieldtypes"][-1] == "float32"
    assert scan["fieldarraylen"][-1] == 0
    assert scan["fieldarraylen"][0] == -1
    assert scan["examples"][0] == "{}"
    fixed = ask("message_details", type="sensor_msgs/msg/Imu")["typedefs"][0]
    assert fixed["fieldarraylen"][2] == 9
    assert (
        "POWER_SUPPLY_STATUS_FULL"
        in ask("message_details", type="sensor_msgs/BatteryState")["typedefs"][0]["constnames"]
    )
    assert "not known" in ask("message_details", type="no/Such")
    request = ask("service_request_details", type="std_srvs/SetBool")["typedefs"]
    assert request[0]["fieldnames"] == ["data"]
    response = ask("service_response_details", type="std_srvs/SetBool")["typedefs"]
    assert response[0]["fieldnames"] == ["success", "message"]
    old = ask_as_ros1("message_details", type="std_msgs/Header")["typedefs"]
    assert old[0]["fieldtypes"] == ["time", "string"]
    assert old[1]["fieldnames"] == ["secs", "nsecs"]


@pytest.mark.parametrize(("generation", "between"), [("ros1", "/"), ("ros2", ":")])
def test_parameters_of_nodes_are_listed_as_ros_does_and_found_by_either_name(generation, between):
    ask = Asked(generation)
    Flier(ask.bench.graph, namespace="/uav1", parameter_overrides={"height_m": 4})
    names = [f"/uav1/flier{between}{name}" for name in ("far_m", "height_m", "route")]
    assert ask("get_param_names") == {"names": [*names, "/use_sim_time"]}
    for name in ("/uav1/flier:route", "/uav1/flier/route", "uav1/flier/route"):
        assert ask("get_param", name=name)["value"] == "[[1.0, 2.0]]"
        assert ask("has_param", name=name) == {"exists": True}
    assert ask("get_param", name="/uav1/flier:far_m")["value"] == "null"
    for name in ("/uav1/flier:none", "/uav2/flier:route", "/uav1/flier/none"):
        assert ask("has_param", name=name) == {"exists": False}
        assert ask("get_param", name=name)["value"] == "null"


def test_a_refusal_is_an_error_in_ros_1_too_although_its_response_has_no_field_for_it(ask_as_ros1):
    Flier(ask_as_ros1.bench.graph, namespace="/uav1")
    assert ask_as_ros1("set_param", name="/uav1/flier/height_m", value="2") == {}
    assert "read-only" in ask_as_ros1("set_param", name="/uav1/flier/route", value="[]")
    assert "declared" in ask_as_ros1("delete_param", name="/uav1/flier/route")


def test_parameters_of_nodes_are_set_or_refused(ask):
    node = Flier(ask.bench.graph, namespace="/uav1")
    assert ask("set_param", name="/uav1/flier:height_m", value="2")["successful"]
    assert node.height.value == 2
    assert ask("get_param", name="/uav1/flier/height_m")["value"] == "2.0"
    assert ask("set_param", name="/uav1/flier/height_m", value="2.5")["successful"]
    refused = {
        ("/uav1/flier:route", "[]"): "read-only",
        ("/uav1/flier:height_m", '"high"'): "must be like 3.0",
        ("/uav1/flier:height_m", "true"): "must be like 3.0",
        ("/uav1/flier:height_m", "NaN"): "JSON",
        ("/uav1/flier:hight_m", "2"): "no parameter 'hight_m'; known: far_m, height_m, route",
        ("/uav1/flier/hight_m", "2"): "no parameter 'hight_m'",
        ("/uav3/flier:height_m", "2"): "no node '/uav3/flier'",
    }
    for (name, value), reason in refused.items():
        answer = ask("set_param", name=name, value=value)
        assert not answer["successful"]
        assert reason in answer["reason"]
    answer = ask("delete_param", name="/uav1/flier:height_m")
    assert "declared by its node" in answer["reason"]
    assert node.height.value == 2.5
    node.destroy_node()
    assert ask("get_param_names") == {"names": ["/use_sim_time"]}


def test_parameters(ask):
    assert ask("get_param_names") == {"names": ["/use_sim_time"]}
    assert ask("get_param", name="/use_sim_time")["value"] == "true"
    assert ask("set_param", name="gain", value="[1, 2]")["successful"]
    assert ask("get_param", name="/gain")["value"] == "[1, 2]"
    assert ask("has_param", name="gain") == {"exists": True}
    assert ask("search_param", name="gain") == {"global_name": "/gain"}
    assert ask("delete_param", name="gain")["successful"]
    assert not ask("delete_param", name="gain")["successful"]
    assert "JSON" in ask("set_param", name="gain", value="{")["reason"]
    assert ask("get_param", name="gain", default="7")["value"] == "7"
    missing = ask("get_param", name="gain")
    assert (missing["value"], missing["successful"]) == ("null", False)


def test_time_version_actions(ask, ask_as_ros1):
    assert ask("get_time") == {"time": {"sec": 5, "nanosec": 7}}
    assert ask_as_ros1("get_time") == {"time": {"secs": 5, "nsecs": 7}}
    assert ask("get_ros_version") == {"version": 2, "distro": "jazzy"}
    assert ask_as_ros1("get_ros_version")["version"] == 1
    assert ask("action_servers") == {"action_servers": ["/step"]}
    assert ask("action_type", action="/step") == {"type": STEPS}
    assert SET_BOOL in ask("interfaces")["interfaces"]


def test_they_go_with_their_server(ask):
    second = RosApi(ask.bench.gateway, "ros2", lambda: 0)
    second.start()  # what is offered already stays where it is
    second.stop()
    assert ask.bench.graph.has_service("/rosapi/topics")
    ask.api.stop()
    assert not ask.bench.graph.has_service("/rosapi/topics")
