"""What viewers and operators may do, without a network."""

import pytest

from volery.core.errors import BridgeError
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.server.access_policy import READ_ONLY_SERVICES, OperatorPolicy, ViewerPolicy
from volery.server.operator_names import OperatorNames


def call(service, **args):
    return {"op": "call_service", "service": service, "args": args}


@pytest.mark.parametrize(
    "operation",
    [
        {"op": "subscribe", "topic": "/uav1/odom"},
        {"op": "unsubscribe", "topic": "/uav1/odom"},
        call("/get_entities"),
        call("rosapi/topics"),
        call("/rosapi/topics#3"),
    ],
)
def test_a_viewer_looks_on(operation):
    assert ViewerPolicy().check(operation)


@pytest.mark.parametrize(
    "operation",
    [
        {"op": "publish", "topic": "/uav1/cmd_vel", "msg": {}},
        {"op": "advertise", "topic": "/tf", "type": "tf2_msgs/TFMessage"},
        {"op": "advertise_service", "service": "/get_entities", "type": "x"},
        {"op": "send_action_goal", "action": "/simulate_steps"},
        {"op": "service_response", "service": "/a", "id": "1"},
        {"op": "anything"},
        call("/uav1/land"),
        call("/rosapi/set_param", name="a", value="1"),
        call("/volery/take_control", uav="uav1"),
        call("/volery/start_recording", path="a.mcap"),
        call("/load_world"),
        {"op": "call_service"},
    ],
)
def test_a_viewer_changes_nothing(operation):
    with pytest.raises(BridgeError, match="a viewer may not"):
        ViewerPolicy().check(operation)


def test_services_that_change_nothing_say_so_by_their_names():
    """The list can be read over: getters, lists, questions of rosapi."""
    for name in READ_ONLY_SERVICES:
        last = name.rsplit("/", 1)[-1]
        is_query = last == "info" or last.startswith(("get_", "list_"))
        assert name.startswith("/rosapi/") or is_query, name
        assert "set" not in last.split("_")


class Two:
    """Two operators at one simulation of two UAVs."""

    def __init__(self):
        self.operators, names = ControlAuthority(lambda: ("uav1", "uav2")), OperatorNames()
        self.now_s = 0.0
        self.anna = OperatorPolicy(names.sign_in("Anna"), names, self.operators, lambda: self.now_s)
        self.ben = OperatorPolicy(names.sign_in("Ben"), names, self.operators, lambda: self.now_s)
        self.operators.take("uav1", "Anna")


COMMANDS = [
    {"op": "publish", "topic": "/uav1/cmd_vel", "msg": {}},
    {"op": "publish", "topic": "uav1/goal_pose", "msg": {}},
    {"op": "advertise", "topic": "/uav1/odom", "type": "x"},
    {"op": "send_action_goal", "action": "/uav1/fly", "args": {}},
    call("/uav1/land"),
    call("uav1/land"),
    call("/uav1/land#7"),
    call("/set_entity_state", entity="uav1", state={}),
    call("/delete_entity", entity="uav1"),
    call("/volery/reset_uav", name="uav1"),
    call("/volery/inject_fault", fault='{"kind": "motor", "uav": "uav1", "rotor": 0}'),
    {"op": "call_service", "service": "/delete_entity", "args": ["uav1"]},
]


@pytest.mark.parametrize("operation", COMMANDS)
def test_a_uav_that_is_held_obeys_its_operator_alone(operation):
    two = Two()
    with pytest.raises(BridgeError, match="uav1 is held by Anna"):
        two.ben.check(operation)
    assert two.anna.check(operation)
    two.operators.release("uav1", "Anna")
    assert two.ben.check(operation)


@pytest.mark.parametrize(
    "operation",
    [
        call("/uav2/land"),
        call("/uav10/land"),
        {"op": "publish", "topic": "/uav2/cmd_vel"},
        {"op": "subscribe", "topic": "/uav1/odom"},
        call("/get_entity_state", entity="uav1"),
        call("/volery/set_speed", factor=2.0),
    ],
)
def test_all_else_is_free(operation):
    assert Two().ben.check(operation)


def test_a_stream_of_commands_is_refused_once_a_second():
    two, command = Two(), COMMANDS[0]
    num_errors = 0
    for two.now_s in (0.0, 0.1, 0.5, 0.99, 1.0, 1.5, 2.1):
        try:
            assert two.ben.check(command) is False
        except BridgeError:
            num_errors += 1
    assert num_errors == 3


def test_no_operator_speaks_for_another():
    two = Two()
    for service in ("/volery/release_control", "/volery/hand_over"):
        with pytest.raises(BridgeError, match="you are Ben, not Anna"):
            two.ben.check(call(service, uav="uav1", operator="Anna", to="Ben"))
    with pytest.raises(BridgeError, match="another operator is called Anna"):
        two.ben.check(call("/volery/take_control", uav="uav2", operator="Anna"))
    with pytest.raises(BridgeError, match="no operator is called 'Carl'"):
        two.anna.check(call("/volery/hand_over", uav="uav1", to="Carl"))
    with pytest.raises(BridgeError, match="must be an object"):
        two.ben.check(
            {"op": "call_service", "service": "/volery/release_control", "args": ["uav1"]}
        )
    own = call("/volery/take_control", uav="uav2")
    assert two.ben.check(own)
    assert own["args"] == {"uav": "uav2", "operator": "Ben"}


def test_a_operator_may_take_another_name_with_the_first_uav():
    two = Two()
    wanted = call("/volery/take_control", uav="uav2", operator="Benjamin")
    assert two.ben.check(wanted)
    assert two.ben.name == "Benjamin"
    assert two.anna.check(call("/volery/hand_over", uav="uav1", to="Benjamin"))
    with pytest.raises(BridgeError, match="no operator is called 'Ben'"):
        two.anna.check(call("/volery/hand_over", uav="uav1", to="Ben"))


def test_names_are_ones_own():
    names = OperatorNames()
    assert [names.sign_in("Anna"), names.sign_in("Anna")] == ["Anna", "Anna 2"]
    assert [names.sign_in(), names.sign_in("\n")] == ["operator 1", "operator 2"]
    names.sign_out("Anna")
    assert names.sign_in("Anna") == "Anna"
    assert len(names.sign_in("x" * 500)) <= 40
