"""Landings come down fast high up and slowly near the ground, as PX4's do."""

import numpy as np
import pytest
from flying_bench import fly

from volery.graph.messages import message_type

LAND, RETURN, ACCEPTED = 21, 20, 0
FAST, SLOW = 1.5, 0.7
"""m/s: PX4's defaults of MPC_Z_V_AUTO_DN and MPC_LAND_SPEED."""


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield simulation, station


def land(simulation, station):
    """Height of home, and what `sink` gives."""
    uav = simulation.uavs["uav1"]
    home = uav.position_map[2]
    station.up(16.0)
    assert station.command(LAND) == ACCEPTED
    return home, sink(simulation, station, home)


def sink(simulation, station, home):
    """(T, 2) heights above home and speeds downwards until it stands, twenty a second."""
    uav = simulation.uavs["uav1"]
    seen = []
    while uav.mode.name != "LANDED":
        assert len(seen) < 1200, "it never landed"
        station.seconds(0.05)
        seen.append((uav.position_map[2] - home, -uav.velocity_map[2]))
    return np.array(seen)


def speed_at(seen, height):
    return float(np.interp(-height, -seen[:, 0], seen[:, 1]))


def test_it_slows_down_by_the_height(flight):
    _, seen = land(*flight)
    assert speed_at(seen, 12.0) == pytest.approx(FAST, abs=0.1)
    assert speed_at(seen, 7.5) == pytest.approx(0.5 * (FAST + SLOW), abs=0.15)
    assert speed_at(seen, 3.0) == pytest.approx(SLOW, abs=0.1)
    assert speed_at(seen, 0.5) == pytest.approx(SLOW, abs=0.1)
    assert not flight[0].uavs["uav1"].crashed
    assert 0.05 * len(seen) < 20.0  # 24 s with 0.7 m/s all the way


def test_its_parameters_act(flight):
    simulation, station = flight
    for name, value in (
        ("MPC_LAND_ALT1", 6.0),
        ("MPC_LAND_ALT2", 3.0),
        ("MPC_LAND_SPEED", 1.1),
        ("MPC_Z_V_AUTO_DN", 1.3),
    ):
        assert station.set(name, value) == pytest.approx(value)
    _, seen = land(simulation, station)
    assert speed_at(seen, 8.0) == pytest.approx(1.3, abs=0.1)
    assert speed_at(seen, 1.5) == pytest.approx(1.1, abs=0.1)
    assert station.set("MPC_LAND_SPEED", 0.5) == pytest.approx(1.1)  # PX4's least is 0.6


def test_steps_in_the_wrong_order_are_one_step(flight):
    simulation, station = flight
    station.set("MPC_LAND_ALT1", 2.0)
    _, seen = land(simulation, station)
    assert speed_at(seen, 7.0) == pytest.approx(FAST, abs=0.1)
    assert speed_at(seen, 3.0) == pytest.approx(SLOW, abs=0.1)


def test_the_height_is_that_above_home(flight):
    simulation, station = flight
    station.up(16.0)
    assert station.command(179, 0.0, 0.0, 0.0, 0.0, 47.397742, 8.545594, 488.0 + 10.0) == ACCEPTED
    assert station.command(LAND) == ACCEPTED
    seen = sink(simulation, station, 0.0)
    assert speed_at(seen, 11.0) == pytest.approx(SLOW, abs=0.1)


def test_returns_land_so_too(flight):
    simulation, station = flight
    station.set("RTL_DESCEND_ALT", 14.0)
    home = simulation.uavs["uav1"].position_map[2]
    station.up(16.0)
    assert station.command(RETURN) == ACCEPTED
    seen = sink(simulation, station, home)
    assert speed_at(seen, 11.0) == pytest.approx(FAST, abs=0.15)
    assert speed_at(seen, 3.0) == pytest.approx(SLOW, abs=0.1)


def test_a_landing_speed_is_of_one_landing(flight):
    simulation, _ = flight
    uav = simulation.uavs["uav1"]

    def ask(speed):
        request = message_type("volery_interfaces/srv/SetLandingSpeed_Request")(speed)
        return simulation.graph.call("/uav1/set_landing_speed", request)

    assert "is not landing" in ask(1.0).message
    uav.take_off(12.0)
    simulation.run(12.0)
    uav.land()
    assert "must be above 0" in ask(-1.0).message
    assert ask(9.0).success
    simulation.run(3.0)
    assert -uav.velocity_map[2] == pytest.approx(uav.airframe.limits.descent_m_s, abs=0.1)
    uav.hold()
    simulation.run(2.0)
    uav.land()
    simulation.run(3.0)
    assert -uav.velocity_map[2] == pytest.approx(uav.airframe.limits.landing_m_s, abs=0.1)
