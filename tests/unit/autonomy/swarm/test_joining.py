"""Plans for flocks of more birds than ARES leads: the others join the formation."""

import numpy as np
import pytest

from volery.autonomy.swarm.ares import AresSettings
from volery.autonomy.swarm.formation_fitness import BEST_ASIDE, BEST_BEHIND, formation_fitness
from volery.autonomy.swarm.formation_search import FormationSearch, plan_formation
from volery.autonomy.swarm.joining import free_positions
from volery.autonomy.swarm.particle_swarm import FlockLimits

LIMITS = FlockLimits(min_distance=1.0, max_speed=2.5, max_acceleration=1.3)


def start(count, seed):
    """Birds in a box, at least 1.2 apart, nearly as dense as the starts of the paper."""
    rng = np.random.default_rng(seed)
    side = 4.7 * np.sqrt(count / 7) - 1.2
    positions = np.empty((0, 2))
    for _ in range(100_000):
        drawn = rng.uniform(0.0, side, 2)
        if (np.linalg.norm(positions - drawn, axis=1) > 1.2).all():
            positions = np.vstack((positions, drawn))
        if len(positions) == count:
            return positions, rng.uniform(0.25, 0.75, (count, 2))
    raise AssertionError("too dense")


def closest(positions):
    """Returns the smallest distance of two birds on their straight paths."""
    tracks = positions[:-1, None] + np.linspace(0.0, 1.0, 20)[:, None, None] * (
        positions[1:, None] - positions[:-1, None]
    )
    apart = np.linalg.norm(tracks[:, :, :, None] - tracks[:, :, None], axis=4)
    return (apart + 99.0 * np.eye(positions.shape[1])).min()


@pytest.mark.parametrize(("count", "seed"), [(8, 1), (15, 2), (30, 2), (30, 3)])
def test_flocks_of_any_size_end_in_a_v(count, seed):
    positions, speeds = start(count, seed)
    plan = plan_formation(positions, speeds, seed, AresSettings(limits=LIMITS))
    assert plan.is_solved
    assert formation_fitness(plan.positions[-1], plan.velocities[-1]).cost == plan.cost <= 1e-3
    np.testing.assert_array_equal(plan.positions[0], positions)
    np.testing.assert_array_equal(plan.velocities[0], speeds)
    np.testing.assert_allclose(np.diff(plan.positions, axis=0), plan.velocities[1:], atol=1e-9)
    assert closest(plan.positions) >= LIMITS.min_distance - 1e-3
    size = np.linalg.norm(plan.velocities, axis=2)
    change = np.linalg.norm(np.diff(plan.velocities, axis=0), axis=2)
    assert size.max() <= LIMITS.max_speed + 1e-9
    assert (change <= np.minimum(size[:-1], LIMITS.max_acceleration) + 1e-9).all()


def test_the_same_seed_gives_the_same_trajectories():
    first, again = (plan_formation(*start(12, 4), 5) for _ in range(2))
    np.testing.assert_array_equal(first.positions, again.positions)


def test_the_arms_grow_at_their_ends_and_equally():
    arm = np.array([BEST_ASIDE, -BEST_BEHIND])
    flock = np.array([[0.0, 0.0], arm, 2.0 * arm])
    flock = np.vstack((flock.T, np.tile([[0.0], [1.0]], 3)))
    joining = np.array([[-5.0, -9.0], [5.0, -9.0], [-7.0, -9.0]])
    joining = np.vstack((joining.T, np.zeros((2, 3))))
    positions, ranks = free_positions(flock, joining)
    mirrored = arm * (-1.0, 1.0)
    np.testing.assert_allclose(positions, [mirrored, 3.0 * arm, 2.0 * mirrored], atol=1e-9)
    assert ranks.tolist() == [1, 1, 2]


def test_a_v_that_has_lost_its_first_bird_becomes_another_one():
    rank = np.delete(np.arange(-10, 11), 10)
    positions = np.stack([BEST_ASIDE * rank, -BEST_BEHIND * np.abs(rank)], axis=1)
    plan = plan_formation(positions, np.tile([0.0, 0.7], (20, 1)), 1, AresSettings(limits=LIMITS))
    assert plan.is_solved
    assert closest(plan.positions) >= LIMITS.min_distance - 1e-3


def test_a_flock_in_which_one_cannot_move_has_no_plan():
    """A bird accelerates by at most its speed, so one that stands remains behind."""
    positions, speeds = start(9, 1)
    speeds[np.argmin(positions.sum(axis=1))] = 0.0
    search = FormationSearch(positions, speeds, settings=AresSettings(limits=LIMITS))
    while not search.is_done:
        search.advance()
    plan = search.plan()
    assert not plan.is_solved
    assert plan.positions.shape == (1, 9, 2)
