"""A flight that a client disturbs at arbitrary moments, then repeated from its log alone."""

from __future__ import annotations

import json
import random
import re
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_flight import read_flight
from volery.bridges.logs.records import LogWalk
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import CommandError, GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.command_records import content_bytes
from volery.graph.connection import call_and_wait
from volery.graph.messages import Twist, Vector3, message_type
from volery.graph.service_reply import ServiceReply
from volery.runtime import Simulation
from volery.runtime.replay.command_effects import CommandEffect, weight_of
from volery.scenario.load import parse_scenario

SENSORS = [
    {"kind": "lidar", "position_m": [0.0, 0.0, 0.18]},
    {"kind": "imu"},
    {"kind": "odometry"},
    {"kind": "gnss"},
    {"kind": "ground_truth"},
]
DATA = {
    "name": "disturbed",
    "seed": 11,
    "duration_s": 12.0,
    "world": {
        "grid_map": {"block_height_m": 4.0},
        "wind": {"velocity_m_s": [2.0, 0.0, 0.0], "turbulence": "light"},
    },
    "types": {
        "f450": {
            "sensors": SENSORS,
            "nodes": [{"node": "repeated_nodes:Thinker", "latency_s": 0.013}],
        }
    },
    "uavs": [
        {"type": "f450", "count": 2, "position_m": [0.0, 0.0, 3.0], "last_position_m": [8, 0]}
    ],
}


class Operator:
    """A client behind a real WebSocket."""

    def __init__(self, port, name="operator"):
        self.client = RosbridgeClient(f"ws://127.0.0.1:{port}", name=name)
        self.client.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
        self.client.advertise("/map_command", "nav_msgs/msg/OccupancyGrid")

    def call(self, service, srvtype="std_srvs/srv/Trigger", **fields):
        request = zero_message(f"{srvtype}_Request")
        for name, value in fields.items():
            setattr(request, name, value)
        return call_and_wait(self.client, service, request, 60.0)

    def ours(self, service, kind, **fields):
        return self.call(f"/volery/{service}", f"volery_interfaces/srv/{kind}", **fields)

    def standard(self, service, **fields):
        kind = "".join(word.capitalize() for word in service.split("_"))
        return self.call(f"/{service}", f"simulation_interfaces/srv/{kind}", **fields)

    def fly(self, x, y, z=0.0):
        self.client.publish("/uav1/cmd_vel", Twist(Vector3(x, y, z), Vector3(0.0, 0.0, 0.1)))

    def send_map(self, cells):
        message = zero_message("nav_msgs/msg/OccupancyGrid")
        message.header.frame_id = "map"
        message.info.resolution = 0.7  # no float32
        message.info.width = message.info.height = cells
        message.info.origin.position.x = 20.0
        message.info.origin.orientation.w = 1.0
        message.data = np.resize(np.array([0, 0, 100], np.int8), cells * cells)
        self.client.publish("/map_command", message)


def resource(uri):
    message = zero_message("simulation_interfaces/msg/Resource")
    message.uri = uri
    return message


def pose_at(x, y, z, kind="geometry_msgs/msg/PoseStamped"):
    message = zero_message(kind)
    position = message.pose.position
    position.x, position.y, position.z = x, y, z
    message.pose.orientation.w = 1.0
    return message


