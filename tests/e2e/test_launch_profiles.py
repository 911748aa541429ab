"""The same node files in lock step, in place of a process over rosbridge, and on a played bag."""

from __future__ import annotations

import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from volery import Simulation
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.replay import Replay
from volery.bridges.nodes.host import NodeHost
from volery.bridges.nodes.profile import Profile, load_profile
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.cli.launch import start_profile
from volery.runtime.construction.node_loading import start_node
from volery.scenario.access import ScenarioAccess
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import NodeEntry

PROFILES = Path(__file__).parents[2] / "examples/profiles"
SECONDS = 9.0
OUTPUTS = ("team", "mission", "search_area", "targets", "target_detection/targets")
INPUTS = ("/uav1/odom", "/uav1/range", "/uav1/battery", "/uav1/camera/**", "/uav1/radio/**")
NODES = [
    {
        "node": "task_manager",
        "parameters": {"area_m": [0.0, -20.0, 40.0, 20.0], "sector_m": 20.0, "altitude_m": 4.0},
    },
    {
        "node": "target_detection",
        "parameters": {"mount_rpy_deg": [0.0, 30.0, 0.0], "max_sigma_m": 5.0},
    },
]
Published = dict[str, list[tuple[int, bytes]]]


def scenario_of(nodes: list[dict[str, Any]], *, blind: bool = False) -> Any:
    """A UAV before a red cube; a blind one has no sensors, and receives what another one saw."""
    camera = {
        "kind": "camera",
        "name": "camera",
        "rpy_deg": [0.0, 30.0, 0.0],
        "width": 80,
        "height": 60,
        "rate_hz": 5.0,
        "compressed": "none",
    }
    sonar = {"kind": "sonar", "rpy_deg": [0.0, 90.0, 0.0]}
    sensors = [camera, sonar, {"kind": "odometry"}, {"kind": "battery"}]
    return parse_scenario(
        {
            "name": "profiles",
            "world": {
                "meshes": [
                    {
                        "file": "meshes/target_cube.obj",
                        "position_m": [7.0, 0.5, 0.0],
                        "colour": [0.6, 0.01, 0.01],
                    }
                ]
            },
            "types": {"one": {"sensors": [] if blind else sensors, "nodes": nodes}},
            "uavs": [{"type": "one", "position_m": [0.0, 0.0]}],
        }
    )


def listen(simulation: Any) -> Published:
    """What the nodes say from now on."""
    published: Published = {}
    for name in OUTPUTS:
        rows = published.setdefault(name, [])
        kinds = {
            "team": "volery_interfaces/msg/TeamReport",
            "mission": "volery_interfaces/msg/MissionStatus",
            "search_area": "geometry_msgs/msg/PolygonStamped",
        }
        kind = kinds.get(name, "volery_interfaces/msg/Targets")
        simulation.graph.subscribe(
            f"/uav1/{name}", lambda p, rows=rows: rows.append((p.time_ns, p.cdr)), kind
        )
    return published


@pytest.fixture(name="inside", scope="module")
def _inside(tmp_path_factory: pytest.TempPathFactory) -> tuple[Published, Path]:
    """What nodes inside the simulation publish, and a log of all messages."""
    path = tmp_path_factory.mktemp("profiles") / "flight.mcap"
    with Simulation(scenario_of(NODES)) as simulation, closing(create_log(path)) as log:
        published = listen(simulation)
        simulation.graph.subscribe_all(log.write)
        simulation.run(SECONDS)
    return published, path


def test_nodes_inside_detect_and_publish(inside: tuple[Published, Path]) -> None:
    published, _ = inside
    assert len(published["team"]) > 40
    assert published["search_area"]
    assert published["targets"]
    assert published["target_detection/targets"]


@pytest.mark.parametrize("outside", [0, 1], ids=["task manager", "target detection"])
def test_the_same_over_rosbridge_in_lock_step(inside: tuple[Published, Path], outside: int) -> None:
    """One of the nodes, by a profile, while the other stays: between two that are both outside a
    message takes a physics step."""
    own = NODES[outside : outside + 1]
    profile = Profile(name="forest", namespace="/uav1", clock="simulated", launch=own)
    server = RosbridgeServer(port=0)
    with (
        Simulation(scenario_of(NODES[1 - outside : 2 - outside])) as simulation,
        BridgeHost(simulation.gateway) as bridges,
    ):
        bridges.open(server)
        published = listen(simulation)
        flying, problem = threading.Event(), []

        def run_nodes() -> None:
            link = RosbridgeClient(f"ws://127.0.0.1:{server.port}", name="forest")
            try:
                host = NodeHost(link, clock=profile.clock)
                start_profile(profile, host)
                host.join_lock_step(profile.name, 0.001)
                flying.set()
                host.spin(lambda: not flying.is_set())
            except Exception as error:
                problem.append(error)
            finally:
                link.close()

        thread = threading.Thread(target=run_nodes)
        thread.start()
        while not flying.is_set() and not problem:
            simulation.post(lambda: None)
            simulation.process_commands()
        simulation.run(SECONDS)
        flying.clear()
        thread.join()
        assert not problem
    names = OUTPUTS[:4] if outside == 0 else OUTPUTS[4:]
    for name in names:
        assert messages(published)[name] == messages(inside[0])[name]


def test_the_same_on_a_played_bag(inside: tuple[Published, Path]) -> None:
    """Nothing is simulated but a UAV that stands still: the nodes live on what the log holds."""
    published_inside, path = inside
    replay = Replay(path, topics=INPUTS, offset_s=summarize(path).start_ns * 1e-9)
    with Simulation(scenario_of(NODES, blind=True)) as simulation:
        published = listen(simulation)
        simulation.replay_log(replay)
        simulation.run(SECONDS)
    assert messages(published) == messages(published_inside)


def messages(published: Published) -> dict[str, list[bytes]]:
    """Without the time of delivery."""
    return {name: [cdr for _, cdr in rows] for name, rows in published.items()}


# -------------------------------------------------------------------------------- shipped profiles


@pytest.mark.parametrize("name", ["simulation", "ground_test", "flight_test"])
def test_shipped_profiles_start_the_nodes_of_the_scenario(name: str) -> None:
    """The same classes with parameters that they know; only names and drivers differ."""
    profile = load_profile(PROFILES / f"{name}.toml")
    flown = load_scenario("forest_search").types["searcher"].nodes
    autonomy = [e for e in profile.launch if e.node != "radio"]
    assert [e.node for e in autonomy] == [e.node for e in flown]
    assert profile.name == name
    with Simulation(scenario_of([], blind=True)) as simulation:
        from volery.graph.nodes.node import Context

        context = Context(simulation.graph, simulation._engine, simulation.graph.now_ns)
        for entry in autonomy:
            plain = NodeEntry(node=entry.node, parameters=entry.parameters)
            node = start_node(plain, context, profile.namespace, name, ScenarioAccess())
            node.destroy_node()
