"""How the controlled F450 moves: each number here is a promise to planners of flights."""

import numpy as np
import pytest
from flights import F450, FLAT, in_air, ring, track

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.core import rotations
from volery.vehicle.airframe import Airframe


def test_hover_stands_still():
    fleet = in_air()
    position, velocity, tilt = track(fleet, 5.0)
    np.testing.assert_allclose(position, np.broadcast_to([0, 0, 50], position.shape), atol=1e-6)
    assert np.abs(velocity).max() < 1e-6
    assert tilt.max() < 1e-6


@pytest.mark.parametrize("step", [(5, 0, 0), (0, -5, 0), (0, 0, 5), (0, 0, -5), (3, -4, 2)])
def test_position_step(step):
    """5 m: no more than a tenth beyond, within 25 cm after 5 s, hardly to the side."""
    fleet = in_air()
    target = np.array([0, 0, 50.0]) + step
    fleet.command_position(0, target)
    position, _, _ = track(fleet, 12.0)
    step = np.array(step, float)
    length = np.linalg.norm(step)
    offset = position - [0, 0, 50]
    along = offset @ step / length
    assert along.max() < 1.1 * length
    late = position[500:]
    assert np.linalg.norm(late - target, axis=1).max() < 0.25
    assert np.linalg.norm(offset - np.outer(along, step / length), axis=1).max() < 0.6
    np.testing.assert_allclose(position[-1], target, atol=0.02)
    assert fleet.mode(0) is FlightMode.HOLD


@pytest.mark.parametrize("velocity", [(2, 0, 0), (0, 5, 0), (8, 0, 0), (10, 0, 0), (-5, 5, 1)])
def test_velocity_tracking(velocity):
    fleet = in_air()
    fleet.set_command_timeout(60.0)
    fleet.command_velocity_map(0, velocity)
    _, flown, tilt = track(fleet, 12.0)
    velocity = np.array(velocity, float)
    speed = np.linalg.norm(velocity)
    np.testing.assert_allclose(flown[-1], velocity, atol=0.05)
    assert (flown @ velocity / speed).max() < 1.15 * speed
    assert np.abs(flown[:, 2] - velocity[2])[100:].max() < 0.4  # height is kept under tilt
    assert tilt.max() < np.radians(F450.limits.tilt_deg)


def test_speed_is_limited_but_its_direction_kept():
    fleet = in_air()
    fleet.set_command_timeout(60.0)
    fleet.command_velocity_map(0, (40, 30, 0))
    _, flown, tilt = track(fleet, 15.0)
    speed = np.linalg.norm(flown[-1])
    assert 0.93 * F450.limits.speed_m_s < speed < 1.02 * F450.limits.speed_m_s
    np.testing.assert_allclose(flown[-1] / speed, (0.8, 0.6, 0), atol=0.03)
    assert tilt.max() < np.radians(F450.limits.tilt_deg + 2.0)


def test_position_is_kept_in_wind():
    fleet = in_air()
    position, velocity, _ = track(fleet, 15.0, wind=(6.0, -2.0, 0.5))
    np.testing.assert_allclose(position[-1], [0, 0, 50], atol=0.02)
    assert np.linalg.norm(velocity[-1]) < 0.01


def test_twist_turns_with_the_vehicle():
    """Forward speed and yaw rate make a circle: radius = speed / rate."""
    fleet = in_air()
    fleet.set_command_timeout(60.0)
    fleet.command_velocity_body(0, (2.0, 0.0, 0.0), 0.5)
    position, _, _ = track(fleet, 30.0)
    circle = position[-1257:]  # one turn
    centre = circle[:, :2].mean(axis=0)
    radius = np.linalg.norm(circle[:, :2] - centre, axis=1)
    assert radius.mean() == pytest.approx(4.0, rel=0.05)
    assert np.ptp(radius) < 0.3
    assert fleet.state.omega_body[0, 2] == pytest.approx(0.5, rel=0.1)


