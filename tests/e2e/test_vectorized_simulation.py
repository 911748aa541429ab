"""Independent environments of a scenario: each is the simulation of its own seed."""

import numpy as np
import pytest

from volery.core.errors import CommandError, ScenarioError
from volery.runtime import VectorizedSimulation
from volery.scenario.load import parse_scenario

STATES = ("position_map", "velocity_map", "attitude", "omega_body", "rotor_speed")


@pytest.fixture
def pair_data(flat_data):
    """Two UAVs that see each other, with noise, wind and turbulence."""
    flat_data["world"] = {
        "seed": 5,
        "wind": {"velocity_m_s": [3.0, 0.0, 0.0], "turbulence": "moderate"},
    }
    flat_data["types"]["f450"]["sensors"].append(
        {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]}
    )
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0, 4.0]},
        {"type": "f450", "position_m": [4.0, 0.0, 4.2]},
    ]
    return flat_data


def make(data, count, **options):
    return VectorizedSimulation(parse_scenario(data), count, **options)


def states(source, copy):
    """States (n, ...) of one copy."""
    found = source.state()
    return {name: getattr(found, name)[copy] for name in STATES}


def alone(simulate, data, seed, seconds, velocity):
    """States and last measurements of the plain simulation with that seed."""
    simulation = simulate({**data, "seed": seed})
    last = {}
    simulation.graph.subscribe(
        "/uav2/imu", lambda p: last.update(force=p.message.linear_acceleration.x)
    )
    simulation.graph.subscribe(
        "/uav1/laser/horizontal/scan", lambda p: last.update(ranges=p.message.ranges)
    )
    for uav in simulation.uavs.values():
        uav.command_velocity(velocity)
    simulation.run(seconds)
    found = simulation._engine.fleet.state
    return {name: np.array(getattr(found, name)) for name in STATES}, last


def assert_same(found, expected):
    for name in STATES:
        np.testing.assert_array_equal(found[name], expected[name], err_msg=name)


def test_every_copy_is_the_simulation_of_its_seed(simulate, pair_data):
    velocity = [1.0, 0.3, 0.1]
    with make(pair_data, 3, seeds=[7, 8, 9], threads=2) as envs:
        envs.command_velocity(velocity)
        envs.run(0.35)
        for copy, seed in enumerate((7, 8, 9)):
            expected, last = alone(simulate, pair_data, seed, 0.35, velocity)
            assert_same(states(envs, copy), expected)
            force = envs.sample("uav2", "imu")["specific_force"][copy, 0]
            assert force == last["force"]
            ranges = envs.sample("uav1", "horizontal")["echoes"][copy, 0]
            np.testing.assert_array_equal(ranges, last["ranges"])
        assert len({envs.sample("uav2", "imu")["specific_force"][k, 0] for k in range(3)}) == 3


def test_reset_copies_are_fresh_ones_and_the_others_fly_on(simulate, pair_data):
    velocity = [0.5, -0.2, 0.0]
    with (
        make(pair_data, 4, threads=2) as envs,
        make(pair_data, 4, threads=1) as undisturbed,
    ):
        for each in (envs, undisturbed):
            each.command_velocity(velocity)
            each.run(0.4)
        assert envs.common_period_s == pytest.approx(0.2)
        envs.reset([0, 2], seeds=[70, 71])
        np.testing.assert_allclose(envs.age_s, [0.0, 0.4, 0.0, 0.4])
        for each in (envs, undisturbed):
            each.command_velocity(velocity)
            each.run(0.35)
        for copy in (1, 3):
            assert_same(states(envs, copy), states(undisturbed, copy))
        for copy, seed in ((0, 70), (2, 71)):
            expected, last = alone(simulate, pair_data, seed, 0.35, velocity)
            assert_same(states(envs, copy), expected)
            assert envs.sample("uav2", "imu")["specific_force"][copy, 0] == last["force"]
            ranges = envs.sample("uav1", "horizontal")["echoes"][copy, 0]
            np.testing.assert_array_equal(ranges, last["ranges"])


def test_threads_change_nothing(pair_data):
    found = []
    for threads in (1, 2, 3):
        with make(pair_data, 5, threads=threads) as envs:
            envs.command_velocity([1.0, 0.0, 0.0])
            envs.run(0.3)
            found.append(envs.state().position_map)
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_states_are_taken_back(pair_data):
    with make(pair_data, 3) as envs:
        envs.run(0.21)
        kept = envs.get_state()
        envs.run(0.2)
        first = envs.state().position_map
        envs.reset([1])
        envs.set_state(kept)
        envs.run(0.2)
        np.testing.assert_array_equal(envs.state().position_map, first)


def test_copies_do_not_collide_with_each_other(pair_data):
    pair_data["types"]["f450"]["sensors"] = []
    with make(pair_data, 3, threads=1) as envs:
        envs.uav(1, "uav1").go_to([8.0, 0.0, 4.2])
        envs.run(2.5)
        events = envs.drain_events()
    hits = [e for e in events if str(e.event.kind) == "collision"]
    assert {e.env for e in hits} == {1}
    assert {(e.event.uav, e.event.partner) for e in hits} == {("uav1", "uav2"), ("uav2", "uav1")}


def test_mass_command_is_the_same_as_single_ones(pair_data):
    with make(pair_data, 2) as one, make(pair_data, 2) as other:
        velocity = np.arange(12.0).reshape(2, 2, 3) / 10.0
        one.command_velocity(velocity, 0.3)
        for copy in range(2):
            for k, name in enumerate(other.uav_names):
                other.uav(copy, name).command_velocity(velocity[copy, k], 0.3)
        one.run(0.3)
        other.run(0.3)
        np.testing.assert_array_equal(one.state().position_map, other.state().position_map)


def test_impossible_requests_are_refused(flat_data):
    with pytest.raises(ScenarioError, match="num_envs = 0: at least 1"):
        make(flat_data, 0)
    with pytest.raises(ScenarioError, match="2 environments with 1 seed: each needs one"):
        make(flat_data, 2, seeds=[1])
    with make(flat_data, 2) as envs:
        with pytest.raises(CommandError, match="numbered 0 to 1"):
            envs.reset([2])
        with pytest.raises(CommandError, match="no sensor 'radar' of 'uav1'; known: uav1 imu"):
            envs.sample("uav1", "radar")
        with pytest.raises(CommandError, match="finite"):
            envs.command_velocity([np.nan, 0.0, 0.0])
