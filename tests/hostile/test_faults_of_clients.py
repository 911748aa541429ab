"""Requests of clients never end the run: it is refused, or logged, and the engine goes on."""

from __future__ import annotations

import json
import logging
import re

import numpy as np
import pytest
from whole_world import Client, leaves, nasty_values, offer_rosapi, put, whole_data

from volery.core.errors import NodeError, ScenarioError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import String, message_type
from volery.graph.nodes.node import Context, Node
from volery.scenario.load import parse_scenario

INJECT = "volery_interfaces/srv/InjectFault_Request"
RAW = re.compile(r"\b[A-Z]\w*Error\b|Fraction\(|Traceback|exception")
"""Words of Python that no client should have to read."""


def inject(client, **fault):
    return client.call("/volery/inject_fault", message_type(INJECT)(json.dumps(fault)))


@pytest.fixture
def client(simulate, flat_data):
    return Client(simulate(flat_data))


IMPOSSIBLE = {
    "under the ground": {"kind": "displacement", "uav": "uav1", "offset_m": [0, 0, -5]},
    "beyond the terrain": {"kind": "displacement", "uav": "uav1", "offset_m": [1e5, 0, 0]},
    "beyond -1e+06": {"kind": "displacement", "uav": "uav1", "offset_m": [0, 0, 1e300]},
    "finite": {"kind": "displacement", "uav": "uav1", "offset_m": [float("nan"), 0, 0]},
    "velocity_m_s": {"kind": "gust", "velocity_m_s": [61, 0, 0]},
    "at_s": {"kind": "motor", "uav": "uav1", "rotor": 0, "at_s": 1e300},
    "until_s": {"kind": "motor", "uav": "uav1", "rotor": 0, "until_s": 1e300},
    "rotor": {"kind": "motor", "uav": "uav1", "rotor": 2**70},
    "offset_m": {"kind": "displacement", "uav": "uav1", "at_s": 5.0, "offset_m": [1e30, 0, 0]},
    "uav9": {"kind": "displacement", "uav": "uav9", "offset_m": [0, 0, 1]},
    "table": [["kind", "gust"]],
}


@pytest.mark.parametrize("word", IMPOSSIBLE)
def test_faults_that_cannot_be_are_refused_when_they_are_given(client, word):
    text = json.dumps(IMPOSSIBLE[word])
    before = client.simulation._engine.deadlines.get_state()
    response = client.call("/volery/inject_fault", message_type(INJECT)(text))
    assert not response.success
    assert word in response.message
    assert not RAW.search(response.message)
    assert client.simulation._engine.deadlines.get_state() == before
    client.simulation.step(20)


def test_a_displacement_into_an_obstacle_is_refused(simulate, tmp_path):
    data = whole_data(tmp_path)
    del data["nodes"], data["radio"]
    data["types"] = {"f450": {"sensors": [{"kind": "imu"}]}}
    data["uavs"] = [{"type": "f450", "position_m": [20.0, 50.0]}]
    client = Client(simulate(data))
    block = np.array([27.5, 64.5, 2.0]) - client.simulation.uavs["uav1"].position_map
    response = inject(client, kind="displacement", uav="uav1", offset_m=block.tolist())
    assert not response.success
    assert "inside" in response.message


def test_a_fault_of_a_client_that_becomes_impossible_changes_nothing(client, caplog):
    """The UAV stands on the ground when the time of the fault comes."""
    fault = {"kind": "displacement", "uav": "uav1", "offset_m": [0, 0, -5]}
    assert inject(client, **fault, at_s=0.05).success
    before = client.simulation.uavs["uav1"].position_map
    with caplog.at_level(logging.WARNING):
        client.simulation.step(100)
    np.testing.assert_allclose(client.simulation.uavs["uav1"].position_map, before, atol=0.01)
    assert "stranger" in caplog.text
    assert "displacement" in caplog.text
    details = [
        event.detail for event in client.simulation.diagnostics.events if event.kind == "fault"
    ]
    assert "under the ground" in details[-1]


