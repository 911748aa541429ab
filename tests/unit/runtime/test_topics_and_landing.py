"""A requested landing is not undone by a client that still publishes velocities."""

import pytest

from volery.control.flight_modes import FlightMode
from volery.graph.messages import Twist, Vector3

AHEAD = Twist(Vector3(0.5, 0.0, 0.0), Vector3(0.0, 0.0, 0.0))


@pytest.fixture
def flying(simulate, flat_data):
    """A UAV that flies on a stream of Twists at 20 Hz."""
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 3.0]
    simulation = simulate(flat_data)
    publisher = simulation.graph.advertise("/uav1/cmd_vel", Twist)
    simulation._engine.every(0.05, lambda: publisher.publish(AHEAD))
    simulation.run(1.0)
    assert simulation.uavs["uav1"].mode is FlightMode.VELOCITY
    return simulation


def test_land_wins(flying):
    uav = flying.uavs["uav1"]
    flying.graph.call("/uav1/land")
    flying.run(1.0)
    assert uav.mode is FlightMode.LAND
    flying.run(8.0)
    assert uav.mode is FlightMode.LANDED


def test_return_wins(flying):
    flying.graph.call("/uav1/return_home")
    flying.run(1.0)
    assert flying.uavs["uav1"].mode is FlightMode.RETURN


def test_hold_ends_a_landing_and_then_the_stream_is_flown(flying):
    flying.graph.call("/uav1/land")
    flying.run(0.2)
    flying.graph.call("/uav1/hold")
    assert flying.uavs["uav1"].mode is FlightMode.HOLD
    flying.run(0.1)
    assert flying.uavs["uav1"].mode is FlightMode.VELOCITY