def test_yaw_step_and_its_rate_limit():
    fleet = in_air()
    fleet.command_position(0, (0, 0, 50), yaw=3.0)
    fastest = 0.0
    for _ in range(600):
        fleet.advance(10, FLAT.grid)
        fastest = max(fastest, abs(fleet.state.omega_body[0, 2]))
    assert float(rotations.yaw_of(fleet.state.attitude[0])) == pytest.approx(3.0, abs=0.02)
    assert fastest < 1.1 * np.radians(F450.limits.yaw_rate_deg_s)
    np.testing.assert_allclose(fleet.state.position_map[0], [0, 0, 50], atol=0.05)


def test_velocity_to_a_heading():
    fleet = in_air()
    fleet.set_command_timeout(60.0)
    fleet.command_velocity_map(0, (0, 3, 0), yaw=np.pi / 2)
    track(fleet, 6.0)
    assert float(rotations.yaw_of(fleet.state.attitude[0])) == pytest.approx(np.pi / 2, abs=0.03)
    np.testing.assert_allclose(fleet.state.velocity_map[0], (0, 3, 0), atol=0.05)


def test_attitude_command():
    fleet = in_air()
    wanted = rotations.from_rpy(0.2, -0.1, 0.5)
    for _ in range(5):
        fleet.command_attitude(0, wanted, F450.weight)
        fleet.advance(200, FLAT.grid)
    error = rotations.logarithm(
        rotations.multiply(rotations.conjugate(fleet.state.attitude[0]), wanted)
    )
    assert np.linalg.norm(error[:2]) < 0.03
    assert fleet.mode(0) is FlightMode.LOW_LEVEL


def test_rates_command():
    fleet = in_air()
    fleet.command_rates(0, (0.0, 0.0, 1.0), F450.weight)
    fleet.advance(1000, FLAT.grid)
    np.testing.assert_allclose(fleet.state.omega_body[0], (0, 0, 1.0), atol=0.02)
    fleet.command_rates(0, (2.0, -1.0, 0.0), F450.weight)
    fleet.advance(300, FLAT.grid)
    np.testing.assert_allclose(fleet.state.omega_body[0, :2], (2.0, -1.0), atol=0.15)


def test_thrust_command_is_in_newtons():
    fleet = in_air()
    fleet.command_rates(0, (0, 0, 0), 1.5 * F450.weight)
    fleet.advance(100, FLAT.grid)
    # the rotor model loses thrust with the speed of climb, 4 % a metre a second
    assert fleet.state.acceleration_map[0, 2] == pytest.approx(0.5 * 9.80665, rel=0.08)


def test_upside_down_recovers():
    fleet = Fleet([F450], [[0, 0, 100.0]], [rotations.from_rpy(np.pi - 0.01, 0.0, 0.4)])
    position, _, tilt = track(fleet, 10.0)
    assert tilt[-1] < 0.01
    assert position[:, 2].min() > 60.0
    np.testing.assert_allclose(position[-1], [0, 0, 100], atol=0.1)


@pytest.mark.parametrize("count", [6, 8])
def test_own_airframes_fly(count):
    """More rotors, other mass: gains follow from the file."""
    frame = ring(count, mass_kg=3.0 if count == 6 else 5.0, inertia_kg_m2=(0.08, 0.09, 0.15))
    fleet = in_air(airframe=frame)
    track(fleet, 2.0)
    np.testing.assert_allclose(fleet.state.position_map[0], [0, 0, 50], atol=1e-6)
    fleet.command_position(0, (5, 0, 50), yaw=1.0)
    position, _, _ = track(fleet, 12.0)
    assert position[:, 0].max() < 5.5
    np.testing.assert_allclose(position[-1], (5, 0, 50), atol=0.05)


def test_a_file_may_override_bandwidths():
    data = F450.model_dump()
    data["control"] = {"position": 0.4}
    slow, usual = in_air(airframe=Airframe.model_validate(data)), in_air()
    for fleet in (slow, usual):
        fleet.command_position(0, (1, 0, 50))
        track(fleet, 2.0)
    assert slow.state.position_map[0, 0] < 0.8 * usual.state.position_map[0, 0]
