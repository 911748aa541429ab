"""What the node remembers of obstacles and ground."""

import numpy as np
import pytest

from volery.autonomy.avoidance.obstacle_memory import ObstacleMemory
from volery.autonomy.perception.ground_plane import GroundPlane

S = 1_000_000_000


def test_obstacles_need_two_looks_and_are_forgotten():
    memory = ObstacleMemory(keep_s=2.0, looks_needed=2)
    memory.add(np.array([[3.0, 1.0]]), 0)
    assert len(memory.around(np.zeros(2), 0, 10.0)) == 0
    memory.add(np.array([[3.0, 1.0]]), S // 10)
    (seen,) = memory.around(np.zeros(2), S // 10, 10.0)
    np.testing.assert_allclose(seen, [3.0, 1.0], atol=0.13)
    assert len(memory.around(np.zeros(2), 3 * S, 10.0)) == 0


def test_a_distant_position_that_shares_the_cell_is_not_mixed_up():
    memory = ObstacleMemory(half_width_m=16.0, looks_needed=1)
    memory.add(np.array([[1.0, 1.0]]), 0)
    memory.add(np.array([[33.0, 1.0]]), 1)
    around_new = memory.around(np.array([33.0, 1.0]), 1, 5.0)
    assert np.abs(around_new).max() < 0.2
    assert len(memory.around(np.array([1.0, 1.0]), 1, 5.0)) == 0


def test_slope_is_found_below_trunks_and_leaves():
    generator = np.random.default_rng(1)
    xy = generator.uniform(-10, 10, (3000, 2))
    ground = 100.0 + 0.2 * xy[:, 0] - 0.1 * xy[:, 1]
    heights = ground + np.where(generator.random(3000) < 0.3, generator.uniform(0, 8, 3000), 0.0)
    plane = GroundPlane()
    plane.add(np.column_stack([xy, heights]), S)
    plane.fit(np.array([0.0, 0.0, 103.0]), 100.0, S)
    np.testing.assert_allclose(plane.slope, [0.2, -0.1], atol=0.04)
    assert plane.height_at(np.array([5.0, 0.0])) == pytest.approx(101.0, abs=0.3)


def test_without_a_sonar_the_returns_show_where_the_ground_is():
    rng = np.random.default_rng(4)
    at = rng.uniform(-10.0, 10.0, (2000, 2))
    ground = np.column_stack([at, 0.2 * at[:, 0] + 1.0])
    stuff = np.column_stack([at[:300], 0.2 * at[:300, 0] + rng.uniform(1.5, 5.0, 300)])
    plane = GroundPlane()
    plane.add(np.concatenate([ground, stuff]), 0)
    for _ in range(3):
        plane.fit(np.array([1.0, 0.0, 4.0]), None, 0)
    assert plane.height == pytest.approx(1.2, abs=0.25)
    assert plane.slope == pytest.approx([0.2, 0.0], abs=0.05)


def test_without_returns_the_ground_is_taken_as_level():
    plane = GroundPlane()
    plane.fit(np.array([1.0, 2.0, 5.0]), 2.0, S)
    np.testing.assert_array_equal(plane.slope, [0.0, 0.0])
    assert plane.height_at(np.array([9.0, 9.0])) == 2.0
