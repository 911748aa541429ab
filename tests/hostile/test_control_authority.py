"""A UAV that one operator holds is protected from all others, however its name is spelled."""

from __future__ import annotations

import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from volery.bridges.rosbridge.fields import absolute
from volery.bridges.rosbridge.rosapi_parameters import NamedParameters, Parameters
from volery.core.errors import BridgeError, CommandError, GraphError
from volery.graph.graph import Graph
from volery.graph.nodes.node import Context, Node
from volery.graph.parameters import Parameter
from volery.mavlink.mavros import Mavros
from volery.runtime.vehicles.control_authority import ControlAuthority, operator_name, same_operator
from volery.runtime.vehicles.control_targets import names_in, parts_of
from volery.scenario.faults import parse_fault
from volery.server.access_policy import OperatorPolicy, service_of
from volery.server.operator_names import OperatorNames

NODE, PARAMETER = "/uav1/gap_following", "height_m"


@pytest.fixture
def operators():
    operators = ControlAuthority(lambda: ["uav1", "uav2"])
    operators.take("uav1", "Anna")
    return operators


@pytest.fixture
def bob(operators):
    names = OperatorNames()
    names.sign_in("Anna")
    return OperatorPolicy(names.sign_in("Bob"), names, operators)


def call(service, args=None):
    return {"op": "call_service", "service": service, "args": args}


@pytest.mark.parametrize(
    "operation",
    [
        call("/rosapi/set_param", {"name": "/uav1/gap_following:height_m", "value": "9.0"}),
        call("/rosapi/set_param", {"name": "uav1/gap_following:height_m", "value": "9.0"}),
        call("/rosapi/set_param", {"name": "/uav1/gap_following/height_m", "value": "9.0"}),
        call("/rosapi/set_param", ["/uav1/gap_following:height_m", "9.0"]),
        call("/rosapi/delete_param", {"name": " /uav1/x"}),
        call("/uav1/land"),
        call("uav1/land"),
        call("/uav1/land#3"),
        call("//uav1/land"),
        call("/uav2/../uav1/land"),
        call("/delete_entity", {"entity": "uav1"}),
        call("/delete_entity", ["uav1"]),
        call("/set_entity_state", {"entity": b"uav1"}),
        call("/volery/inject_fault", {"fault": '{"kind": "radio", "uav": "uav1"}'}),
        call("/volery/end_fault", {"fault": '{"kind": "radio", "uav": "uav1"}'}),
        call("/volery/inject_fault", {"fault": '{"kind": "radio", "uav": " uav1 "}'}),
        call("/volery/inject_fault", {"fault": '\n {"kind": "radio", "\\u0075av": "\\u0075av1"}'}),
        call("/volery/inject_fault", ['{"kind": "radio", "uav": "uav1"}']),
        call("/volery/inject_fault", '[{"uav": "uav1"}]'),
        call("/do", {"a": [[{"b": [{"c": [{"d": ["uav1"]}]}]}]]}),
        {"op": "publish", "topic": "/uav1/cmd_vel", "msg": {}},
        {"op": "publish", "topic": "uav1/cmd_vel", "msg": {}},
        {"op": "advertise", "topic": "/mission/uav1/plan", "type": "x"},
        {"op": "advertise_service", "service": "/uav1/x", "type": "x"},
        {"op": "advertise_action", "action": "/uav1/x", "type": "x"},
        {"op": "send_action_goal", "action": "/uav1/fly", "args": {}},
        {"op": "send_action_goal", "action": "/fly", "args": {"uav": "uav1"}},
    ],
)
def test_another_operator_cannot_command_it(bob, operation):
    with pytest.raises(BridgeError, match="uav1 is held by Anna"):
        bob.check(operation)


@pytest.mark.parametrize(
    "operation",
    [
        {"op": "advertise_service", "topic": "/free", "service": "/uav1/x", "type": "x"},
        {"op": "advertise_action", "topic": "/free", "action": "/uav1/x", "type": "x"},
        {"op": "advertise_action", "service": "/free", "action": "/uav1/x", "type": "x"},
        {"op": "publish", "topic": "/uav1/cmd_vel", "service": "/free", "msg": {}},
    ],
)
def test_a_field_that_does_not_count_hides_nothing(bob, operation):
    with pytest.raises(BridgeError, match="uav1 is held by Anna"):
        bob.check(operation)


@pytest.mark.parametrize(
    "operation",
    [
        call("/mavros/cmd/command", {"command": 400, "param1": 0.0, "param2": 21196.0}),
        call("mavros/cmd/land"),
        call("/mavros/set_mode"),
        {"op": "publish", "topic": "/mavros/setpoint_velocity/cmd_vel", "msg": {}},
        {"op": "publish", "topic": "mavros/setpoint_raw/attitude", "msg": {}},
    ],
)
def test_a_name_that_does_not_contain_its_uav_is_protected_too(operation):
    graph = Graph(lambda: 0)
    node = Node("autopilot", context=Context(graph, None, graph.now_ns), namespace="/uav1")
    Mavros(node, None, "/mavros")
    operators = ControlAuthority(lambda: ["uav1", "uav2"], graph.moved_uavs.of)
    names = OperatorNames()
    anna = OperatorPolicy(names.sign_in("Anna"), names, operators)
    ben = OperatorPolicy(names.sign_in("Ben"), names, operators)
    operators.take("uav2", "Anna")
    assert ben.check(operation)
    operators.take("uav1", "Anna")
    with pytest.raises(BridgeError, match="uav1 is held by Anna"):
        ben.check(operation)
    assert anna.check(operation)
    node.destroy_node()
    assert ben.check(operation)