def disturb(operator, wait):
    """Everything that a page can do, `wait()` in between."""
    for k in range(10):
        operator.fly(0.3 + 0.1 * k, -0.2)
        wait(0.3)
    assert (
        operator.standard(
            "spawn_entity",
            name="scout",
            entity_resource=resource("crazyflie"),
            initial_pose=pose_at(3.0, 6.0, 0.0),
        ).result.result
        == 1
    )
    operator.call("/scout/take_off")
    operator.ours("set_weather", "SetWeather", wind=Vector3(3.3, 1.1, 0.0), only=["wind"])
    wait(1.0)
    operator.ours("gust", "Gust", amplitude=Vector3(0.0, 2.7, 0.0), rise=0.31, duration=1.7)
    operator.call("/uav2/go_to", "volery_interfaces/srv/GoTo", position=zero_point(10.1, 2.2, 4.0))
    wait(0.6)
    operator.ours("save_snapshot", "ByName", name="early")
    operator.send_map(3)
    operator.send_map(90)
    fault = {"kind": "motor", "uav": "uav2", "rotor": 1, "thrust_factor": 0.93}
    operator.ours("inject_fault", "InjectFault", fault=json.dumps(fault))
    assert not operator.ours("inject_fault", "InjectFault", fault="nonsense").success
    wait(0.7)
    state = zero_message("simulation_interfaces/msg/EntityState")
    state.pose = pose_at(-3.0, -4.0, 5.0).pose
    operator.standard("set_entity_state", entity="uav2", state=state, set_pose=True)
    wait(0.5)
    assert operator.ours("restore_snapshot", "ByName", name="early").success
    operator.fly(-0.7, 0.1)
    wait(0.4)
    assert operator.standard("delete_entity", entity="scout").result.result == 1
    wait(0.3)
    paused = zero_message("simulation_interfaces/msg/SimulationState")
    paused.state = 2
    operator.standard("set_simulation_state", state=paused)
    operator.fly(0.2, 0.2)
    operator.standard("step_simulation", steps=37)
    operator.call("/uav1/hold")
    playing = zero_message("simulation_interfaces/msg/SimulationState")
    playing.state = 1
    operator.standard("set_simulation_state", state=playing)
    operator.ours("set_speed", "SetSpeed", factor=0.0)
    wait(0.3)
    operator.standard("reset_simulation")
    wait(1.1)
    operator.fly(0.5, 0.5)
    parameter = {"name": "/uav1/thinker:gain", "value": "0.35"}
    response = operator.call("/rosapi/set_param", "rosapi_msgs/srv/SetParam", **parameter)
    assert response.successful
    wait(0.6)


def zero_point(x, y, z):
    message = zero_message("geometry_msgs/msg/Point")
    message.x, message.y, message.z = x, y, z
    return message


NODES = '''
from volery.graph.messages import Float32, Imu, Twist
from volery.graph.nodes.node import Node

class Thinker(Node):
    """Turns what it receives and measures into a number, after a while."""

    def __init__(self, **options):
        super().__init__("thinker", **options)
        self.total = 0.0
        self.gain = self.declare_parameter("gain", 0.1, read_only=False)
        self.out = self.create_publisher(Float32, "thought", 5)
        self.create_subscription(Twist, "cmd_vel", self.receive, 5)
        self.create_timer(0.05, self.think)

    def receive(self, twist):
        self.total += self.gain.value * twist.linear.x
        self.think()

    def think(self):
        self.total *= 0.999
        self.out.publish(Float32(self.total))

    def get_state(self):
        return self.total

    def set_state(self, state):
        self.total = state
'''


@pytest.fixture(autouse=True)
def nodes(tmp_path, monkeypatch):
    (tmp_path / "repeated_nodes.py").write_text(NODES)
    monkeypatch.syspath_prepend(tmp_path)


