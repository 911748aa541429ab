"""Values of clients that fit their types and break a node later: in a timer, on another topic.

Each node that ships flies with what it needs. A client publishes hard values on all that the node
subscribes to, sets its parameters to hard values, and the run goes on.
"""

from __future__ import annotations

from functools import partial

import pytest
from poison import plausible, poisoned
from whole_world import Client

from volery.core.errors import GraphError
from volery.graph.nodes.handles import NodeSubscription
from volery.scenario.node_names import registered_nodes

SENSORS = [
    {"kind": "lidar", "name": "horizontal"},
    {"kind": "lidar", "name": "nodding", "nodding": {"amplitude_deg": 45.0, "period_s": 1.0}},
    {"kind": "imu"},
    {"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]},
    {"kind": "camera", "rate_hz": 20.0, "width": 32, "height": 24, "compressed": "none"},
    {"kind": "odometry", "rate_hz": 50.0},
    {"kind": "gnss"},
    {"kind": "barometer"},
    {"kind": "battery"},
    {"kind": "ground_truth"},
]
AREA = [-20.0, -20.0, 20.0, 20.0]
NODES = {
    "region_avoidance": {},
    "cooperative_search": {
        "camera": "camera",
        "team": ["uav1", "uav2"],
        "area_m": AREA,
        "altitude_m": 3.0,
    },
    "coverage": {
        "uavs": ["uav1", "uav2"],
        "height_m": 2.5,
        "crossing_height_m": 10.0,
    },
    "depth_avoidance": {},
    "gap_following": {"route": [[15.0, 0.0]]},
    "mapping": {"voxels_period_s": 0.2, "grid_period_s": 0.2},
    "map_merging": {"period_s": 0.2},
    "exploration": {},
    "trajectory_follower": {},
    "global_planner": {"max_iterations": 50},
    "local_planner": {},
    "planar_slam": {},
    "slam": {},
    "tag_detection": {},
    "target_detection": {"camera": "camera"},
    "task_manager": {"area_m": AREA, "sector_m": 20.0},
    "radio": {"topics": ["odom nav_msgs/msg/Odometry"], "station_id": 1},
    "mavlink_autopilot": {},
    "policy": {"goal": [3.0, 1.0, 4.0]},
    "flock": {"uavs": ["uav1", "uav2"], "waypoints_m": [[3.0, 1.0]]},
    "v_formation": {"uavs": ["uav1", "uav2"]},
    "formation_member": {"uavs": ["uav1", "uav2"]},
    "pursuit": {"pursuers": ["uav2"], "uavs": ["uav1"]},
}
"""Nodes and their parameters."""
OF_THE_WORLD = (
    "coverage",
    "map_merging",
    "flock",
    "v_formation",
    "pursuit",
)
"""Nodes of no UAV."""
RATE_HZ = 250
STEPS_EACH = 30
"""Physics steps after each value: 0.12 s. Timers that are slower meet several values."""
HARD = (
    *(float("nan"), float("inf"), 1e308, -1e308, -1.0, 0.0, 1e-308, 10**30, -1, 0, True, None),
    *("", "x" * 100_000, "nan", [], [float("nan")], [0.0] * 10_000, {}, {"a": [1]}),
)


def test_every_node_that_ships_is_in_the_table():
    paths = registered_nodes()
    assert {name for name, path in paths.items() if path.startswith("volery.")} == {*NODES}


def flight(name):
    """Two UAVs in the air, the node with them."""
    node = {"node": name, "parameters": NODES[name]}
    of_world = name in OF_THE_WORLD
    return {
        "name": "hard_values",
        "duration_s": 1e6,
        "physics": {"rate_hz": RATE_HZ},
        "world": {"terrain": {"kind": "flat", "extent_m": 100.0}},
        "types": {
            "scout": {"sensors": SENSORS, "nodes": [] if of_world else [node]},
            "other": {"sensors": [{"kind": "odometry"}]},
        },
        "uavs": [
            {"type": "scout", "position_m": [0.0, 0.0, 3.0]},
            {"type": "other", "position_m": [8.0, 0.0, 3.0]},
        ],
        "nodes": [node] if of_world else [],
    }


def subscribed(node):
    """Topics that a node subscribes to at present."""
    held = tuple(node._Node__handles)
    return sorted({handle.topic for handle in held if isinstance(handle, NodeSubscription)})


@pytest.fixture
def flown(simulate, request):
    simulation = simulate(flight(request.param))
    simulation.step(RATE_HZ * 2)
    return Client(simulation), simulation.vehicles.nodes[0]


every_node = pytest.mark.parametrize("flown", NODES, indirect=True)


@pytest.mark.slow
@every_node
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_hard_values_on_every_topic_of_every_node(flown):
    client, node = flown
    simulation = client.simulation
    topics = subscribed(node)
    assert topics
    for topic in topics:
        for message in poisoned(last_message(simulation, topic)):
            client.publish(topic, message)
            simulation.step(STEPS_EACH)


@pytest.mark.slow
@every_node
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_hard_values_of_every_parameter_of_every_node(flown):
    client, _ = flown
    simulation, parameters = client.simulation, client.simulation.graph.parameters
    for full_name, name in parameters.names():
        parameter = parameters.get(full_name, name)
        before = parameter.value
        for value in HARD:
            done = simulation.post(partial(parameter.set, value))
            simulation.process_commands()
            error = done.exception(20.0)
            assert error is None or isinstance(error, GraphError), (full_name, name, value)
            if error is None:
                assert not parameter.read_only
                simulation.step(STEPS_EACH)
        parameter.value = before


def last_message(simulation, topic):
    """What is published on a topic in flight; a made-up message where nothing is."""
    received = []
    listening = simulation.graph.subscribe(
        topic, lambda published: received.append(published.message)
    )
    simulation.step(RATE_HZ // 5)
    listening.cancel()
    (msgtype,) = [found.msgtype for found in simulation.graph.topics() if found.name == topic]
    return received[-1] if received else plausible(msgtype)
