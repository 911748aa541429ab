"""UAVs with cameras search together: inside the simulation, and each as a process of its own."""

from __future__ import annotations

import itertools
import subprocess
import sys
import time

import numpy as np
import pytest
from ros1_bench import missing_of_ros1, shared_master

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros1.bridge import Ros1Bridge
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.engine.events import EventKind

OBJECT = np.array([17.5, 15.5])
NODE = "cooperative_search"
CAMERA = {
    "kind": "camera",
    "name": "down",
    "model": "f450_down",
    "position_m": [-0.12, 0.0, 0.01],
    "rpy_deg": [0.0, 90.0, 0.0],
    "rate_hz": 5.0,
    "width": 160,
    "height": 120,
    "compressed": "none",
}


def parameters(count):
    return {
        "team": [f"uav{k + 1}" for k in range(count)],
        "area_m": [0.0, 0.0, 24.0, 24.0],
        "altitude_m": 5.0,
        "mount_m": [-0.12, 0.0, 0.01],
        "hold_s": 1.0,
        "seed": 2,
    }


def meadow(tmp_path, count, *, with_nodes):
    (tmp_path / "block.csv").write_text("1\n")
    maps = [{"file": str(tmp_path / "block.csv")}]
    kind = {"sensors": [CAMERA, {"kind": "odometry", "noise": False}]}
    if with_nodes:
        kind["nodes"] = [{"node": NODE, "parameters": parameters(count)}]
    grid_map = {
        "maps": maps,
        "cell_size_m": 1.0,
        "block_height_m": 1.0,
        "origin_m": (OBJECT - 0.5).tolist(),
    }
    return {
        "name": "meadow",
        "ends_when": "all_landed",
        "duration_s": 200.0,
        "world": {"terrain": {"kind": "flat", "extent_m": 60.0}, "grid_map": grid_map},
        "types": {"searcher": kind},
        "uavs": [
            {
                "type": "searcher",
                "count": count,
                "position_m": [3.0, 3.0],
                "last_position_m": [3.0, 3.0 + 4.0 * (count - 1)],
            }
        ],
    }


class Watch:
    """What the UAVs publish, and where they really are."""

    def __init__(self, simulation):
        self.simulation = simulation
        self.found, self.phases, self.tracks = [], {}, {n: [] for n in simulation.uavs}
        for name in simulation.uavs:
            simulation.graph.subscribe(
                f"/{name}/search/found",
                lambda p: self.found.append(p.message.point),
                "geometry_msgs/msg/PointStamped",
            )
            self.phases[name] = []
            simulation.graph.subscribe(
                f"/{name}/search/state",
                lambda p, name=name: self.phases[name].append(p.message.phase),
                "volery_interfaces/msg/SearchState",
            )

    def look(self):
        for name, uav in self.simulation.uavs.items():
            self.tracks[name].append(uav.position_map.copy())

    def fly(self, seconds):
        end = self.simulation.time_s + seconds
        while self.simulation.time_s < end and not self.simulation.clock.finished:
            self.simulation.run(0.2)
            self.look()

    def check(self):
        assert self.simulation.clock.finished
        assert all(uav.mode.name == "LANDED" for uav in self.simulation.uavs.values())
        touched = {EventKind.COLLISION, EventKind.IMPACT}
        assert not [event for event in self.simulation.diagnostics.events if event.kind in touched]
        for point in self.found:
            assert np.hypot(point.x - OBJECT[0], point.y - OBJECT[1]) < 0.5
        assert self.found
        assert all("hold" in phases for phases in self.phases.values())
        tracks = [np.array(track) for track in self.tracks.values()]
        for a, b in itertools.combinations(tracks, 2):
            assert np.linalg.norm(a - b, axis=1).min() > 1.5
        for track in tracks:
            assert (track[:, :2] > 0.0).all()
            assert (track[:, :2] < 24.0).all()


def test_three_search_find_meet_and_land_the_same_each_time(tmp_path, simulate):
    digests = []
    for threads in (1, 2):
        simulation = simulate(meadow(tmp_path, 3, with_nodes=True), threads=threads)
        simulation.diagnostics.enable_digest()
        watch = Watch(simulation)
        watch.fly(200.0)
        watch.check()
        digests.append(simulation.diagnostics.digest())
    assert digests[0] == digests[1]


def test_it_goes_on_from_a_snapshot_as_it_did(tmp_path, simulate):
    simulation = simulate(meadow(tmp_path, 2, with_nodes=True))
    watch = Watch(simulation)
    while "look" not in watch.phases["uav1"] + watch.phases["uav2"]:
        simulation.run(0.5)
    kept = simulation.snapshot()
    simulation.run(10.0)
    once = [uav.position_map.copy() for uav in simulation.uavs.values()]
    simulation.restore(kept)
    simulation.run(10.0)
    np.testing.assert_array_equal([uav.position_map for uav in simulation.uavs.values()], once)


def open_rosbridge(bridges):
    bridge = RosbridgeServer(port=0)
    bridges.open(bridge)
    return f"rosbridge://127.0.0.1:{bridge.port}"


def open_ros1(bridges):
    if missing_of_ros1():
        pytest.skip(f"no {', '.join(missing_of_ros1())}: see .ci/install_ros1")
    shared_master()
    bridges.open(Ros1Bridge())
    return "ros1"


@pytest.mark.slow
# rospy uses what is deprecated and forgets to close sockets
@pytest.mark.filterwarnings("ignore:notifyAll:DeprecationWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("open_bridge", [open_rosbridge, open_ros1])
def test_each_node_in_a_process_of_its_own(open_bridge, tmp_path, simulate):
    simulation = simulate(meadow(tmp_path, 2, with_nodes=False))
    watch = Watch(simulation)
    simulation.step(1)
    with BridgeHost(simulation.gateway) as bridges:
        via = open_bridge(bridges)
        nodes = [start_node(via, name) for name in simulation.uavs]
        try:
            end = time.monotonic() + 600.0
            while not simulation.clock.finished and time.monotonic() < end:
                simulation.run(0.2, speed=2.0)
                watch.look()
        finally:
            for node in nodes:
                node.terminate()
                node.wait(60.0)
    watch.check()


def start_node(via, name):
    given = [f"{key}={value}" for key, value in parameters(2).items()]
    words = [word for one in given for word in ("-p", one)]
    return subprocess.Popen(
        [
            *(sys.executable, "-m", "volery", "node", NODE),
            *("--via", via, "--namespace", f"/{name}", *words),
        ],
        stderr=subprocess.DEVNULL,
    )