def recorded(path, speed, seed):
    """Digest of a flight disturbed at moments that `seed` chooses."""
    log = create_log(path)
    with Simulation(parse_scenario(DATA), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.graph.subscribe_all(log.write)
        server = RosbridgeServer("127.0.0.1", 0)
        with BridgeHost(simulation.gateway) as bridges:
            bridges.open(server)
            simulation.gateway.use_low_latency()
            operator = Operator(server.port)
            chance = random.Random(seed)
            errors = []

            def wait(seconds):
                until = simulation.time_s + seconds * chance.random()
                late = time.monotonic() + 60.0
                while until - seconds < simulation.time_s < until and time.monotonic() < late:
                    time.sleep(0.0003 * chance.random())

            def work():
                try:
                    disturb(operator, wait)
                    chance_to_end.set()
                except BaseException as error:
                    errors.append(error)
                simulation.clock.quit()

            chance_to_end = threading.Event()
            thread = threading.Thread(target=work)
            thread.start()
            simulation.run(speed=speed)
            thread.join()
            operator.client.close()
        assert not errors, errors
        assert chance_to_end.is_set()
        simulation.commands.end()
        log.close()
        return simulation.diagnostics.digest()


def repeated(path, again=None, **options):
    """Digest of the flight of a log flown again, and recorded into `again`."""
    flight = read_flight(path)
    with Simulation(parse_scenario(flight.origin.content), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.replay_commands(flight)
        log = None if again is None else create_log(again)
        if log is not None:
            simulation.graph.subscribe_all(log.write)
        simulation.run(**options)
        if log is not None:
            simulation.commands.end()
            log.close()
        return simulation.diagnostics.digest()


def flown(path):
    """All that a log holds but for how the run was watched and steered."""
    return [
        (r.topic.topic, r.time_ns, r.data)
        for r in LogWalk(path)
        if not r.topic.topic.startswith("/volery/")
    ]


def changes(path):
    """Moments and contents of the commands in a log that may change results."""
    return [
        (c.step, c.turn, c.taken.kind, c.taken.name, content_bytes(c.taken))
        for c in read_flight(path).commands
        if weight_of(c.taken) is CommandEffect.CHANGES
    ]


@pytest.mark.parametrize(("speed", "seed"), [(1.0, 1), (2.5, 2)])
def test_a_disturbed_flight_is_repeated_to_the_byte(tmp_path, speed, seed):
    path, again = tmp_path / "flight.mcap", tmp_path / "again.mcap"
    digest = recorded(path, speed, seed)
    names = {command.taken.name for command in read_flight(path).commands}
    assert names >= {
        "/spawn_entity",
        "/uav1/cmd_vel",
        "/map_command",
        "/volery/restore_snapshot",
        "/uav1/hold",
    }
    assert "/volery/set_speed" in names  # logged, though it is not repeated
    assert repeated(path, again) == digest
    assert flown(again) == flown(path)
    assert changes(again) == changes(path)
    assert len(changes(path)) > 25
    if seed == 2:
        assert repeated(again, speed=6.0) == digest


def test_without_its_commands_the_flight_is_another_one(tmp_path):
    path = tmp_path / "flight.mcap"
    digest = recorded(path, 3.0, 3)
    flight = read_flight(path)
    with Simulation(parse_scenario(flight.origin.content), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        less = [c for c in flight.commands if c.taken.name != "/reset_simulation"]
        simulation.replay_commands(replace(flight, commands=tuple(less)))
        with pytest.raises(CommandError, match="is not the recorded one"):
            simulation.run()
        assert simulation.diagnostics.digest() != digest


def test_a_flight_of_the_command_line_is_repeated(tmp_path):
    """Quit by a client; repeated by another process, without bridges."""
    path = tmp_path / "flight.mcap"
    words = [sys.executable, "-m", "volery", "run", "hover", "--digest"]
    with subprocess.Popen(
        [*words, "--uavs", "2", "--bridge", "rosbridge=0", "--record", path],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        for line in process.stderr:
            if found := re.match(r"open .*127\.0\.0\.1:(\d+)", line):
                break
        operator = Operator(int(found[1]))
        try:
            operator.call("/uav2/land")
            for _ in range(20):
                operator.fly(0.5, 0.1)
                time.sleep(0.03)
            operator.ours("set_weather", "SetWeather", wind=Vector3(4.0, 0.0, 0.0), only=["wind"])
            time.sleep(0.5)
            quit_it = zero_message("simulation_interfaces/msg/SimulationState")
            quit_it.state = 3
            operator.standard("set_simulation_state", state=quit_it)
        finally:
            operator.client.close()
        out, _ = process.communicate(timeout=60)
    digest = re.search(r"digest  (\w+)", out)[1]

    def again(*more, scenario="hover"):
        command = [*words[:4], scenario, "--digest", "--replay-commands", path, *more]
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=900)
        assert "Traceback" not in done.stderr
        return done

    assert f"digest  {digest}" in again().stdout
    assert "of a flight of 'hover', not of 'longleaf'" in again(scenario="longleaf").stderr
    assert "--seed" in again("--seed", "3").stderr
    other = tmp_path / "none.mcap"
    create_log(other).close()
    assert "no scenario" in again("--replay-commands", other).stderr


def test_a_recording_begun_late_holds_what_came_before(tmp_path):
    with Simulation(parse_scenario(DATA), threads=1, recordings=tmp_path) as simulation:
        session = simulation.gateway.open("operator")
        session.subscribe("/volery/log", wake=lambda: None)  # so that records are on their way
        session.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
        session.publish("/uav1/cmd_vel", Twist(Vector3(1.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
        simulation.run(0.5)
        request = message_type("volery_interfaces/srv/StartRecording_Request")("late.mcap", [], [])
        responses = []
        session.call(
            "/volery/start_recording", request, ServiceReply(responses.append, responses.append)
        )
        simulation.run(0.5)
        stopping = ServiceReply(responses.append, responses.append)
        session.call("/volery/stop_recording", None, stopping)
        simulation.run(0.1)
        assert [response.success for response in responses] == [True, True]
        position = simulation.uavs["uav1"].position_map
    flight = read_flight(tmp_path / "late.mcap")
    assert [c.taken.kind for c in flight.commands] == ["advertise", "publish", "call"]
    with Simulation(parse_scenario(flight.origin.content), threads=1) as simulation:
        simulation.replay_commands(flight)
        simulation.run()
        assert simulation.time_s == pytest.approx(1.0, abs=0.02)  # the log knows no more
        simulation.run(1.1 - simulation.time_s)
        assert (simulation.uavs["uav1"].position_map == position).all()


def test_no_client_changes_a_replayed_flight(tmp_path):
    path = tmp_path / "flight.mcap"
    log = create_log(path)
    with Simulation(parse_scenario(DATA), threads=1) as simulation:
        simulation.graph.subscribe_all(log.write)
        simulation.run(0.3)
        simulation.commands.end()
    log.close()
    flight = read_flight(path)
    with Simulation(parse_scenario(flight.origin.content), threads=1) as simulation:
        simulation.replay_commands(flight)
        session = simulation.gateway.open("visitor")
        responses = []
        for service in ("/uav1/land", "/get_entities"):
            session.call(service, None, ServiceReply(responses.append, responses.append))
        simulation.run()
        assert simulation.time_s == 0.3
        assert isinstance(responses[0], GraphError)
        assert "is repeated" in str(responses[0])
        assert responses[1].entities == ["uav1", "uav2"]
        with pytest.raises(CommandError, match="from its start"):
            simulation.replay_commands(flight)


def finish(simulation, log):
    """End a flight and its log; its digest."""
    simulation.commands.end()
    log.close()
    return simulation.diagnostics.digest()


def test_the_steps_of_a_lock_step_partner_are_replayed(tmp_path):
    """What it answered, meeting by meeting, and that it left."""
    path = tmp_path / "flight.mcap"
    log = create_log(path)
    data = {**DATA, "duration_s": 1.0}
    clock = "rosgraph_msgs/msg/Clock"
    with Simulation(parse_scenario(data), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.graph.subscribe_all(log.write)
        session = simulation.gateway.open("partner")
        session.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
        session.advertise("/volery/lock_step/operator/done", clock)
        come = threading.Event()
        go = session.subscribe("/volery/lock_step/operator/go", clock, depth=5, wake=come.set)
        request = zero_message("volery_interfaces/srv/JoinLockStep_Request")
        request.name, request.period_s, request.timeout_s = "operator", 0.05, 60.0
        joined = []
        session.call("/volery/join_lock_step", request, ServiceReply(joined.append, joined.append))
        steps = []
        chance = random.Random(4)

        def steer():
            while len(steps) < 12:
                come.wait(60.0)
                come.clear()
                for published in go.take():
                    steps.append(published.message)
                    stamp = published.message.clock
                    turn = Vector3(0.0, 0.0, 0.7 * chance.random())
                    session.publish("/uav1/cmd_vel", Twist(Vector3(0.5, 0.0, 0.0), turn))
                    assert stamp.nanosec % 50_000_000 == 0
                    session.publish("/volery/lock_step/operator/done", published.message)
            session.close()

        thread = threading.Thread(target=steer)
        thread.start()
        simulation.run()
        thread.join()
        assert joined[0].success
        digest = finish(simulation, log)
    assert repeated(path) == digest


ASKER = """
from volery.graph.messages import Float32
from volery.graph.nodes.node import Node

class Asker(Node):
    def __init__(self, **options):
        super().__init__("asker", **options)
        self.total = 0.0
        self.ask = self.create_client("std_srvs/srv/Trigger", "/oracle")
        self.out = self.create_publisher(Float32, "heard", 5)
        self.create_timer(0.05, self.on_timer)

    def on_timer(self):
        if self.ask.service_is_ready():
            self.ask.call_async().add_done_callback(self.receive)

    def receive(self, future):
        number = -1.0 if future.exception() else float(future.result().message)
        self.total = 0.5 * self.total + number
        self.out.publish(Float32(self.total))
"""


def test_responses_of_an_external_service_are_replayed(tmp_path):
    (tmp_path / "repeated_askers.py").write_text(ASKER)
    path = tmp_path / "flight.mcap"
    log = create_log(path)
    kind = {"sensors": SENSORS[1:], "nodes": [{"node": "repeated_askers:Asker"}]}
    data = {**DATA, "duration_s": 1.5, "types": {"f450": kind}}
    response = message_type("std_srvs/srv/Trigger_Response")
    with Simulation(parse_scenario(data), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.graph.subscribe_all(log.write)
        session = simulation.gateway.open("oracle")
        timers = []
        chance = random.Random(5)

        def serve(_request, reply):
            def respond():
                if chance.random() < 0.2:
                    reply.fail(GraphError("no idea"))
                reply.answer(response(success=True, message=str(chance.random())))

            timers.append(threading.Timer(0.1 * chance.random(), respond))
            timers[-1].start()

        session.create_service("/oracle", "std_srvs/srv/Trigger", serve)
        simulation.run(1.2, speed=1.0)
        session.close()  # open requests fail
        simulation.run(0.3, speed=1.0)
        for timer in timers:
            timer.join()
        digest = finish(simulation, log)
    kinds = [command.taken.kind for command in read_flight(path).commands]
    assert kinds.count("answer") > 10
    assert {"offer", "withdraw", "failure"} <= set(kinds)
    assert repeated(path) == digest


def test_a_flight_past_its_scenarios_end_is_repeated(tmp_path):
    path = tmp_path / "flight.mcap"
    log = create_log(path)
    with Simulation(parse_scenario({**DATA, "duration_s": 0.2}), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.graph.subscribe_all(log.write)
        session = simulation.gateway.open("client")
        simulation.run()

        def call(service):
            message = zero_message(f"{simulation.graph.services()[service]}_Request")
            session.call(service, message, ServiceReply(_ignore, _ignore))

        simulation.wait_at_end(lambda: call("/volery/continue_run"))
        simulation.run(0.1)
        call("/uav1/land")
        simulation.run(0.1)
        session.call(
            "/reset_simulation",
            zero_message("simulation_interfaces/srv/ResetSimulation_Request"),
            ServiceReply(_ignore, _ignore),
        )
        simulation.run(0.15)
        simulation.commands.end()
        log.close()
        digest = simulation.diagnostics.digest()
    assert repeated(path) == digest


def _ignore(_response):
    """The response does not matter."""
