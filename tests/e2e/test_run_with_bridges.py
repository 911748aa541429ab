"""`volery run --bridge ...` and the programs that join it: terminal tools, nodes, the example."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest
from child_process import start_child
from own_port import own_port
from ros2_bench import DOMAIN
from websockets.sync.client import connect

from volery.bridges.rosbridge.client import RosbridgeClient
from volery.cli.run import RunOptions, _Change
from volery.core.errors import CommandError, GraphError, VoleryError
from volery.graph.codecs.zero import zero_message
from volery.graph.connection import call_and_wait
from volery.scenario.changes import Changes, WorldRequest

pytest.importorskip("roslibpy")
ROOT = Path(__file__).parents[2]
VOLERY = [sys.executable, "-m", "volery"]


class Run:
    """A simulation in a process of its own, its bridges on free ports."""

    def __init__(self, *bridges, scenario="hover", seconds=1200, port=0, more=()):
        words = [word for bridge in bridges for word in ("--bridge", f"{bridge}={port}")]
        self.process = start_child(
            [*VOLERY, "run", scenario, "--seconds", str(seconds), *words, *more],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.ports = [self._port() for _ in bridges]
        self._reader = threading.Thread(target=self.process.stderr.read)
        self._reader.start()

    def _port(self):
        for line in self.process.stderr:
            found = re.match(r"open .*127\.0\.0\.1:(\d+)", line)
            if found:
                return int(found[1])
        raise AssertionError(f"ended with {self.process.wait()} before its bridges were open")

    def close(self):
        self.process.terminate()
        self.process.wait(60.0)
        self._reader.join()
        self.process.stderr.close()


@pytest.fixture(scope="module")
def run():
    run = Run("rosbridge", more=("--ros2", "--domain-id", str(DOMAIN)))
    yield run
    run.close()


def via_rosbridge(run):
    return f"rosbridge://127.0.0.1:{run.ports[0]}"


def via_ros2(_run):
    return f"ros2://{DOMAIN}"


def volery(run, *words, via=via_rosbridge, timeout_s=120.0, ok=True):
    environment = {**os.environ, "VOLERY_VIA": via(run)}
    done = subprocess.run(
        [*VOLERY, *words],
        check=False,
        capture_output=True,
        text=True,
        timeout=timeout_s,
        env=environment,
    )
    assert (done.returncode == 0) is ok, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout if ok else done.stderr


@pytest.mark.parametrize("via", [via_rosbridge, via_ros2])
def test_topics_are_listed_with_their_types(run, via):
    lines = volery(run, "topic", "list", "--types", via=via).splitlines()
    assert "/uav1/odom [nav_msgs/msg/Odometry]" in lines
    assert "/clock [rosgraph_msgs/msg/Clock]" in lines
    assert volery(run, "topic", "type", "/uav1/imu", via=via).strip() == "sensor_msgs/msg/Imu"


@pytest.mark.parametrize("via", [via_rosbridge, via_ros2])
def test_a_message_is_printed_as_yaml(run, via):
    from ruamel.yaml import YAML

    text = volery(run, "topic", "echo", "/uav1/odom", "--once", via=via)
    message = YAML(typ="safe", pure=True).load(text.removesuffix("---\n"))
    assert message["child_frame_id"] == "uav1/base_link"
    assert isinstance(message["pose"]["pose"]["position"]["z"], float)


def test_a_command_is_published_and_flown(run):
    volery(run, "service", "call", "/uav1/hold")
    twist = "{linear: {x: 1.0}}"
    words = ("topic", "pub", "/uav1/cmd_vel", "geometry_msgs/Twist", twist, "-r", "20", "-t", "20")
    before = x_of_uav1(run)
    volery(run, *words)
    assert x_of_uav1(run) > before + 0.2


@pytest.mark.parametrize(
    ("msgtype", "message", "reason"),
    [
        ("geometry_msgs/PoseStamped", "{header: {frame_id: world}}", "goals are in 'map', not in"),
        ("geometry_msgs/PoseStamped", "{pose: {position: {z: .nan}}}", "is not finite"),
        ("std_msgs/String", "{data: a}", "carries geometry_msgs/msg/PoseStamped, not std_msgs"),
    ],
)
def test_a_published_command_that_is_refused_ends_with_the_reason(run, msgtype, message, reason):
    volery(run, "service", "call", "/uav1/hold")  # a take-off accepts no goal
    words = ("topic", "pub", "/uav1/goal_pose", msgtype, message, "--once")
    refused = volery(run, *words, ok=False)
    assert reason in refused
    assert refused.endswith("error: the server has refused messages to /uav1/goal_pose\n")


def x_of_uav1(run):
    text = volery(run, "topic", "echo", "/uav1/ground_truth/odom", "--once")
    return float(re.search(r"position:\s+x: (\S+)", text)[1])


@pytest.mark.parametrize("via", [via_rosbridge, via_ros2])
def test_services_are_listed_and_called(run, via):
    assert "/uav1/take_off [std_srvs/srv/Trigger]" in volery(run, "service", "list", "-t", via=via)
    response = volery(run, "service", "call", "/get_entities", via=via)
    assert "entities: [uav1]" in response
    refused = volery(run, "service", "call", "/uav1/take_off", via=via, ok=False)
    assert refused.startswith("error: /uav1/take_off refuses: ")


def test_a_bridge_can_be_opened_on_several_ports():
    run = Run("rosbridge", "rosbridge", seconds=60)
    try:
        first, second = run.ports
        assert first != second
        for address in (f"127.0.0.1:{first}", f"127.0.0.1:{second}/rosbridge"):
            with connect(f"ws://{address}") as client:
                client.send('{"op": "call_service", "service": "/get_entities"}')
                assert json.loads(client.recv(60.0))["values"]["entities"] == ["uav1"]
    finally:
        run.close()


def test_a_variable_names_the_graph(run):
    environment = {**os.environ, "VOLERY_VIA": via_rosbridge(run)}
    words = [*VOLERY, "service", "type", "/uav1/take_off"]
    done = subprocess.run(
        words, check=True, capture_output=True, text=True, timeout=60, env=environment
    )
    assert done.stdout.strip() == "std_srvs/srv/Trigger"


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("topic", "echo", "/nope"), "no topic '/nope'"),
        (("topic", "pub", "/x", "no_msgs/Such"), "no_msgs/msg/Such"),
        (("topic", "pub", "/x", "std_msgs/String", "{data: 3}"), "data must be"),
        (("topic", "pub", "/x", "std_msgs/String", "{data"), "is not YAML"),
        (("service", "call", "/nope"), "has no server"),
        (("service", "call", "/uav1/go_to", "{position: {x: bad}}"), "position.x must be"),
        (("node", "nonsense"), "module:Class"),
        (("node", "no_such_module:Node"), "cannot be imported"),
        (("topic", "list", "--via", "pigeon://post"), "is not a graph connection"),
        (("topic", "list", "--via", "rosbridge://127.0.0.1:1"), "no rosbridge server"),
        (("topic", "list", "--via", "ros-tcp://127.0.0.1:1"), "is not a graph connection"),
        (("topic", "--via", "pigeon://post", "list"), "'pigeon://post' is not a graph connection"),
        (
            ("service", "--via", "a://b", "call", "/x", "--via", "c://d"),
            "'c://d' is not a graph connection",
        ),
    ],
)
def test_wrong_options_are_reported_in_a_line(run, words, reason):
    assert reason in volery(run, *words, ok=False)


@pytest.mark.parametrize("connect", [via_rosbridge])
def test_a_node_runs_beside(run, tmp_path, connect):
    name = connect.__name__
    (tmp_path / "echoing.py").write_text(
        "from volery.graph.messages import String\n"
        "from volery.graph.nodes.node import Node\n"
        "class Echo(Node):\n"
        "    def __init__(self, **options):\n"
        "        super().__init__('echo', **options)\n"
        "        out = self.create_publisher(String, 'out', 10)\n"
        "        word = self.declare_parameter('word', 'x').value\n"
        "        self.create_timer(0.1, lambda: out.publish(String(word)))\n"
    )
    profile = tmp_path / "profile.toml"
    profile.write_text(f'namespace = "/uav1"\n[remap]\nout = "/{name}"\n')
    via = connect(run)
    node = subprocess.Popen(
        [*VOLERY, "node", "echoing:Echo", "--via", via, "--profile", profile, "-p", "word=hello"],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert "echo runs on" in node.stderr.readline()
        for _ in range(50):
            if f"/{name}" in volery(run, "topic", "list"):
                break
        assert "data: hello" in volery(run, "topic", "echo", f"/{name}", "--once")
    finally:
        node.terminate()
        node.wait(60.0)
        node.stderr.close()


def output_of(program, *words, timeout_s):
    """What a program prints that is run apart from the tests' folders."""
    done = subprocess.run(
        [sys.executable, "-I", program, *map(str, words)],
        check=False,
        capture_output=True,
        text=True,
        timeout=timeout_s,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_example_flies_a_square(run):
    volery(run, "service", "call", "/uav1/hold")
    output = output_of(ROOT / "examples/06_fly_over_rosbridge.py", run.ports[0], 1.5, timeout_s=60)
    assert 0.8 < float(re.search(r"([\d.]+) m wide", output)[1]) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("bridge", ["rosbridge", "ros-tcp"])
def test_a_planner_from_outside_gets_the_map_and_sends_waypoints(bridge):
    name = {"rosbridge": "", "ros-tcp": "_ros_tcp"}[bridge]
    program = ROOT / f"examples/09_bring_your_own_planner{name}.py"
    run = Run(bridge, scenario="plug_in", seconds=300)
    try:
        output = output_of(program, run.ports[0], 3, timeout_s=200)
    finally:
        run.close()
    assert "map of 32 x 32 cells, 922 free" in output
    assert output.count("reached row") == 3
    assert "import volery" not in program.read_text()


@pytest.mark.slow
def test_a_program_for_mavros_flies_unchanged():
    run = Run("rosbridge", "mavlink-tcp", scenario="plug_in", seconds=300, more=("--uavs", "1"))
    try:
        output = output_of(ROOT / "examples/13_mavros_offboard.py", run.ports[0], timeout_s=200)
    finally:
        run.close()
    assert "OFFBOARD, 2.0 m up" in output
    assert float(re.search(r"([\d.]+) m ahead", output)[1]) == pytest.approx(3.0, abs=0.3)
    assert "landed and disarmed" in output


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--bridge", "rosbrige"), "did you mean 'rosbridge'"),
        (("--bridge", "rosbridge=x"), "PORT or HOST:PORT"),
        (("--bridge", "rosbridge=0.0.0.0:0"), "other machines"),
    ],
)
def test_bridges_that_cannot_be_opened(words, reason):
    done = subprocess.run(
        [*VOLERY, "run", "hover", "--seconds", "1", *words],
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    assert reason in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_in_use_is_reported(run):
    done = subprocess.run(
        [*VOLERY, "run", "hover", "--seconds", "1", "--bridge", f"rosbridge={run.ports[0]}"],
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    assert str(run.ports[0]) in done.stderr
    assert "Traceback" not in done.stderr


PLAYING, QUITTING, NO_WORLD = 1, 3, 4
UNLOADING = 43
AGAIN_S = 5.0
"""After which a call is repeated that went to a world that was just left."""


def call_service(client, service, timeout_s=60.0, **fields):
    namespace, _, name = service.strip("/").rpartition("/")
    package = "volery_interfaces" if namespace == "volery" else "simulation_interfaces"
    srvtype = "".join(word.capitalize() for word in name.split("_"))
    request = zero_message(f"{package}/srv/{srvtype}_Request")
    for name, value in fields.items():
        setattr(request, name, value)
    return call_and_wait(client, service, request, timeout_s)


def world(uri):
    resource = zero_message("simulation_interfaces/msg/Resource")
    resource.uri = uri
    return resource


def test_a_client_loads_another_world():
    """The response still arrives; the bridges reopen their ports, and the client reconnects."""
    run = Run("rosbridge", seconds=600, port=own_port())
    client = RosbridgeClient(f"ws://127.0.0.1:{run.ports[0]}")
    try:
        loaded = call_service(client, "/load_world", world_resource=world("swarm_100"))
        assert (loaded.result.result, loaded.world.name) == (1, "swarm_100")
        until = time.monotonic() + 600.0
        name = ""
        while name != "swarm_100":
            assert run.process.poll() is None
            assert time.monotonic() < until
            with suppress(GraphError):
                name = call_service(client, "/get_current_world", AGAIN_S).world.name
        unknown = call_service(client, "/load_world", world_resource=world("atlantis"))
        assert unknown.result.result == 2
    finally:
        client.close()
        run.close()


def test_a_client_loads_a_scenario_with_changes():
    run = Run("rosbridge", seconds=600, port=own_port())
    client = RosbridgeClient(f"ws://127.0.0.1:{run.ports[0]}")
    changes = json.dumps({"uavs": 3, "airframe": "crazyflie", "sensors": ["sonar"], "speed": 2.0})
    try:
        refused = call_service(client, "/volery/load_scenario", scenario="hover", changes="{}x")
        assert not refused.success
        loaded = call_service(client, "/volery/load_scenario", scenario="hover", changes=changes)
        assert loaded.success, loaded.message
        until = time.monotonic() + 600.0
        entities = []
        while len(entities) != 3:
            assert run.process.poll() is None
            assert time.monotonic() < until
            with suppress(GraphError):
                entities = call_service(client, "/get_entities", AGAIN_S).entities
        info = call_service(client, "/get_entity_info", entity="uav3").info
        assert "crazyflie" in info.description
    finally:
        client.close()
        run.close()


def test_a_client_unloads_the_world_and_loads_one_again():
    """In between the bridges are open, the state is NO_WORLD, and few services exist."""
    run = Run("rosbridge", seconds=600, port=own_port())
    client = RosbridgeClient(f"ws://127.0.0.1:{run.ports[0]}")

    def come_back(state):
        until = time.monotonic() + 600.0
        while True:
            assert run.process.poll() is None
            assert time.monotonic() < until
            with suppress(GraphError):
                found = call_service(client, "/get_simulation_state", AGAIN_S)
                if found.state.state == state:
                    return

    try:
        assert call_service(client, "/unload_world").result.result == 1
        come_back(NO_WORLD)
        assert call_service(client, "/get_current_world").result.result == 101
        assert call_service(client, "/unload_world").result.result == 101
        assert len(call_service(client, "/get_available_worlds").worlds) > 3
        assert UNLOADING in call_service(client, "/get_simulator_features").features.features
        assert (
            call_service(client, "/load_world", world_resource=world("atlantis")).result.result == 2
        )
        with pytest.raises(GraphError, match="has no server"):
            call_service(client, "/get_entities")
        assert call_service(client, "/load_world", world_resource=world("hover")).result.result == 1
        come_back(PLAYING)
        assert call_service(client, "/get_current_world").world.name == "hover"
        assert call_service(client, "/unload_world").result.result == 1
        come_back(NO_WORLD)
        quit_it = zero_message("simulation_interfaces/msg/SimulationState")
        quit_it.state = PLAYING
        assert call_service(client, "/set_simulation_state", state=quit_it).result.result == 103
        quit_it.state = QUITTING
        assert call_service(client, "/set_simulation_state", state=quit_it).result.result == 1
        assert run.process.wait(60.0) == 0
    finally:
        client.close()
        run.close()


def test_files_of_one_flight_stay_of_one_world(tmp_path):
    change = _Change(RunOptions("hover", record=tmp_path / "a.mcap"))
    with pytest.raises(CommandError, match="--record"):
        change.request_world(WorldRequest("swarm_100"))
    change = _Change(RunOptions("hover", digest=True))
    with pytest.raises(CommandError, match="--digest"):
        change.request_world(WorldRequest("swarm_100"))
    change = _Change(RunOptions("hover", uavs=3))
    change.quit = lambda: quits.append(change.request)
    quits = []
    with pytest.raises(VoleryError):
        change.request_world(WorldRequest("atlantis"))
    with pytest.raises(VoleryError, match="inventory"):
        change.request_world(WorldRequest("hover", Changes(tree_share=0.5)))
    change.request_world(WorldRequest("longleaf", Changes(tree_share=0.5, speed=0.0)))
    assert quits == [change.request]
