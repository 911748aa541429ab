"""Actions command what they say; frames and random numbers are those of their names."""

from dataclasses import replace

import numpy as np
import pytest

from volery.core import rng, rotations
from volery.core.errors import CommandError, ScenarioError
from volery.learning.actions import AttitudeThrust, Choices, Position, RatesThrust, Velocity
from volery.learning.draws import Draws
from volery.learning.episodes import Episodes
from volery.learning.tasks import load_task
from volery.runtime.environment_start import EnvironmentStart


@pytest.fixture
def fly():
    """Fly hover with another action, from rest, and return the last state of two environments."""
    made = []

    def flown(action, numbers, decisions):
        episodes = Episodes(replace(load_task("hover"), action=action), 2, threads=1)
        made.append(episodes)
        episodes.begin(np.arange(2))
        episodes.envs.reset(start=EnvironmentStart([0.0, 0.0, 10.0]))
        for _ in range(decisions):
            episodes.decide(np.tile(numbers, (2, 1, 1)))
        return episodes.flight.state

    yield flown
    for episodes in made:
        episodes.close()


@pytest.mark.parametrize("action", [Velocity(), Position(), AttitudeThrust(), RatesThrust()])
def test_zero_keeps_the_height(fly, action):
    state = fly(action, np.zeros(4), 100)
    np.testing.assert_allclose(state.position_map[:, 0], [[0.0, 0.0, 10.0]] * 2, atol=0.05)


def test_a_velocity_is_flown(fly):
    state = fly(Velocity(speed_m_s=2.0), [0.5, 0.0, 0.0, 0.0], 300)
    np.testing.assert_allclose(state.velocity_map[:, 0], [[1.0, 0.0, 0.0]] * 2, atol=0.1)


def test_a_position_ahead_moves_the_uav_and_stops_it(fly):
    state = fly(Position(range_m=2.0), [0.5, 0.0, 0.0, 0.0], 1)
    assert 0.0 < state.position_map[0, 0, 0] < 0.5
    state = fly(Position(range_m=2.0), [0.0, 0.25, 0.0, 0.0], 200)
    assert (state.velocity_map[:, 0, 1] > 0.2).all()
    state = fly(Position(range_m=2.0, yaw_rate_rad_s=1.0), [0.0, 0.0, 0.0, 0.5], 100)
    np.testing.assert_allclose(state.omega_body[:, 0, 2], 0.5, atol=0.1)
    np.testing.assert_allclose(state.position_map[:, 0], [[0.0, 0.0, 10.0]] * 2, atol=0.05)


def test_choices_are_rows_of_another_action(fly):
    table = ((0.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0))
    action = Choices(Velocity(speed_m_s=1.5), table)
    assert (action.choices, action.size, action.of) == (2, 1, "velocity")
    state = fly(action, [1.0], 300)
    np.testing.assert_allclose(state.velocity_map[:, 0], [[0.0, -1.5, 0.0]] * 2, atol=0.1)
    for wrong in (((0.0,) * 4,), ((0.0,) * 3,) * 2, ((2.0,) * 4,) * 2):
        with pytest.raises(ScenarioError, match="at least two rows of 4 numbers"):
            Choices(Velocity(), wrong)
    with pytest.raises(ScenarioError, match="of a continuous action"):
        Choices(action, table)


def test_an_attitude_is_held(fly):
    state = fly(AttitudeThrust(tilt_rad=0.4), [0.0, 0.5, 0.0, 0.0], 60)
    up = rotations.rotate(state.attitude, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.arcsin(up[:, 0, 0]), 0.2, atol=0.03)


def test_rates_and_thrust_are_flown(fly):
    state = fly(RatesThrust(rate_rad_s=2.0), [0.0, 0.0, 0.5, 0.2], 40)
    np.testing.assert_allclose(state.omega_body[:, 0, 2], 1.0, atol=0.15)
    assert (state.velocity_map[:, 0, 2] > 0.3).all()


def test_vectors_are_turned_into_the_frames_of_their_names(fly):
    episodes = Episodes(load_task("hover"), 2, threads=1)
    episodes.begin(np.arange(2))
    yaw = rotations.from_rpy(0.0, 0.0, np.pi / 2.0)
    attitude = rotations.multiply(yaw, rotations.from_rpy(0.0, 0.3, 0.0))
    episodes.envs.reset(start=EnvironmentStart([0.0, 0.0, 10.0], attitude))
    flight = episodes.flight
    flight.refresh()
    north = np.tile([0.0, 2.0, 0.0], (2, 1, 1))
    np.testing.assert_allclose(flight.to_heading(north)[:, 0], [[2.0, 0.0, 0.0]] * 2, atol=1e-12)
    body = flight.to_body(north)[:, 0]
    np.testing.assert_allclose(body, [[2 * np.cos(0.3), 0.0, 2 * np.sin(0.3)]] * 2, atol=1e-12)
    episodes.close()


def test_a_state_of_an_earlier_decision_is_not_read_later():
    episodes = Episodes(load_task("hover"), 2, threads=2)
    episodes.begin(np.arange(2))
    state = episodes.flight.state
    before = state.position_map.copy()
    episodes.decide(np.zeros((2, 1, 4)))
    np.testing.assert_array_equal(state.position_map, before)
    with pytest.raises(CommandError, match="velocity_map was not read before the next step"):
        _ = state.velocity_map
    with pytest.raises(AttributeError, match="no field 'speed'"):
        _ = episodes.flight.state.speed
    episodes.close()


def test_numbers_are_those_of_the_named_streams_and_depend_on_the_own_seed_alone():
    draws, other = Draws(3), Draws(2)
    draws.seed(np.arange(3), [5, 6, 7])
    other.seed(np.arange(2), [7, 5])
    first = draws.uniform(np.arange(3), shape=(4,))
    second = other.uniform(np.array([1]), shape=(4,))
    np.testing.assert_array_equal(first[0], second[0])
    key = draws.get_state()[0][0]
    expected = np.zeros((1, 4))
    rng.fill_normal(np.array([key]), 4, expected)
    own = [rng.normal_quantile(u) for u in draws.uniform(np.array([0]), shape=(4,))[0]]
    np.testing.assert_allclose(own, expected[0])
    many = draws.normal(np.arange(3), 2.0, (20_000,))
    np.testing.assert_allclose(many.std(axis=1), 2.0, rtol=0.03)
    np.testing.assert_allclose(many.mean(axis=1), 0.0, atol=0.06)
