"""Headings lead through gaps, never into what blocks them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.autonomy.avoidance.gaps import SECTOR_ANGLES, choose_heading, free_distances


def test_nothing_around_is_free_everywhere():
    free = free_distances(np.zeros((0, 2)), 1.0, 10.0)
    assert (free == 10.0).all()
    heading = choose_heading(free, 0.5, 100.0, None)
    assert heading.angle == pytest.approx(0.5, abs=0.04)


def test_a_trunk_ahead_is_passed_on_one_side():
    free = free_distances(np.array([[5.0, 0.1]]), 1.0, 12.0)
    ahead = np.argmin(np.abs(SECTOR_ANGLES))
    assert free[ahead] == pytest.approx(4.0, abs=0.1)
    heading = choose_heading(free, 0.0, 50.0, None)
    side = 5.0 * abs(np.sin(heading.angle))
    assert side > 0.8
    assert abs(heading.angle) < 0.5


def test_loyalty_to_the_previous_side():
    free = free_distances(np.array([[5.0, 0.0]]), 1.0, 12.0)
    left = choose_heading(free, 0.0, 50.0, 0.4)
    right = choose_heading(free, 0.0, 50.0, -0.4)
    assert left.angle > 0 > right.angle


def test_a_goal_before_the_obstacle_is_flown_to_directly():
    free = free_distances(np.array([[5.0, 0.0]]), 1.0, 12.0)
    assert abs(choose_heading(free, 0.0, 2.0, None).angle) < 0.05


def test_walled_in_means_no_heading():
    angles = np.linspace(-np.pi, np.pi, 200)
    ring = 1.5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert choose_heading(free_distances(ring, 1.0, 12.0), 0.0, 50.0, None) is None


@given(
    st.lists(st.tuples(st.floats(-12, 12), st.floats(-12, 12)), max_size=40),
    st.floats(-3.0, 3.0),
)
def test_the_chosen_heading_is_clear_as_far_as_promised(points, goal):
    obstacles = np.array(points, dtype=float).reshape(-1, 2)
    heading = choose_heading(free_distances(obstacles, 0.8, 12.0), goal, 40.0, None)
    if heading is None:
        return
    direction = np.array([np.cos(heading.angle), np.sin(heading.angle)])
    for s in np.arange(0.05, heading.free_m - 0.05, 0.25):
        gap = np.hypot(*(obstacles - s * direction).T) if len(obstacles) else np.array([np.inf])
        moving_away = obstacles @ direction <= 0.0
        assert ((gap > 0.8 - 0.05) | moving_away).all()
