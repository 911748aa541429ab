"""Committed trajectories of a swarm: they never cross, and end at rest."""

import copy

import numpy as np
import pytest
from test_flocking import AHEAD, PERIOD_S, SPEED_M_S, Swarm, block

from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.trajectories import Trajectories, TrajectorySettings

SETTINGS = TrajectorySettings()


def points(behaviour, times_s):
    """Returns the positions (N, T, 2) of the committed trajectories at times."""
    curves, start_s, _ = behaviour._committed
    since = np.clip(times_s[None] - start_s[:, None], 0.0, SETTINGS.duration_s)
    powers = since[..., None] ** np.arange(6)
    return np.einsum("nap,ntp->nta", curves, powers)


def circle(count):
    turn = 2.0 * np.pi * np.arange(count) / count
    start = (6.0 + 0.8 * count) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return start + np.random.default_rng(1).uniform(-0.1, 0.1, start.shape), -start


@pytest.mark.parametrize("count", [2, 3, 12, 30])
def test_uavs_swap_across_a_circle(count):
    swarm = Swarm(Trajectories(), *circle(count))
    swarm.fly(60.0)
    assert np.linalg.norm(swarm.position - swarm.goal, axis=1).max() < 0.5
    assert swarm.min_distance > 1.5


def test_committed_trajectories_keep_apart_at_all_times():
    """Not only where the UAVs are now: also if each flew its trajectory to the end."""
    swarm = Swarm(Trajectories(), *circle(12))
    for _ in range(60):
        swarm.fly(0.25)
        now_s = swarm.behaviour._time_s
        times = now_s + np.linspace(0.0, SETTINGS.duration_s, 41)
        found = points(swarm.behaviour, times)
        apart = np.linalg.norm(found[:, None] - found, axis=-1)
        apart[np.arange(12), np.arange(12)] = np.inf
        assert apart.min() > SETTINGS.distance_m - 0.25  # between the samples


def test_a_uav_alone_flies_at_its_preferred_speed():
    swarm = Swarm(Trajectories(), [[0.0, 0.0]], [AHEAD])
    swarm.fly(10.0)
    assert np.hypot(*swarm.velocity[0]) == pytest.approx(SPEED_M_S, rel=0.1)
    assert abs(swarm.position[0, 1]) < 0.1


def test_a_path_that_is_blocked_ends_before_the_obstacle():
    """A wall of posts without a gap: the UAV stands, and does not touch it."""
    y = np.arange(-30.0, 30.5, 0.5)
    posts = np.column_stack([np.full_like(y, 15.0), y, np.full_like(y, 0.3)])
    swarm = Swarm(Trajectories(), [[0.0, 0.0]], [[30.0, 0.0]], Surroundings(cylinders=posts))
    swarm.fly(30.0)
    assert swarm.min_gap > 0.8
    assert swarm.position[0, 0] < 14.0
    assert np.hypot(*swarm.velocity[0]) < 0.5


def test_uavs_that_have_arrived_give_way():
    """A row too dense to fly through lets one pass, and closes again."""
    row = np.column_stack([np.full(15, 15.0), 3.0 * np.arange(-7, 8)])
    swarm = Swarm(Trajectories(), [[0.0, 0.2], *row], [[30.0, 0.2], *row])
    swarm.fly(60.0)
    assert np.linalg.norm(swarm.position - swarm.goal, axis=1).max() < 0.5
    assert swarm.min_distance > 1.5


def test_a_uav_that_is_displaced_gets_a_trajectory_from_there():
    swarm = Swarm(Trajectories(), [[0.0, 0.0], [0.0, 10.0]], [AHEAD, [100.0, 10.0]])
    swarm.fly(5.0)
    swarm.position[0] += [0.0, -8.0]
    swarm.fly(PERIOD_S)
    now = points(swarm.behaviour, np.array([swarm.behaviour._time_s]))[:, 0]
    np.testing.assert_allclose(now[0], swarm.position[0], atol=0.5)
    swarm.fly(20.0)
    assert swarm.min_distance > 1.5


def test_a_team_that_loses_a_member_flies_on():
    behaviour, start = Trajectories(), block(3, 3, 4.0)
    for count in (9, 8, 0, 3):
        position = start[:count]
        for _ in range(5):
            flock = flock_within(position, np.zeros_like(position), behaviour.radius_m)
            wanted = behaviour.velocities(flock, np.ones_like(position), Surroundings())
            assert wanted.shape == (count, 2)
            assert np.isfinite(wanted).all()


def test_a_snapshot_continues_the_same_flight():
    swarm = Swarm(Trajectories(), *circle(12))
    swarm.fly(4.0)
    kept = copy.deepcopy((swarm.behaviour.get_state(), swarm.position, swarm.velocity))
    swarm.fly(6.0)
    again = Swarm(Trajectories(), *circle(12))
    state, again.position, again.velocity = kept
    again.behaviour.set_state(state)
    again.fly(6.0)
    np.testing.assert_array_equal(again.position, swarm.position)
