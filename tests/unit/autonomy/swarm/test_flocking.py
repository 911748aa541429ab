"""Swarm behaviours, with UAVs that reach commanded velocities with a lag."""

import numpy as np
import pytest

from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.olfati_saber import OlfatiSaber
from volery.autonomy.swarm.orca import Orca
from volery.autonomy.swarm.trajectories import Trajectories
from volery.autonomy.swarm.vasarhelyi import Vasarhelyi

BEHAVIOURS = (Vasarhelyi, OlfatiSaber, Orca, Trajectories)
PERIOD_S, LAG_S, SPEED_M_S = 0.05, 0.3, 3.0
AHEAD = np.array([100.0, 0.0])


class Swarm:
    """UAVs at positions (N, 2) m, which fly to goals (N, 2) m."""

    def __init__(self, behaviour, position, goal, around=None):
        self.behaviour, self.around = behaviour, around or Surroundings()
        self.position, self.goal = np.array(position, float), np.array(goal, float)
        self.velocity = np.zeros_like(self.position)
        self.min_distance = self.min_gap = np.inf

    def fly(self, seconds):
        for _ in range(round(seconds / PERIOD_S)):
            offset = self.goal - self.position
            distance = np.linalg.norm(offset, axis=1, keepdims=True)
            preferred = offset / np.maximum(distance, 1e-9) * np.minimum(SPEED_M_S, 0.8 * distance)
            flock = flock_within(self.position, self.velocity, self.behaviour.radius_m)
            wanted = self.behaviour.velocities(flock, preferred, self.around)
            self.velocity = self.velocity + (wanted - self.velocity) * PERIOD_S / LAG_S
            self.position = self.position + self.velocity * PERIOD_S
            self.min_distance = min(self.min_distance, distances(self.position).min())
            for x, y, radius in self.around.cylinders:
                gaps = np.hypot(self.position[:, 0] - x, self.position[:, 1] - y) - radius
                self.min_gap = min(self.min_gap, gaps.min())


def distances(position):
    apart = np.linalg.norm(position[:, None] - position, axis=2)
    return apart + np.diag(np.full(len(apart), np.inf))


def block(rows, columns, distance):
    return np.array([[distance * x, distance * y] for x in range(columns) for y in range(rows)])


def test_neighbours_are_all_within_the_radius_and_no_others():
    rng = np.random.default_rng(1)
    for count, radius in ((1, 3.0), (2, 50.0), (300, 4.0)):
        position = rng.uniform(-40.0, 25.0, (count, 2))
        flock = flock_within(position, np.zeros_like(position), radius)
        near = distances(position) < radius
        for i in range(count):
            found = flock.neighbour[flock.first[i] : flock.first[i + 1]]
            assert sorted(found) == np.flatnonzero(near[i]).tolist()


def test_an_empty_flock_and_one_alone():
    for kind in BEHAVIOURS:
        empty = flock_within(np.empty((0, 2)), np.empty((0, 2)), 5.0)
        assert kind().velocities(empty, np.empty((0, 2)), Surroundings()).shape == (0, 2)
        one = flock_within(np.zeros((1, 2)), np.array([[1.0, 0.0]]), 5.0)
        wanted = kind().velocities(one, np.array([[1.0, 0.0]]), Surroundings())
        np.testing.assert_allclose(wanted, [[1.0, 0.0]])


@pytest.mark.parametrize(("kind", "distance"), [(Vasarhelyi, 7.0), (OlfatiSaber, 5.0)])
def test_a_uav_adopts_a_part_of_its_neighbours_velocity(kind, distance):
    """At a distance at which nothing else acts."""
    position = np.array([[0.0, 0.0], [0.0, distance]])
    flock = flock_within(position, np.array([[0.0, 0.0], [3.0, 0.0]]), 20.0)
    wanted = kind().velocities(flock, np.zeros((2, 2)), Surroundings())
    assert 0.2 < wanted[0, 0] < 2.0
    assert wanted[0, 1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("kind", BEHAVIOURS)
def test_a_flock_flies_on_together(kind):
    start = block(4, 5, 5.0) + np.random.default_rng(2).uniform(-0.5, 0.5, (20, 2))
    swarm = Swarm(kind(), start, start + AHEAD)
    swarm.fly(20.0)
    heading = swarm.velocity / np.linalg.norm(swarm.velocity, axis=1, keepdims=True)
    assert np.linalg.norm(heading.mean(axis=0)) > 0.99
    assert swarm.velocity[:, 0].min() > 2.0
    assert swarm.min_distance > 2.5


@pytest.mark.parametrize("kind", BEHAVIOURS)
def test_two_flocks_that_meet_pass_each_other(kind):
    left, right = block(5, 2, 5.0), block(5, 2, 5.0) + np.array([40.0, 1.0])
    swarm = Swarm(kind(), np.vstack((left, right)), np.vstack((left + AHEAD, right - AHEAD)))
    swarm.fly(60.0)
    assert swarm.min_distance > 1.0


@pytest.mark.parametrize("kind", BEHAVIOURS)
def test_a_flock_passes_posts_without_contact(kind):
    rng = np.random.default_rng(3)
    posts = np.column_stack([rng.uniform(30, 70, 12), rng.uniform(-10, 30, 12), np.full(12, 0.3)])
    start = block(4, 3, 5.0)
    around = Surroundings(cylinders=posts)
    swarm = Swarm(kind(), start, start + AHEAD, around)
    swarm.fly(60.0)
    assert swarm.min_gap > 0.5
    assert swarm.min_distance > 1.0
    # A lattice may rest before a post, where the forces of post and goal are equal.
    assert (swarm.position[:, 0] > 75.0).sum() >= 11


@pytest.mark.parametrize("kind", BEHAVIOURS)
def test_walls_keep_a_flock_inside(kind):
    start = block(3, 3, 5.0)
    around = Surroundings(np.array([-10.0, -10.0, 40.0, 30.0]))
    swarm = Swarm(kind(), start, start + 2.0 * AHEAD, around)
    swarm.fly(40.0)
    assert (swarm.position > -10.0).all()
    assert (swarm.position < [40.0, 30.0]).all()


@pytest.mark.parametrize("kind", BEHAVIOURS)
def test_echoes_of_a_post_count_like_the_post(kind):
    flock = flock_within(np.array([[2.0, 1.0]]), np.array([[2.5, 0.0]]), 5.0)
    preferred, post = np.array([[3.0, 0.0]]), np.array([5.0, 1.3])
    known = Surroundings(cylinders=np.array([[*post, 0.0]]))
    seen = Surroundings(echoes=np.array([[[np.nan, np.nan], post - flock.position[0]]]))
    wanted = kind().velocities(flock, preferred, seen)
    np.testing.assert_allclose(wanted, kind().velocities(flock, preferred, known))
    assert not np.allclose(wanted, preferred)
