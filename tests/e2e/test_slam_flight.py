"""SLAM in a flight through the forest, and on its log in a process of its own."""

import ast
import hashlib
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from test_mapped_flights import FOREST

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.replay import Replay
from volery.graph.messages import stamp_of
from volery.runtime import Simulation
from volery.runtime.replay.slam.offline_slam import OfflineSlam, SlamOptions
from volery.runtime.replay.slam.sources import open_source
from volery.scenario.load import parse_scenario

SECONDS = 9.0
INPUTS = ("/uav1/imu", "/uav1/range", "/uav1/joint_states", "/uav1/laser/**")
MOUNTS = {"level_mount": [0.0, 0.0, 0.18], "nodding_mount": [0.1, 0.0, -0.08]}


def scenario_of(*, blind):
    """A UAV that takes off among trees; a blind one receives what another one saw."""
    kind = FOREST["types"]["surveyor"]
    sensors = [s for s in kind["sensors"] if s["kind"] != "odometry"]
    node = {
        "node": "slam",
        "latency_s": 0.02,
        "parameters": {**MOUNTS, "initial_pose": [60.0, 120.0, 0.0, 0.0]},
    }
    sensors = [] if blind else [*sensors, {"kind": "imu"}, {"kind": "ground_truth"}]
    uav = {"type": "surveyor", "position_m": [60.0, 120.0], "placement": "nearest_free"}
    types = {"surveyor": {**kind, "sensors": sensors, "nodes": [node]}}
    return parse_scenario({**FOREST, "types": types, "uavs": [uav]})


def listen(simulation):
    published = {}
    for name in ("odom", "pose"):
        rows = published.setdefault(name, [])
        simulation.graph.subscribe(f"/uav1/slam/{name}", rows.append)
    return published


def digest(published):
    return {
        name: (len(rows), hashlib.sha256(b"".join(p.cdr for p in rows)).hexdigest())
        for name, rows in published.items()
    }


def replayed(path):
    with Simulation(scenario_of(blind=True)) as simulation:
        published = listen(simulation)
        simulation.replay_log(Replay(path, topics=INPUTS, offset_s=summarize(path).start_ns * 1e-9))
        simulation.run(SECONDS)
    return digest(published)


@pytest.mark.slow
def test_it_follows_a_flight_and_says_the_same_on_its_log_in_another_process(tmp_path):
    path = tmp_path / "flight.mcap"
    with Simulation(scenario_of(blind=False)) as simulation, closing(create_log(path)) as log:
        published, truth = listen(simulation), []
        simulation.graph.subscribe("/uav1/ground_truth/odom", truth.append)
        simulation.graph.subscribe_all(log.write)
        simulation.run(1.5)  # it wants half a second of standing still
        simulation.uavs["uav1"].take_off()
        simulation.run(SECONDS - 1.5)
    assert len(published["odom"]) > 300
    last, true = (
        published["odom"][-1].message.pose.pose.position,
        truth[-1].message.pose.pose.position,
    )
    first = truth[0].message.pose.pose.position
    off = np.array([last.x - 60.0 - (true.x - first.x), last.y - 120.0 - (true.y - first.y)])
    assert np.abs(off).max() < 0.2
    code = (
        "import sys; sys.path[:0] = [{0!r}, {1!r}]; from pathlib import Path; "
        "from test_slam_flight import replayed; print(replayed(Path({2!r})))"
    )
    here, tests = str(Path(__file__).parent), str(Path(__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code.format(here, tests, str(path))],
        check=True,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert ast.literal_eval(done.stdout.strip().splitlines()[-1]) == digest(published)
    _maps_alike(path, published["odom"])


def _maps_alike(log, odometry):
    """What `volery slam` makes of the log alone is the trajectory that was published in flight."""
    options = SlamOptions(start=(60.0, 120.0, 0.0, 0.0))
    trajectory = OfflineSlam(open_source(log), options).run().trajectory
    flown = np.array([(stamp_of(p.message), *_position(p.message)) for p in odometry])
    there = np.stack(
        [np.interp(trajectory.time_ns, flown[:, 0], flown[:, k]) for k in (1, 2, 3)], 1
    )
    assert len(trajectory.time_ns) > 300
    np.testing.assert_allclose(trajectory.position, there, atol=0.05)


def _position(message):
    p = message.pose.pose.position
    return p.x, p.y, p.z
