"""Tests that a state that is not physical ends the run, whatever the cause."""

import math

import pytest

from volery.core.errors import DivergenceError
from volery.runtime.vectorized_simulation import VectorizedSimulation
from volery.scenario.load import parse_scenario


@pytest.fixture
def flying(simulate, flat_data):
    flat_data["uavs"][0] |= {"count": 2, "on_start": "take_off"}
    simulation = simulate(flat_data)
    simulation.run(1.0)
    return simulation


@pytest.mark.parametrize("part", ["position_map", "velocity_map", "attitude", "omega_body"])
@pytest.mark.parametrize("number", [math.nan, math.inf, -1e7])
def test_a_run_ends_with_uav_and_time(flying, part, number):
    getattr(flying._engine.fleet.state, part)[1] = number
    with pytest.raises(
        DivergenceError, match=r"the state of uav2 is not physical at 1\.0"
    ) as caught:
        flying.run(1.0)
    assert caught.value.uav == "uav2"
    assert 1.0 <= caught.value.time_s <= 1.03
    with pytest.raises(DivergenceError):
        flying.snapshot()
    flying.reset()
    flying.run(1.0)
    flying.snapshot()


def test_what_is_fast_but_finite_is_found_at_the_end_of_a_run(flying):
    flying._engine.fleet.state.velocity_map[0, 2] = 5e4
    with pytest.raises(DivergenceError, match=r"uav1.*m/s, angular rate"):
        flying.run(0.002)


def test_steps_are_looked_at_as_well(flying):
    flying._engine.fleet.state.velocity_map[0] = math.nan
    with pytest.raises(DivergenceError):
        flying.step(50)


def test_nothing_that_is_not_finite_happens(flying):
    """Events come after a look: none has a position that is not finite."""
    flying._engine.fleet.state.velocity_map[0] = (0.0, 0.0, -1e9)
    with pytest.raises(DivergenceError):
        flying.run(1.0)
    assert all(map(math.isfinite, [x for e in flying.diagnostics.events for x in e.position_map]))


def test_an_error_that_nan_causes_is_reported_as_such(flying):
    def fail():
        flying._engine.fleet.state.velocity_map[0] = math.nan
        round(math.nan)

    flying._engine.every(0.01, fail)
    with pytest.raises(DivergenceError, match="uav1"):
        flying.run(0.1)


def test_other_errors_stay_what_they_are(flying):
    def fail():
        raise ValueError("something else")

    flying._engine.every(0.01, fail)
    with pytest.raises(ValueError, match="something else"):
        flying.run(0.1)


def test_a_spawned_uav_is_looked_at(flying):
    flying.vehicles.spawn("late", "f450", (5.0, 5.0, 3.0))
    flying.run(0.1)
    flying._engine.fleet.state.velocity_map[2] = math.nan
    with pytest.raises(DivergenceError, match="late"):
        flying.run(0.1)


def test_vectorized_simulations_name_the_copy(flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 3.0]  # none that rests
    with VectorizedSimulation(parse_scenario(flat_data), 5, threads=2) as envs:
        envs.run(0.1)
        envs._blocks[1].fleet.state.velocity_map[1] = math.nan
        with pytest.raises(DivergenceError, match="uav1 of environment 3") as caught:
            envs.run(0.05)
        assert caught.value.uav == "3/uav1"
        with pytest.raises(DivergenceError, match="uav1 of environment 3"):
            envs.get_state()
        envs.reset([3])
        envs.run(0.1)
        envs.get_state()
