"""A client forges a UAV's odometry on the graph while a team flies: the team flies on as before."""

from __future__ import annotations

import json

import numpy as np
import pytest
from node_bench import odometry
from whole_world import Client

STEP = 10
"""Physics steps between two forged messages: the period of true ones."""


@pytest.fixture
def team_data(flat_data):
    flat_data["types"]["f450"]["sensors"] = [{"kind": "odometry", "rate_hz": 50.0, "noise": False}]
    flat_data["physics"] = {"rate_hz": 500}
    flat_data["uavs"] = [
        {
            "type": "f450",
            "count": 3,
            "position_m": [0.0, 0.0, 5.0],
            "last_position_m": [0.0, 12.0],
        }
    ]
    flat_data["nodes"] = [
        {
            "node": "flock",
            "parameters": {"uavs": "{uavs}", "waypoints_m": [[30.0, 6.0]]},
        }
    ]
    return flat_data


FORGED = {
    "far away": lambda now_ns, at: odometry(now_ns, np.add(at, [40.0, 0.0, 0.0])),
    "landed": lambda now_ns, at: odometry(now_ns, [at[0], at[1], 0.0]),
    "long ago": lambda _, at: odometry(0, at),
}


@pytest.mark.parametrize("kind", [None, *FORGED])
def test_a_team_flies_on_while_a_client_forges_odometry(simulate, team_data, kind):
    simulation = simulate(team_data)
    client, statuses = Client(simulation), []
    simulation.graph.subscribe(
        "/flock/status", lambda published: statuses.append(json.loads(published.message.data))
    )
    simulation.run(2.0)
    for _ in range(200):
        simulation.step(STEP)
        if kind is not None:
            at = simulation.uavs["uav2"].position_map
            client.publish("/uav2/odom", FORGED[kind](simulation.time_ns, at))
    positions = np.array([uav.position_map for uav in simulation.uavs.values()])
    np.testing.assert_allclose(positions[:, 0], positions[1, 0], atol=0.5)
    np.testing.assert_allclose(positions[:, 1], [0.0, 6.0, 12.0], atol=1.0)
    assert positions[:, 0].min() > 8.0
    assert statuses[-1]["members"] == 3
    assert statuses[-1]["refused"] == 0 if kind is None else statuses[-1]["refused"] > 100
