"""The same node inside the simulation and outside of it: equal results."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager

import pytest

from volery import Simulation
from volery.autonomy.avoidance.gap_following import GapFollowing
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.nodes.host import NodeHost
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import GraphError
from volery.scenario.load import parse_scenario

SECONDS = 6.0
PARAMETERS = {
    "route": [[40.0, 0.0]],
    "level_mount": [0.0, 0.0, 0.18],
    "nodding_mount": [0.10, 0.0, -0.08],
}


def scenario(*, with_node):
    lidars = [
        {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
        {
            "kind": "lidar",
            "name": "nodding",
            "position_m": [0.10, 0.0, -0.08],
            "nodding": {"amplitude_deg": 45.0, "period_s": 1.0},
        },
    ]
    sonar = {"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]}
    node = {"node": "gap_following", "parameters": PARAMETERS}
    return parse_scenario(
        {
            "name": "outside",
            "duration_s": 60.0,
            "world": {
                "terrain": {"kind": "flat", "extent_m": 100.0},
                "forest": {
                    "kind": "procedural",
                    "region_m": [0.0, 0.0, 100.0, 100.0],
                    "trees": 200,
                    "species": {"broadleaf": 1.0},
                },
            },
            "types": {
                "surveyor": {
                    "airframe": "f450",
                    "flight": {"take_off_altitude_m": 3.0},
                    "sensors": [*lidars, {"kind": "imu"}, sonar, {"kind": "odometry"}],
                    "nodes": [node] if with_node else [],
                }
            },
            "uavs": [{"type": "surveyor", "position_m": [20.0, 50.0], "placement": "nearest_free"}],
        }
    )


def listen(simulation):
    """Commands of the node, and the UAV's trajectory, as they come."""
    commands = []
    simulation.graph.subscribe(
        "/uav1/cmd_vel",
        lambda p: commands.append((p.time_ns, p.cdr)),
        "geometry_msgs/msg/Twist",
    )
    return commands


def fly_inside():
    with Simulation(scenario(with_node=True)) as simulation:
        commands = listen(simulation)
        simulation.run(SECONDS)
        return commands, simulation.uavs["uav1"].position_map


@contextmanager
def in_memory(simulation):
    yield lambda: simulation.gateway.open("gap_following")


@contextmanager
def over_rosbridge(simulation):
    server = RosbridgeServer(port=0)
    with BridgeHost(simulation.gateway) as bridges:
        bridges.open(server)
        yield lambda: RosbridgeClient(f"ws://127.0.0.1:{server.port}", name="gap_following")


def fly_outside(connect):
    with Simulation(scenario(with_node=False)) as simulation, connect(simulation) as open_link:
        commands = listen(simulation)
        flying, problem = threading.Event(), []

        def run_node():
            session = open_link()
            host = NodeHost(session, clock="simulated")
            try:
                GapFollowing(
                    context=host.context(), namespace="/uav1", parameter_overrides=PARAMETERS
                )
                host.join_lock_step("gap_following", 0.001)
                flying.set()
                host.spin(lambda: not flying.is_set())
            except Exception as error:
                problem.append(error)
            finally:
                session.close()

        thread = threading.Thread(target=run_node)
        thread.start()
        while not flying.is_set() and not problem:
            simulation.post(lambda: None)
            simulation.process_commands()
        simulation.run(SECONDS)
        flying.clear()
        thread.join()
        assert not problem
        return commands, simulation.uavs["uav1"].position_map


CONNECTIONS = {
    "in memory": in_memory,
    "rosbridge": over_rosbridge,
}


@pytest.mark.parametrize("connect", CONNECTIONS.values(), ids=CONNECTIONS)
def test_a_lock_step_partner_outside_flies_what_the_node_inside_flies(connect):
    inside, position = fly_inside()
    outside, other_position = fly_outside(connect)
    assert len(inside) > 50
    assert outside == inside
    assert (position == other_position).all()


def test_joining_needs_a_connection_for_responses():
    with Simulation(scenario(with_node=False)) as simulation:
        session = simulation.gateway.open("mute")
        from volery.graph.messages import message_type
        from volery.graph.service_reply import ServiceReply

        kind = message_type("volery_interfaces/srv/JoinLockStep_Request")
        request = kind("mute", 0.001, 1.0, False, False)
        responses = []
        session.call(
            "/volery/join_lock_step", request, ServiceReply(responses.append, responses.append)
        )
        simulation.step()
        assert not responses[0].success
        assert "advertise" in responses[0].message


def test_a_name_is_taken_once():
    with Simulation(scenario(with_node=False)) as simulation:
        session = simulation.gateway.open("twice")
        results = []

        def join():
            host = NodeHost(session, clock="simulated")
            for _ in range(2):
                try:
                    host.join_lock_step("twice", 0.5)
                    results.append("joined")
                except GraphError as error:
                    results.append(str(error))

        thread = threading.Thread(target=join)
        thread.start()
        while thread.is_alive():
            simulation.process_commands()
        thread.join()
        assert results[0] == "joined"
        assert "already" in results[1]
        session.close()
        simulation.run(2.0)


@pytest.mark.parametrize("gone", ["closes", "is silent"])
def test_a_node_that_does_not_respond_is_left_behind(gone):
    with Simulation(scenario(with_node=False)) as simulation:
        session = simulation.gateway.open("lost")

        def join():
            NodeHost(session, clock="simulated").join_lock_step("lost", 0.1, timeout_s=0.3)
            if gone == "closes":
                session.close()

        thread = threading.Thread(target=join)
        thread.start()
        while thread.is_alive():
            simulation.process_commands()
        thread.join()
        before = time.monotonic()
        simulation.run(0.5)
        waited_s = time.monotonic() - before
        assert simulation.time_s == pytest.approx(0.5)
        if gone == "is silent":
            assert waited_s >= 0.3
        simulation.clock.add_partner("lost", period_s=1.0)  # the name is free again
        if gone == "closes":
            topics = {t.name: t for t in simulation.graph.topics()}
            assert topics["/volery/lock_step/lost/go"].publishers == 0
