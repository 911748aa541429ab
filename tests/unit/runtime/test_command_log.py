"""What `/volery/log` publishes of clients' commands, and what later logs begin with."""

from __future__ import annotations

import json

import numpy as np
import pytest

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_flight import RecordedScenario, read_flight
from volery.bridges.logs.recording import Recorder
from volery.core.errors import RecordingError
from volery.graph.codecs.zero import zero_message
from volery.graph.command_records import TOPIC, TYPE, content_of, record_of
from volery.graph.messages import String, Twist, Vector3, message_type
from volery.graph.service_reply import ServiceReply
from volery.graph.session import ClientCommand
from volery.runtime.replay import command_log
from volery.runtime.replay.command_effects import CommandEffect, weight_of
from volery.runtime.replay.scenario_record import origin_of_scenario, scenario_of
from volery.scenario import library
from volery.scenario.load import load_scenario

OURS, STANDARD = "volery_interfaces/srv", "simulation_interfaces/srv"
TWIST = Twist(Vector3(0.1, 0.0, 0.0), Vector3(0.0, 0.0, 1e-300))


@pytest.fixture
def flying(simulate, flat_data):
    return simulate(flat_data)


@pytest.fixture
def records(flying):
    found = []
    flying.graph.subscribe(TOPIC, lambda published: found.append(published.message), TYPE)
    return found


def call_service(simulation, service, srvtype, **fields):
    request = zero_message(f"{srvtype}_Request")
    for name, value in fields.items():
        setattr(request, name, value)
    responses = []
    simulation.gateway.open("page").call(
        service, request, ServiceReply(responses.append, responses.append)
    )
    simulation.process_commands()
    return responses[0]


def test_a_command_is_logged_as_it_is_applied(flying, records):
    flying.run(0.123)
    session = flying.gateway.open("pilot 7")
    session.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
    session.publish("/uav1/cmd_vel", TWIST)
    flying.process_commands()
    session.publish("/uav1/cmd_vel", TWIST)
    flying.process_commands()
    advertised, first, second = records
    assert (advertised.kind, advertised.latched, advertised.content) == ("advertise", False, "")
    assert (first.client, first.kind, first.name) == ("pilot 7", "publish", "/uav1/cmd_vel")
    assert first.type == "geometry_msgs/msg/Twist"
    assert first.stamp.nanosec == 123_000_000
    assert (first.step, first.number, second.number) == (123, 1, 2)
    assert second.turn == first.turn + 1  # another round of commands at the same step
    assert json.loads(first.content)["angular"]["z"] == 1e-300
    again = content_of("publish", first.type, first.cdr.tobytes())
    assert (again.linear.x, again.angular.z) == (0.1, 1e-300)


def test_questions_are_not_logged_and_refused_commands_are(flying, records):
    call_service(flying, "/get_entities", f"{STANDARD}/GetEntities")
    call_service(flying, "/volery/list_snapshots", f"{OURS}/ListSnapshots")
    assert not records
    assert not call_service(
        flying, "/volery/inject_fault", f"{OURS}/InjectFault", fault="x"
    ).success
    assert [(r.kind, r.name, json.loads(r.content)) for r in records] == [
        ("call", "/volery/inject_fault", {"fault": "x"})
    ]


def test_what_only_paces_is_no_turn(flying, records):
    call_service(flying, "/volery/set_speed", f"{OURS}/SetSpeed", factor=2.0)
    call_service(flying, "/uav1/land", "std_srvs/srv/Trigger")
    call_service(flying, "/uav1/land", "std_srvs/srv/Trigger")
    assert [record.turn for record in records] == [0, 0, 1]


@pytest.mark.parametrize(
    ("kind", "srvtype", "weight"),
    [
        ("call", f"{STANDARD}/GetEntities", CommandEffect.QUERIES),
        ("call", f"{OURS}/GetWeather", CommandEffect.QUERIES),
        ("call", "rosapi_msgs/srv/Topics", CommandEffect.QUERIES),
        ("call", "rosapi_msgs/srv/SetParam", CommandEffect.CHANGES),
        ("call", f"{STANDARD}/StepSimulation", CommandEffect.PACES),
        ("call", f"{STANDARD}/SpawnEntity", CommandEffect.CHANGES),
        ("call", "nobody_knows/srv/GetLost", CommandEffect.CHANGES),
        ("call", f"{STANDARD}/SetSimulationState", CommandEffect.CHANGES),  # of zeros: stopped
        ("publish", "std_msgs/msg/String", CommandEffect.CHANGES),
        ("advertise", "std_msgs/msg/String", CommandEffect.PACES),
    ],
)
def test_how_much_hangs_on_a_command(kind, srvtype, weight):
    assert weight_of(ClientCommand("x", kind, "/x", srvtype)) is weight