@pytest.mark.parametrize(
    ("fault", "word"),
    [
        ({"kind": "gust", "velocity_m_s": [61.0, 0.0, 0.0], "at_s": 7.0}, "velocity_m_s"),
        ({"kind": "displacement", "uav": "uav1", "offset_m": [0.0, 0.0, -5.0]}, "under the ground"),
        ({"kind": "motor", "uav": "uav1", "rotor": 0, "at_s": 1e300}, "at_s"),
    ],
)
def test_faults_of_a_scenario_are_checked_before_it_starts(simulate, flat_data, fault, word):
    flat_data["faults"] = [{"kind": "motor", "uav": "uav1", "rotor": 0}, fault]
    with pytest.raises(ScenarioError, match=r"faults\[1\].*" + word):
        simulate(flat_data)


def test_a_message_that_breaks_what_receives_it_does_not_end_the_run(client, caplog):
    simulation, seen = client.simulation, []

    def break_down(_published):
        raise ZeroDivisionError("a bug")

    simulation.graph.subscribe("/talk", break_down, String)
    simulation.graph.subscribe("/talk", seen.append, String)
    with caplog.at_level(logging.WARNING):
        client.publish("/talk", String("hello"))
    assert len(seen) == 1
    assert "/talk" in caplog.text
    assert "stranger" in caplog.text
    simulation.step(5)


def test_what_a_client_causes_at_second_hand_does_not_end_the_run_either(client):
    simulation = client.simulation
    second = simulation.graph.advertise("/second", String)
    simulation.graph.subscribe("/first", lambda _: second.publish(String("on")), String)
    seen = []
    simulation.graph.subscribe("/second", lambda _: 1 / 0, String)
    simulation.graph.subscribe("/second", seen.append, String)
    client.publish("/first", String("go"))
    simulation.step(5)
    assert [published.message.data for published in seen] == ["on"]
    assert simulation.time_ns >= 5_000_000


def test_a_node_that_breaks_by_itself_still_ends_the_run(client):
    publisher = client.simulation.graph.advertise("/own", String)
    client.simulation.graph.subscribe("/own", lambda _: 1 / 0, String)
    publisher.publish(String("x"))
    with pytest.raises((ZeroDivisionError, NodeError)):
        client.simulation.step(1)


def test_a_node_that_breaks_later_on_a_clients_value_names_the_client(client):
    """The run ends, as with every mistake of a node, and it is clear what brought it about."""
    simulation = client.simulation
    context = Context(simulation.graph, simulation._engine, lambda: simulation.time_ns)
    node = Node("trusting", context=context)
    kept = []
    node.create_subscription(String, "/number", lambda message: kept.append(message.data))
    node.create_timer(0.01, lambda: [int(text) for text in kept])
    client.publish("/number", String("12"))
    simulation.step(20)
    client.publish("/number", String("nan"))
    with pytest.raises(NodeError, match=r"trusting.*timer.*'nan'.*from stranger on /number"):
        simulation.step(20)


def test_a_service_that_breaks_names_itself_not_pythons_error(client, caplog):
    client.simulation.graph.create_service("/broken", "std_srvs/srv/Trigger", lambda _: {}["uav2"])
    response = client.call("/broken", None)
    assert "/broken" in str(response)
    assert not RAW.search(str(response))
    assert "KeyError" in caplog.text
    client.simulation.step(1)


def test_a_publication_that_cannot_be_is_logged_once(client, caplog):
    client.session.advertise("/talk", String.__msgtype__)
    for _ in range(3):
        client.session.publish("/talk", message_type("std_msgs/msg/Bool")(True))
    client.simulation.process_commands()
    assert caplog.text.count("/talk' from stranger") == 1


def test_releasing_a_uav_without_operator_is_refused(client):
    request = message_type("volery_interfaces/srv/ReleaseControl_Request")("uav1", "")
    response = client.call("/volery/release_control", request)
    assert not response.success
    assert "does not hold" in response.message


