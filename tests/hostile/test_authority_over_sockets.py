"""Two operators over real connections: no alias of a UAV's topics and services moves another's."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from volery import load_scenario

sys.path.append(str(Path(__file__).parents[1] / "unit" / "server"))
from page_bench import Client, Flight, eventually, serving

KILL = {"command": 400, "param1": 0.0, "param2": 21196.0}


@pytest.fixture(scope="module")
def flight():
    """A UAV with an autopilot, whose topics and services have names of MAVROS, in the air."""
    scenario = load_scenario("hover").with_(duration_s=1e5)
    kind = scenario.uavs[0].type
    flight = Flight(scenario.with_({f"types.{kind}.nodes": [{"node": "mavlink_autopilot"}]}))
    try:
        uav = flight.simulation.uavs["uav1"]
        eventually(lambda: flight.do(lambda: uav.position_map[2]) > 1.0)
        yield flight
    finally:
        flight.close()


@pytest.fixture(scope="module")
def server(flight):
    with serving(flight.simulation) as server:
        yield server


@pytest.fixture
def anna(server):
    with Client(server) as anna:
        taken = anna.call("/volery/take_control", uav="uav1", operator="Anna")
        assert taken[1], taken
        assert taken[0]["success"], taken
        yield anna


@pytest.fixture
def ben(server, anna):
    with Client(server) as ben:
        yield ben


@pytest.mark.parametrize(
    ("service", "args"),
    [
        ("/mavros/cmd/command", KILL),
        ("mavros/cmd/command#7", KILL),
        ("/uav1/mavros/cmd/command", KILL),
        ("/mavros/cmd/land", {}),
        ("/mavros/set_mode", {"custom_mode": "AUTO.LAND"}),
    ],
)
def test_a_service_that_moves_the_uav_of_another_is_refused(flight, ben, service, args):
    values, succeeded = ben.call(service, **args)
    assert not succeeded
    assert "uav1 is held by Anna" in str(values)
    uav = flight.simulation.uavs["uav1"]
    assert flight.do(lambda: uav.position_map[2]) > 1.0


def test_a_topic_that_moves_the_uav_of_another_is_refused(flight, ben):
    ben.send("publish", topic="/mavros/setpoint_velocity/cmd_vel", msg={})
    assert "uav1 is held by Anna" in ben.until("status")["msg"]


def test_the_one_that_controls_it_may(anna):
    values, succeeded = anna.call("/mavros/set_mode", custom_mode="AUTO.LOITER")
    assert succeeded
    assert values["mode_sent"]