def test_the_record_of_going_back_is_not_taken_back(flying, records):
    call_service(flying, "/volery/save_snapshot", f"{OURS}/ByName", name="a")
    flying.run(0.1)
    assert call_service(flying, "/volery/restore_snapshot", f"{OURS}/ByName", name="a").success
    call_service(flying, "/reset_simulation", f"{STANDARD}/ResetSimulation")
    flying.run(0.1)
    names = [record.name for record in records]
    assert names == ["/volery/save_snapshot", "/volery/restore_snapshot", "/reset_simulation"]


def large_map(cells=100):
    message = zero_message("nav_msgs/msg/OccupancyGrid")
    message.data = np.arange(cells * cells).astype(np.int8)
    return message


def test_a_large_message_is_logged_once(tmp_path, flying):
    log = create_log(tmp_path / "x.mcap")
    flying.graph.subscribe_all(log.write)
    session = flying.gateway.open("mapper")
    session.advertise("/large", "nav_msgs/msg/OccupancyGrid", latched=True)
    session.publish("/large", large_map())
    session.publish("/large", large_map(3))
    flying.process_commands()
    flying.commands.end()
    log.close()
    _, first, second, end = read_flight(tmp_path / "x.mcap").commands
    assert (first.taken.content.data == large_map().data).all()
    assert (second.taken.content.data == large_map(3).data).all()
    assert end.taken.kind == "end"
    record = record_of(first.taken, None, number=1, time_ns=0, step=0, turn=0)
    assert "10000 x int8" in record.content
    assert record.follows
    assert len(record.cdr) == 0


def test_a_log_without_what_follows_is_refused(tmp_path, flying):
    recorder = Recorder(flying.graph, create_log(tmp_path / "x.mcap"), topics=("/volery/**",))
    recorder.start()
    session = flying.gateway.open("mapper")
    session.advertise("/large", "nav_msgs/msg/OccupancyGrid")
    session.publish("/large", large_map())
    flying.process_commands()
    recorder.stop()
    with pytest.raises(RecordingError, match="lacks the messages of '/large'"):
        read_flight(tmp_path / "x.mcap")


def test_texts_and_lists_are_shortened_for_people():
    taken = ClientCommand("x", "publish", "/x", "std_msgs/msg/String", String("a" * 10_000))
    record = record_of(taken, b"", number=0, time_ns=0, step=0, turn=0)
    assert "(10000 characters)" in json.loads(record.content)["data"]
    points = message_type("nav_msgs/msg/Path")
    pose = zero_message("geometry_msgs/msg/PoseStamped")
    path = points(header=pose.header, poses=[pose] * 500)
    taken = ClientCommand("x", "publish", "/x", "nav_msgs/msg/Path", path)
    record = record_of(taken, b"", number=0, time_ns=0, step=0, turn=0)
    assert json.loads(record.content)["poses"][-1] == "and 484 more"


def test_what_is_kept_has_a_bound(tmp_path, flying, monkeypatch):
    monkeypatch.setattr(command_log, "MAX_STORED_BYTES", 10_000)
    session = flying.gateway.open("operator")
    session.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
    for _ in range(100):
        session.publish("/uav1/cmd_vel", TWIST)
    flying.process_commands()
    log = create_log(tmp_path / "x.mcap")
    for earlier in flying.commands.earlier():
        log.write(earlier)
    flying.graph.subscribe_all(log.write)
    flying.process_commands()
    session.publish("/uav1/cmd_vel", TWIST)
    flying.process_commands()
    flying.run(0.01)
    log.close()
    with pytest.raises(RecordingError, match="command 0 is missing"):
        read_flight(tmp_path / "x.mcap")


def test_what_is_kept_beyond_its_bound_holds_no_content(flying, monkeypatch):
    monkeypatch.setattr(command_log, "MAX_STORED_BYTES", 10_000)
    session = flying.gateway.open("camera")
    session.advertise("/picture", "sensor_msgs/msg/CompressedImage")
    for _ in range(3):
        image = zero_message("sensor_msgs/msg/CompressedImage")
        image.data = np.zeros(6_000, np.uint8)
        session.publish("/picture", image)
    flying.process_commands()
    (only,) = flying.commands.earlier()
    assert (only.message.number, len(only.message.cdr), only.message.follows) == (3, 0, False)


@pytest.mark.parametrize("name", library.names())
def test_a_scenario_comes_back_from_its_log(name):
    scenario = load_scenario(name)
    again = scenario_of(RecordedScenario.from_json(origin_of_scenario(scenario).to_json()))
    assert again.model_dump() == scenario.model_dump()
    assert again.access.is_confined


@pytest.mark.parametrize("text", ["", "[]", '{"name": "x"}', "null"])
def test_what_holds_no_scenario(text):
    with pytest.raises(RecordingError, match="no scenario"):
        RecordedScenario.from_json(text)
