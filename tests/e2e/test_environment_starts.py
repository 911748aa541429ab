"""Environments that start in the air: as a UAV that is placed there, at every reset."""

import numpy as np
import pytest

from volery.core.errors import CommandError
from volery.runtime import VectorizedSimulation
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.load import parse_scenario

STATES = ("position_map", "velocity_map", "attitude", "omega_body", "rotor_speed")


@pytest.fixture
def envs(flat_data):
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0, 0.2], "on_start": "take_off"},
        {"type": "f450", "position_m": [4.0, 0.0, 4.2]},
    ]
    with VectorizedSimulation(parse_scenario(flat_data), 4, threads=2) as made:
        yield made


def motion(envs, seed=3):
    """Positions, attitudes, velocities and rates of the UAVs of `envs` environments."""
    draw = np.random.default_rng(seed)
    attitude = draw.normal(size=(envs, 2, 4)) * [0.2, 0.2, 0.2, 0.0] + [0.0, 0.0, 0.0, 1.0]
    return EnvironmentStart(
        draw.uniform([-5.0, -5.0, 3.0], [5.0, 5.0, 9.0], (envs, 2, 3)),
        attitude / np.linalg.norm(attitude, axis=-1, keepdims=True),
        draw.normal(size=(envs, 2, 3)),
        draw.normal(size=(envs, 2, 3)),
    )


def assert_start(envs, chosen, start):
    state = envs.state()
    np.testing.assert_array_equal(state.position_map[chosen], start.position_map)
    np.testing.assert_allclose(state.attitude[chosen], start.attitude, atol=1e-15)
    np.testing.assert_array_equal(state.velocity_map[chosen], start.velocity_map)
    np.testing.assert_array_equal(state.omega_body[chosen], start.omega_body)


def test_a_start_equals_a_uav_that_is_placed_and_pushed(envs, flat_data):
    start = motion(4)
    envs.reset(start=start)
    assert_start(envs, slice(None), start)
    flat_data["uavs"][0]["on_start"] = "wait"
    with VectorizedSimulation(parse_scenario(flat_data), 4, threads=1) as moved:
        fleet = moved._blocks[0].fleet
        rows = [np.reshape(value, (8, -1)) for value in vars(start).values()]
        for row in range(8):
            fleet.put(row, rows[0][row], rows[1][row])
            fleet.push(row, rows[2][row], rows[3][row])
        for each in (envs, moved):
            each.run(0.3)
            each.command_velocity([1.0, 0.0, 0.0])
            each.run(0.5)
        for name in STATES:
            found, expected = getattr(envs.state(), name), getattr(moved.state(), name)
            np.testing.assert_array_equal(found, expected, err_msg=name)


def test_a_later_start_flies_as_one_at_the_beginning(envs, flat_data):
    with VectorizedSimulation(parse_scenario(flat_data), 4, threads=1) as fresh:
        fresh.reset(seeds=[10, 11, 12, 13], start=motion(4))
        fresh.run(0.4)
        expected = fresh.state()
        accelerations = fresh.sample("uav1", "imu")["specific_force"]
    envs.run(3 * envs.common_period_s)
    others = np.array([1, 3])
    start = motion(4)
    part = EnvironmentStart(*(np.asarray(value)[others] for value in vars(start).values()))
    envs.reset(others, seeds=[11, 13], start=part)
    assert_start(envs, others, part)
    envs.run(0.4)
    for name in STATES:
        np.testing.assert_array_equal(
            getattr(envs.state(), name)[others], getattr(expected, name)[others]
        )
    found = envs.sample("uav1", "imu")["specific_force"]
    np.testing.assert_array_equal(found[others], accelerations[others])


def test_starts_broadcast_and_the_next_reset_starts_on_the_ground(envs):
    positions = [[1.0, 2.0, 6.0], [1.0, 5.0, 6.0]]
    envs.reset(start=EnvironmentStart(positions))
    assert (envs.state().position_map == positions).all()
    envs.run(1.0)
    np.testing.assert_allclose(envs.state().position_map[..., 2], 6.0, atol=0.3)
    envs.reset()
    assert (envs.state().position_map[:, 0, 2] < 0.5).all()
    envs.run(4.0)
    assert (envs.state().position_map[:, 0, 2] > 2.0).all()


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (EnvironmentStart(np.zeros((3, 2, 3))), r"position of the start: .* \(4, 2, 3\)"),
        (EnvironmentStart([0.0, np.nan, 1.0]), "position of the start"),
        (EnvironmentStart([0.0, 0.0, 1.0], attitude=[0.0, 0.0, 0.0, 2.0]), "attitude of the start"),
        (EnvironmentStart([0.0, 0.0, 1.0], attitude=[0.0, 0.0, 0.0, 0.1]), "unit quaternions"),
        (
            EnvironmentStart([0.0, 0.0, 1.0], velocity_map=[0.0, 0.0, 200.0]),
            "velocity of the start",
        ),
    ],
)
def test_impossible_starts_are_refused(envs, start, message):
    before = envs.state().position_map
    with pytest.raises(CommandError, match=message):
        envs.reset(start=start)
    np.testing.assert_array_equal(envs.state().position_map, before)
