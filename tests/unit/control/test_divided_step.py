"""A large fleet on several threads, with the bytes of one."""

import numpy as np
import pytest
from flights import FLAT

from volery.control import divided_step
from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.core.workers import Workers
from volery.vehicle.airframe import load_airframe
from volery.vehicle.plant_types import Kinematic, RigidBody
from volery.world.weather import Weather

COUNT = 300


@pytest.fixture(scope="module")
def workers():
    team = Workers(3)
    yield team
    team.close()


@pytest.fixture(autouse=True)
def _always_divided(monkeypatch):
    monkeypatch.setattr(divided_step, "_WORTH", 0)


def swarm():
    """Crazyflies in five layers above each other, some landed, one kinematic, in turbulence."""
    cell = np.stack(np.meshgrid(np.arange(10), np.arange(6), np.arange(5)), axis=-1).reshape(-1, 3)
    position = cell * (0.6, 0.6, 0.7) + (0.0, 0.0, 0.4)
    position[:7, 2] = 0.02
    modes = [FlightMode.LANDED] * 7 + [FlightMode.HOLD] * (COUNT - 7)
    plants = [Kinematic() if i == 9 else RigidBody() for i in range(COUNT)]
    level = np.tile([0.0, 0.0, 0.0, 1.0], (COUNT, 1))
    return Fleet(
        [load_airframe("crazyflie")] * COUNT,
        position,
        level,
        mode=modes,
        plants=plants,
        weather=Weather((1.0, 0.5, 0.0), w20_m_s=8.0),
        seed=3,
    )


def flown(steps, workers):
    fleet = swarm()
    rng = np.random.default_rng(1)
    events = []
    for _ in range(6):
        for i in range(7, COUNT, 3):
            velocity = rng.uniform(-1.0, 1.0, 3)
            if not fleet.state.crashed[i]:
                fleet.command_velocity_body(i, velocity)
        for i in range(7):
            if fleet.mode(i) is FlightMode.LANDED:
                fleet.take_off(i, 0.5)
        end = fleet.step + steps // 6
        while fleet.step < end:
            fleet.state.contact_budget[:] = fleet.state.separation_budget[:] = 0.3
            fleet.advance(end - fleet.step, FLAT.grid, event_ends=True, workers=workers)
            events += fleet.drain_events()
    return fleet, events


def test_threads_change_nothing(workers):
    one, events = flown(600, None)
    several, same_events = flown(600, workers)
    assert len(events) > 20  # take-offs, falls onto the ground
    assert events == same_events
    assert one.get_state()["uavs"].tobytes() == several.get_state()["uavs"].tobytes()
    np.testing.assert_array_equal(one.history.position, several.history.position)
    np.testing.assert_array_equal(one.history.attitude, several.history.attitude)
