"""Observations of teams: what is nearest comes first, what is not there is zero."""

import numpy as np
import pytest

from volery.autonomy.policy import action_terms, team_terms


def neighbours(position, is_present=None, count=2):
    position = np.array(position, np.float64)
    present = np.ones(len(position), bool) if is_present is None else np.array(is_present)
    return team_terms.neighbours(
        position,
        -position,
        present,
        count=count,
        position_scale_m=2.0,
        velocity_scale_m_s=4.0,
    ).reshape(count, team_terms.NEIGHBOUR_SIZE)


def test_the_nearest_neighbours_come_first():
    seen = neighbours([[8.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, -4.0]])
    np.testing.assert_allclose(seen[0], [0.0, 1.0, 0.0, 0.0, -0.5, 0.0, 1.0])
    np.testing.assert_allclose(seen[1], [0.0, 0.0, -2.0, 0.0, 0.0, 1.0, 1.0])


@pytest.mark.parametrize("is_present", [[False, True], None])
def test_neighbours_that_are_not_there_are_zero(is_present):
    position = [[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]] if is_present else [[3.0, 0.0, 0.0]]
    seen = neighbours(position, is_present)
    np.testing.assert_allclose(seen[0], [1.5, 0.0, 0.0, -0.75, 0.0, 0.0, 1.0])
    assert (seen[1] == 0.0).all()


def test_neighbours_of_many_uavs_equal_those_of_each():
    random = np.random.default_rng(1)
    position, velocity = random.normal(size=(2, 3, 4, 5, 3))
    present = random.random((3, 4, 5)) < 0.7
    options = {"count": 3, "position_scale_m": 1.0, "velocity_scale_m_s": 1.0}
    many = team_terms.neighbours(position, velocity, present, **options)
    one = team_terms.neighbours(position[1, 2], velocity[1, 2], present[1, 2], **options)
    np.testing.assert_array_equal(many[1, 2], one)


def test_a_post_is_its_direction_and_longer_the_nearer_it_is():
    position = np.array([[0.0, -3.0], [1.3, 0.0], [5.0, 5.0]])
    radius = np.array([0.5, 0.3, 0.0])  # the last one is none
    seen = team_terms.posts(position, radius, count=4, range_m=2.0).reshape(4, 2)
    np.testing.assert_allclose(seen[0], [np.exp(-0.5), 0.0])
    np.testing.assert_allclose(seen[1], [0.0, -np.exp(-1.25)])
    assert (seen[2:] == 0.0).all()


def test_a_touched_post_has_length_one():
    seen = team_terms.posts(np.array([[0.2, 0.0]]), np.array([0.3]), count=1, range_m=2.0)
    np.testing.assert_allclose(seen, [1.0, 0.0])


def test_limited_velocities_keep_their_direction():
    action = np.array([[1.0, 1.0, 0.0], [0.3, 0.0, -0.4], [0.0, 0.0, 0.0]])
    velocity = action_terms.limited_velocity(action, 2.0)
    np.testing.assert_allclose(velocity, [[2**0.5, 2**0.5, 0.0], [0.6, 0.0, -0.8], [0.0, 0.0, 0.0]])
    each = action_terms.limited_velocity(action, np.array([[1.0], [2.0], [3.0]]))
    np.testing.assert_allclose(np.linalg.norm(each, axis=1), [1.0, 1.0, 0.0])
