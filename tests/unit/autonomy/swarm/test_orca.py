"""Reciprocal avoidance of a swarm, against a search and in crowds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_flocking import Swarm, block

from volery.autonomy.planning.reciprocal_avoidance import half_plane
from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.orca import Orca, OrcaSettings

SETTINGS = OrcaSettings(turn_rad=0.0)
LIMIT = SETTINGS.max_speed_m_s
number = st.floats(-12.0, 12.0)
speed = st.floats(-3.0, 3.0)
uav = st.tuples(number, number, speed, speed)


def disc(size=400):
    """Velocities (M, 2) all over the disc of the largest speed."""
    turn = np.linspace(0.0, 2.0 * np.pi, size)
    sizes = np.linspace(0.0, LIMIT, size)
    return np.stack(
        [np.outer(sizes, np.cos(turn)).ravel(), np.outer(sizes, np.sin(turn)).ravel()], axis=1
    )


DISC = disc()


@given(st.lists(uav, min_size=1, max_size=6), speed, speed)
@settings(max_examples=60, deadline=None)
def test_the_velocity_is_the_best_one(others, vx, vy):
    """No velocity that all half planes allow is nearer to the preferred one, or violates less."""
    position = np.array([[0.0, 0.0], *[other[:2] for other in others]])
    velocity = np.array([[1.0, 0.0], *[other[2:] for other in others]])
    preferred = np.zeros_like(position)
    preferred[0] = vx, vy
    flock = flock_within(position, velocity, Orca().radius_m)
    chosen = Orca(SETTINGS).velocities(flock, preferred, Surroundings())[0]
    assert np.hypot(*chosen) <= LIMIT + 1e-9
    normals, offsets = [], []
    for (x, y), (ux, uy) in zip(position[1:], velocity[1:], strict=True):
        limits = SETTINGS.distance_m, SETTINGS.horizon_s, SETTINGS.step_s
        nx, ny, change = half_plane(x, y, 1.0 - ux, -uy, *limits)
        normals.append((nx, ny))
        offsets.append(nx + 0.5 * change)
    normals, offsets = np.array(normals), np.array(offsets)
    violations = (offsets - DISC @ normals.T).max(axis=1)
    own = (offsets - normals @ chosen).max()
    if (violations <= 0.0).any():
        best = np.linalg.norm(DISC[violations <= 0.0] - (vx, vy), axis=1).min()
        assert own <= 1e-6
        assert np.hypot(*(chosen - (vx, vy))) <= best + 1e-6
    else:
        assert own <= violations.min() + 1e-6


@pytest.mark.parametrize("count", [2, 3, 12, 30])
def test_uavs_swap_across_a_circle(count):
    turn = 2.0 * np.pi * np.arange(count) / count
    start = (6.0 + 0.8 * count) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    swarm = Swarm(Orca(), start + np.random.default_rng(1).uniform(-0.1, 0.1, (count, 2)), -start)
    swarm.fly(60.0)
    assert np.linalg.norm(swarm.position - swarm.goal, axis=1).max() < 0.5
    assert swarm.min_distance > 1.2


def test_uavs_that_are_too_near_part():
    swarm = Swarm(Orca(), [[0.0, 0.0], [0.5, 0.1]], [[0.0, 0.0], [0.5, 0.1]])
    swarm.fly(5.0)
    assert np.hypot(*(swarm.position[1] - swarm.position[0])) > 1.5


def test_uavs_at_their_goals_let_others_pass():
    """Eight stand around the goal of a ninth, 3 m apart; it flies straight to it in 7 s."""
    goal = block(3, 3, 3.0)
    start = goal.copy()
    start[4] = -12.0, 3.0
    swarm = Swarm(Orca(), start, goal)
    swarm.fly(22.0)
    assert np.linalg.norm(swarm.position - swarm.goal, axis=1).max() < 0.5
    assert swarm.min_distance > 1.9


def test_it_brakes_before_what_its_own_sensor_sees():
    wall = np.stack([np.full(9, 10.0), np.linspace(-4.0, 4.0, 9)], axis=1)
    swarm = Swarm(Orca(), [[0.0, 0.0]], [[20.0, 0.0]])
    for _ in range(200):
        seen = np.full((1, 12, 2), np.nan)
        seen[0, :9] = wall - swarm.position[0]
        swarm.around = Surroundings(echoes=seen)
        swarm.fly(0.05)
    assert 8.5 < swarm.position[0, 0] < 9.2