def test_an_infinite_landing_speed_is_refused(simulate, flat_data):
    flat_data["uavs"] = [{"type": "f450", "position_m": [0.0, 0.0, 5.0]}]
    client = Client(simulate(flat_data))
    client.simulation.step(10)
    client.simulation.uavs["uav1"].land()
    client.simulation.step(10)
    request = message_type("volery_interfaces/srv/SetLandingSpeed_Request")(float("inf"))
    response = client.call("/uav1/set_landing_speed", request)
    assert not response.success
    assert "finite" in response.message


def test_reasons_do_not_repeat_all_that_a_client_sent(client):
    request = zero_message("simulation_interfaces/srv/GetEntityState_Request")
    request.entity = "x" * 1_000_000
    assert len(client.call("/get_entity_state", request).result.error_message) < 2_000


# ------------------------------------------------------------------------------- all there is

BASES = {
    "/set_entity_state": {
        "set_pose": True,
        "set_twist": True,
        "state.pose.position.x": 5.0,
        "state.pose.position.z": 5.0,
        "state.pose.orientation.w": 1.0,
    },
    "/spawn_entity": {"entity_resource.uri": "f450", "initial_pose.pose.position.x": 50.0},
    "/volery/take_control": {"operator": "Anna"},
    "/volery/release_control": {"operator": "Anna"},
    "/volery/hand_over": {"operator": "Anna", "to": "Anna"},
    "/volery/gust": {"rise": 1.0},
    "/volery/join_lock_step": {"name": "p", "period_s": 0.01, "timeout_s": 1.0},
    "/rosapi/set_param": {"name": "/uav1/gap_following:height_m", "value": "2.0"},
}
LAST = ("delete", "reset", "/kill", "kill")
"""Services after which few others exist."""


def requests_of(service, srvtype):
    """A sane request, and many with one nasty value each."""

    def base():
        message = zero_message(f"{srvtype}_Request")
        for name in ("uav", "entity"):
            if hasattr(message, name):
                setattr(message, name, "uav1")
        for path, value in BASES.get(service, {}).items():
            put(message, tuple(path.split(".")), value)
        return message

    yield base()
    for path, described in leaves(f"{srvtype}_Request"):
        for value in nasty_values(described):
            message = base()
            put(message, path, value)
            yield message


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    from volery.runtime import Simulation

    folder = tmp_path_factory.mktemp("whole")
    with Simulation(
        parse_scenario(whole_data(folder)), threads=1, recordings=folder / "recordings"
    ) as simulation:
        offer_rosapi(simulation)
        simulation.step(3000)
        yield simulation


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")
def test_nasty_values_in_every_field_of_every_service(whole):
    client = Client(whole)
    services = sorted(
        whole.graph.services().items(), key=lambda item: (any(w in item[0] for w in LAST), item[0])
    )
    asked = 0
    for service, srvtype in services:
        for request in requests_of(service, srvtype):
            if not whole.graph.has_service(service):
                continue
            response = client.call(service, request)
            assert response is not None or service == "/step_simulation", service
            assert not RAW.search(str(response)[:3000]), (service, str(request)[:500])
            whole.clock.resume()
            whole.step(2)
            asked += 1
    assert asked > 2000
    state = whole._engine.fleet.state
    assert np.isfinite(state.position_map).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")
def test_nasty_values_in_every_field_of_every_topic(whole):
    client = Client(whole)
    before = whole.time_ns
    topics = [t for t in whole.graph.topics() if t.subscribers and not t.name.startswith("/volery")]
    for topic in topics:
        for path, described in leaves(topic.msgtype):
            for value in nasty_values(described):
                message = zero_message(topic.msgtype)
                put(message, path, value)
                client.publish(topic.name, message)
                whole.step(1)
    assert whole.time_ns > before
    assert np.isfinite(whole._engine.fleet.state.position_map).all()
