"""A trained policy flies the full simulation, from inside and from a process of its own."""

import threading

import numpy as np
import pytest
from policy_making import chasing_policy

from volery import Simulation, load_scenario
from volery.autonomy.policy.policy_file import write_policy
from volery.autonomy.policy.policy_node import PolicyNode
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.nodes.host import NodeHost
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.bridges.rosbridge.server import RosbridgeServer

GOAL = [3.0, 2.0, 5.0]
STEPS = 4000


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    path = tmp_path_factory.mktemp("policy") / "chasing.npz"
    write_policy(path, chasing_policy())
    return {"policy": str(path), "goal": GOAL}


def scenario(parameters=None, latency_s=0.02):
    """One F450 at 4 m that flies by its estimate, with or without the node."""
    data = load_scenario("policy_homing").model_dump(mode="json", exclude_unset=True)
    node = {"node": "policy", "latency_s": latency_s, "parameters": parameters}
    data["types"]["pupil"]["nodes"] = [] if parameters is None else [node]
    data["uavs"] = [{"type": "pupil", "position_m": [0.0, 0.0, 4.0]}]
    data["physics"] = {"rate_hz": 500}
    return type(load_scenario("hover")).model_validate(data)


def commands_of(simulation):
    commands = []
    simulation.graph.subscribe(
        "/uav1/cmd_vel", lambda p: commands.append((p.time_ns, p.cdr)), "geometry_msgs/msg/Twist"
    )
    return commands


def test_it_arrives_by_its_estimate_and_a_snapshot_continues_alike(policy):
    with Simulation(scenario(policy)) as simulation:
        uav = simulation.uavs["uav1"]
        simulation.step(STEPS // 2)
        snapshot = simulation.snapshot()
        simulation.step(STEPS // 2)
        arrived = uav.position_map.copy()
        simulation.restore(snapshot)
        simulation.step(STEPS // 2)
        assert uav.position_map.tobytes() == arrived.tobytes()
        assert np.linalg.norm(arrived - GOAL) < 0.6


def test_in_a_process_of_its_own_it_commands_the_same(policy):
    with Simulation(scenario(policy, latency_s=0.0)) as simulation:
        inside = commands_of(simulation)
        simulation.step(STEPS // 4)
    server = RosbridgeServer(port=0)
    with (
        Simulation(scenario()) as simulation,
        BridgeHost(simulation.gateway) as bridges,
    ):
        bridges.open(server)
        outside = commands_of(simulation)
        flying, problem = threading.Event(), []

        def run_node():
            client = RosbridgeClient(f"ws://127.0.0.1:{server.port}", name="policy")
            host = NodeHost(client, clock="simulated")
            try:
                PolicyNode(context=host.context(), namespace="/uav1", parameter_overrides=policy)
                host.join_lock_step("policy", 0.002)
                flying.set()
                host.spin(lambda: not flying.is_set())
            except Exception as error:
                problem.append(error)
            finally:
                client.close()

        thread = threading.Thread(target=run_node)
        thread.start()
        while not flying.is_set() and not problem:
            simulation.post(lambda: None)
            simulation.process_commands()
        simulation.step(STEPS // 4)
        flying.clear()
        thread.join()
        assert not problem
    assert len(inside) > 5
    assert [cdr for _, cdr in outside[: len(inside)]] == [cdr for _, cdr in inside[: len(outside)]]