@pytest.mark.parametrize(
    "operation",
    [
        call("/uav2/land"),
        call("/rosapi/set_param", {"name": "/uav2/gap_following:height_m", "value": "9.0"}),
        call("/rosapi/get_param", {"name": "/uav1/gap_following:height_m"}),
        call("/delete_entity", {"entity": "uav12"}),
        {"op": "publish", "topic": "/uav12/cmd_vel", "msg": {}},
        {"op": "subscribe", "topic": "/uav1/odom"},
    ],
)
def test_what_is_about_others_passes(bob, operation):
    assert bob.check(operation)


def test_arguments_too_deep_to_be_looked_through_are_refused(bob):
    deep = "uav1"
    for _ in range(100):
        deep = [deep]
    with pytest.raises(BridgeError, match="nested too deeply"):
        bob.check(call("/do", deep))
    with pytest.raises(BridgeError, match="nested too deeply"):
        bob.check(call("/do", {"text": "[" * 100_000}))


PIECES = (
    *("/", "//", "uav1", "uav2", "..", ".", ":", "#3", " ", "\t", "~", "{", '"', "\u200b"),
    *("cmd_vel", "gap_following", "height_m", "UAV1", "\uff55av1"),
)
SPELLINGS = st.lists(st.sampled_from(PIECES), max_size=9).map("".join)


@given(SPELLINGS)
@example("/uav1/cmd_vel")
@example("uav1")
def test_whatever_the_graph_resolves_to_a_uav_is_seen_as_about_it(spelling):
    graph, name = Graph(lambda: 0), absolute(spelling)
    try:
        graph.advertise(name, "std_msgs/msg/String")
    except GraphError:
        return
    if name.split("/")[1] == "uav1":
        assert "uav1" in parts_of(spelling)


@given(SPELLINGS)
def test_whatever_names_a_service_of_a_uav_is_seen_as_about_it(spelling):
    name = service_of({"service": spelling})
    if name.split("/")[1] == "uav1":
        assert "uav1" in parts_of(name)


@given(SPELLINGS)
@example("/uav1/gap_following:height_m")
@example("uav1/gap_following/height_m")
def test_whatever_names_a_parameter_of_a_uav_is_seen_as_about_it(spelling):
    graph = Graph(lambda: 0)
    own = Parameter(PARAMETER, 1.0, read_only=False)
    graph.parameters.declare(NODE, own)
    named = NamedParameters(Parameters(), graph.parameters, ros1=False)
    try:
        named.set(spelling, "2.0")
    except GraphError:
        return
    if own.value == 2.0:
        assert "uav1" in set(names_in({"name": spelling, "value": "2.0"}))


@given(st.sampled_from(["uav1", " uav1", "uav1\n", "\u00a0uav1", "uav1\u3000"]), st.booleans())
def test_whatever_fault_is_of_a_uav_is_seen_as_about_it(uav, ascii_only):
    text = json.dumps({"kind": "radio", "uav": uav}, ensure_ascii=ascii_only)
    try:
        fault = parse_fault(json.loads(text))
    except CommandError:
        return
    if fault.uav == "uav1":
        assert "uav1" in set(names_in({"fault": text}))


# ------------------------------------------------------------------------------------- operators


@pytest.mark.parametrize(
    "spelling", ["Anna", "Anna ", " anna", "ANNA", "An\u200bna", "Anna\x00", "Ａnna", "\tAnna\n"]
)
def test_one_operator_however_the_name_is_spelled(operators, spelling):
    assert same_operator("Anna", spelling)
    operators.take("uav1", spelling)
    assert operator_name(operators.operator_of("uav1")).casefold() == "anna"
    names = OperatorNames()
    names.sign_in("Anna")
    assert spelling in names
    assert names.sign_in(spelling) not in ("Anna", spelling)
    with pytest.raises(BridgeError, match="another operator"):
        names.rename(names.sign_in("Bob"), spelling)


@pytest.mark.parametrize("name", ["Ann", "Anna 2", "An na", "Анна", ""])
def test_other_operators(name):
    assert not same_operator("Anna", name)


def test_no_operator_takes_a_name_by_spelling_it_otherwise(bob):
    with pytest.raises(BridgeError, match="another operator"):
        bob.check(call("/volery/take_control", {"uav": "uav2", "operator": "ANNA "}))
    assert bob.name == "Bob"


def test_an_operator_spelled_otherwise_keeps_control(operators):
    names = OperatorNames()
    anna = OperatorPolicy(names.sign_in("anna"), names, operators)
    assert anna.check(call("/uav1/land"))
    operators.release("uav1", "ANNA")
    assert operators.operator_of("uav1") == ""


@given(st.text(max_size=60))
def test_normal_names_stay_as_they_are(text):
    name = operator_name(text)
    assert operator_name(name) == name
    assert name == name.strip()
    assert same_operator(text, name)
