"""Resets with another seed: a fresh simulation of that seed, or a refusal that says what to do."""

import numpy as np
import pytest

from volery.core.errors import CommandError
from volery.runtime import Simulation, VectorizedSimulation
from volery.scenario.load import parse_scenario

DATA = {
    "name": "gusty",
    "duration_s": 10.0,
    "types": {"t": {"sensors": [{"kind": "imu"}, {"kind": "odometry"}]}},
    "uavs": [{"type": "t", "position_m": [0, 0, 5]}],
    "world": {"wind": {"velocity_m_s": [3, 0, 0], "turbulence": "moderate"}},
}
FOREST = {"kind": "procedural", "region_m": [20, 20, 40, 40], "trees": 3, "species": {"palm": 1}}


@pytest.fixture
def open_air():
    return parse_scenario(DATA)


@pytest.fixture
def forest(open_air):
    return open_air.with_(world={"forest": FOREST})


def digest_of(simulation):
    simulation.diagnostics.enable_digest()
    simulation.run(0.3)
    return simulation.diagnostics.digest()


@pytest.mark.parametrize("world", [{}, {"seed": 3, "forest": FOREST}])
def test_where_the_seed_grows_nothing_a_reset_is_a_fresh_simulation(open_air, world):
    scenario = open_air.with_(world=world)
    assert not scenario.has_seeded_world
    with Simulation(scenario) as used, Simulation(scenario.with_(seed=7)) as fresh:
        used.run(0.2)
        used.reset(seed=7)
        assert digest_of(used) == digest_of(fresh)


@pytest.mark.parametrize("advice", ["new", "fixed"])
def test_where_the_seed_grows_the_world_other_seeds_are_refused_with_what_to_do(forest, advice):
    with Simulation(forest) as simulation:
        simulation.run(0.1)
        with pytest.raises(CommandError) as caught:
            simulation.reset(seed=7)
        text = str(caught.value)
        assert "a reset keeps the world, which scenario 'gusty' generates from its seed 1" in text
        assert simulation.time_s == pytest.approx(0.1)
        simulation.reset(seed=1)
        simulation.reset()
    if advice == "new":
        assert "scenario.with_(seed=7)" in text
        changed = forest.with_(seed=7)
    else:
        assert 'scenario.with_(world={"seed": 1})' in text
        changed = forest.with_(world={"seed": 1})
    with Simulation(changed) as simulation, Simulation(forest) as old:
        simulation.reset(seed=7)
        positions = [each.world.forest.position_map for each in (simulation, old)]
        assert np.array_equal(*positions) == (advice == "fixed")


def test_copies_fix_the_world_that_they_share(forest):
    with VectorizedSimulation(forest, 2) as envs:
        assert envs.scenario.world.seed == 1
        envs.run(envs.common_period_s)
        envs.reset([1], seeds=[7])
        envs.run(0.2)
        with Simulation(envs.scenario.with_(seed=7)) as alone:
            alone.run(0.2)
            position = alone.uavs["uav1"].position_map
        np.testing.assert_array_equal(envs.state().position_map[1, 0], position)
        with pytest.raises(CommandError, match="a seed must be a whole number"):
            envs.reset(seeds=[1, -1])


def test_what_begins_after_a_reset_has_the_random_streams_of_its_seed(open_air):
    """A new UAV and one put back to its start, also after a return to a snapshot."""

    def flown(scenario, first):
        with Simulation(scenario) as simulation:
            if first is not None:
                kept = first(simulation)
                simulation.restore(kept)
            simulation.diagnostics.enable_digest()
            simulation.run(0.2)
            simulation.vehicles.spawn("uav2", "t", [20.0, 0.0, 5.0])
            simulation.vehicles.reset("uav1")
            simulation.run(0.4)
            return simulation.diagnostics.digest()

    def reset(simulation):
        simulation.reset(seed=7)
        kept = simulation.snapshot()
        simulation.reset(seed=8)
        return kept

    fresh = flown(open_air.with_(seed=7), None)
    assert flown(open_air, reset) == fresh
    assert flown(open_air, None) != fresh
