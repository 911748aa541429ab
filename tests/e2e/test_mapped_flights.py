"""A UAV that maps, plans and explores in the Barro Colorado forest."""

import json

import numpy as np
import pytest

from volery.autonomy.mapping.octomap_stream import decode_binary
from volery.autonomy.planning.exploration_node import POLYGON
from volery.engine.events import EventKind
from volery.graph.messages import header, message_type
from volery.runtime.construction.worlds import build_forest, build_terrain
from volery.scenario.load import parse_scenario

MOUNTS = {"level_mount": [0.0, 0.0, 0.18], "nodding_mount": [0.1, 0.0, -0.08]}
ODOM = {"odometry": "odom", "use_map_tf": False}
NODES = [
    {
        "node": "mapping",
        "latency_s": 0.1,
        "parameters": {**ODOM, **MOUNTS, "voxels_period_s": 5.0},
    },
    {
        "node": "local_planner",
        "latency_s": 0.05,
        "parameters": {**ODOM, **MOUNTS},
    },
    {
        "node": "trajectory_follower",
        "parameters": {"odometry": "odom"},
    },
    {
        "node": "global_planner",
        "latency_s": 0.2,
        "parameters": ODOM,
    },
    {
        "node": "exploration",
        "latency_s": 0.1,
        "parameters": ODOM,
    },
]
FOREST = {
    "name": "mapped_forest",
    "duration_s": 100.0,
    "world": {
        "terrain": {"kind": "grid", "file": "forests/bei_elevation.csv", "spacing_m": 5.0},
        "forest": {
            "kind": "inventory",
            "file": "forests/bei_trees.csv",
            "species": "beilschmiedia_pendula",
            "region_m": [40.0, 80.0, 140.0, 160.0],
        },
    },
    "types": {
        "surveyor": {
            "flight": {"take_off_altitude_m": 3.0},
            "sensors": [
                {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
                {
                    "kind": "lidar",
                    "name": "nodding",
                    "position_m": [0.1, 0.0, -0.08],
                    "nodding": {"amplitude_deg": 45.0, "period_s": 1.0},
                },
                {"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]},
                {"kind": "odometry", "noise": False},
            ],
            "nodes": NODES,
        }
    },
    "uavs": [
        {
            "type": "surveyor",
            "position_m": [60.0, 120.0],
            "placement": "nearest_free",
            "on_start": "take_off",
        }
    ],
}
AREA = [(55.0, 95.0), (130.0, 95.0), (130.0, 150.0), (55.0, 150.0)]


def send_area(simulation, corners=AREA):
    shape = message_type("geometry_msgs/msg/Polygon")
    point = message_type("geometry_msgs/msg/Point32")
    area = POLYGON(header(0, "map"), shape([point(x, y, 0.0) for x, y in corners]))
    simulation.graph.advertise("/uav1/search_area", POLYGON).publish(area)


def listen(simulation, topic):
    received = []
    simulation.graph.subscribe(f"/uav1/{topic}", lambda p: received.append(p.message))
    return received


def test_a_uav_explores_the_forest_and_its_map_is_that_of_the_trees(simulate):
    simulation = simulate(FOREST)
    simulation.run(6.0)
    send_area(simulation)
    received = {
        name: listen(simulation, name)
        for name in (
            "planning/status",
            "exploration/status",
            "octomap_binary",
            "projected_map",
            "odom",
        )
    }
    simulation.run(24.0)
    assert [e for e in simulation.diagnostics.events if e.kind is EventKind.IMPACT] == []
    track = np.array([[m.pose.pose.position.x, m.pose.pose.position.y] for m in received["odom"]])
    length_m = np.hypot(*np.diff(track, axis=0).T).sum()
    assert length_m > 45.0
    plans = json.loads(received["planning/status"][-1].data)["plans"]
    assert plans / 24.0 > 5.0
    state = json.loads(received["exploration/status"][-1].data)
    assert state["state"] == "searching"
    assert state["searched_m2"] > 700.0
    check_map(received["octomap_binary"][-1], received["projected_map"][-1], track)


def check_map(octomap, grid, track):
    """Trunks beside the path stand in the map where they stand in the forest, and little else."""
    scenario = parse_scenario(FOREST)
    terrain = build_terrain(scenario)
    forest = build_forest(scenario, terrain)
    feet = forest.position_map[:, :2]
    near = np.hypot(*(feet[:, None] - track[None, ::25]).transpose(2, 0, 1)).min(axis=1)
    tall = (near < 8.0) & (forest.height_m > 4.5)
    assert tall.any()
    cubes = decode_binary(np.asarray(octomap.data).view(np.uint8))
    middle = (cubes.corner + 0.5 * cubes.side[:, None])[cubes.occupied] * octomap.resolution
    above = middle[:, 2] - terrain.height(middle[:, 0], middle[:, 1])
    assert np.quantile(above, 0.01) > -0.4  # next to nothing under the ground
    trunk_high = middle[(above > 1.5) & (above < 4.0), :2]
    away = np.hypot(*(feet[tall][:, None] - trunk_high[None]).transpose(2, 0, 1)).min(axis=1)
    assert (away < 0.5).mean() >= 0.8
    values = np.asarray(grid.data).reshape(grid.info.height, grid.info.width)
    rows, columns = np.nonzero(values == 100)
    corner, cell = grid.info.origin.position, grid.info.resolution
    cells = np.stack([corner.x + (columns + 0.5) * cell, corner.y + (rows + 0.5) * cell], -1)
    marked = np.hypot(*(feet[tall][:, None] - cells[None]).transpose(2, 0, 1)).min(axis=1)
    assert (marked < 0.6).mean() >= 0.8


@pytest.mark.slow
def test_a_flight_repeats_to_the_byte_and_from_a_snapshot(simulate):
    flights = []
    for number in (1, 2):
        simulation = simulate(FOREST, threads=number)
        simulation.run(6.0)
        send_area(simulation)
        commands = listen(simulation, "cmd_vel")
        simulation.run(3.0)
        kept = simulation.snapshot()
        simulation.run(2.0)
        flights.append([repr(c) for c in commands])
    assert flights[0] == flights[1]
    assert len(flights[0]) > 100
    before = len(commands)
    simulation.restore(kept)
    simulation.run(2.0)
    again = [repr(c) for c in commands[before:]]
    assert again == flights[1][-len(again) :]
    assert len(again) >= 49
