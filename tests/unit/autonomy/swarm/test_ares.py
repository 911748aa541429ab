"""Plans that lead flocks into a V."""

import numpy as np
import pytest

from volery.autonomy.swarm.ares import AresSettings
from volery.autonomy.swarm.formation_fitness import formation_fitness
from volery.autonomy.swarm.formation_search import plan_formation
from volery.autonomy.swarm.particle_swarm import FlockLimits, best_accelerations
from volery.core.errors import PlanError


def start(seed, count=7, box=3.0):
    """A random start as in the paper: birds in a box, at least 1 apart."""
    rng = np.random.default_rng(seed)
    while True:
        positions = rng.uniform(0.0, box, (count, 2))
        apart = np.linalg.norm(positions[:, None] - positions, axis=2) + 99.0 * np.eye(count)
        if apart.min() >= 1.0:
            return positions, rng.uniform(0.25, 0.75, (count, 2))


@pytest.mark.parametrize("seed", range(5))
def test_a_random_start_ends_in_a_v(seed):
    positions, speeds = start(seed)
    plan = plan_formation(positions, speeds, seed)
    assert plan.is_solved
    assert formation_fitness(plan.positions[-1], plan.velocities[-1]).cost == plan.cost <= 1e-3
    assert (plan.positions[0] == positions).all()
    assert (plan.velocities[0] == speeds).all()


def test_steps_are_those_of_birds():
    """Each step moves by its velocity, which changes by at most itself."""
    plan = plan_formation(*start(1))
    moved = plan.positions[1:] - plan.positions[:-1]
    np.testing.assert_allclose(moved, plan.velocities[1:], atol=1e-9)
    change = np.linalg.norm(np.diff(plan.velocities, axis=0), axis=2)
    assert (change <= np.linalg.norm(plan.velocities[:-1], axis=2) + 1e-9).all()


def test_the_same_seed_gives_the_same_plan():
    first, again, other = (plan_formation(*start(2), seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.positions, again.positions)
    assert (
        other.positions.shape != first.positions.shape or (other.positions != first.positions).any()
    )


def test_birds_keep_apart_where_they_must():
    settings = AresSettings(limits=FlockLimits(min_distance=0.9))
    plan = plan_formation(*start(3), settings=settings)
    tracks = plan.positions[:-1, None] + np.linspace(0, 1, 50)[:, None, None] * (
        plan.positions[1:, None] - plan.positions[:-1, None]
    )
    apart = np.linalg.norm(tracks[:, :, :, None] - tracks[:, :, None], axis=4) + 99.0 * np.eye(7)
    assert apart.min() >= 0.9 - 1e-3
    assert plan.is_solved


def test_birds_keep_their_limits():
    limits = FlockLimits(max_speed=1.0, max_acceleration=0.2)
    plan = plan_formation(*start(3), settings=AresSettings(limits=limits))
    assert np.linalg.norm(plan.velocities, axis=2).max() <= 1.0 + 1e-9
    assert np.linalg.norm(np.diff(plan.velocities, axis=0), axis=2).max() <= 0.2 + 1e-9
    assert plan.is_solved


def test_birds_that_cannot_keep_apart_have_no_plan():
    head_on = np.array([[0.0, 2.0], [0.0, 0.0], [1.0, -1.0], [0.0, 0.0]])
    limits = FlockLimits(min_distance=0.5, max_acceleration=0.0)
    cost, _ = best_accelerations(head_on, 1, 5, limits, np.uint64(1), 0, np.empty((2, 2)))
    assert cost == np.inf


def test_birds_that_start_too_near_part():
    positions, speeds = start(5)
    limits = FlockLimits(min_distance=1.5)
    plan = plan_formation(positions, speeds, settings=AresSettings(limits=limits))
    assert plan.is_solved
    apart = np.linalg.norm(plan.positions[-1][:, None] - plan.positions[-1], axis=2)
    assert (apart + 99.0 * np.eye(7)).min() >= 1.5


def test_too_little_effort_is_reported():
    settings = AresSettings(num_clones=1, num_levels=1, num_particles=2, max_particles=2)
    plan = plan_formation(*start(4), settings=settings)
    assert not plan.is_solved
    assert plan.cost > 1e-3


def test_one_bird_is_a_v():
    plan = plan_formation([[1.0, 2.0]], [[0.3, 0.0]])
    assert plan.is_solved
    assert plan.positions.shape == (1, 1, 2)


def test_bad_flocks_are_refused():
    with pytest.raises(PlanError, match="finite"):
        plan_formation([[0.0, np.inf]], [[0.0, 1.0]])
