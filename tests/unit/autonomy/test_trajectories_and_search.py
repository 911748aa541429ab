"""Ways through a known map, and where to look next."""

import itertools
import threading

import numpy as np
import pytest

from volery.autonomy.planning.global_path import PathSearch, plan_path
from volery.autonomy.planning.search_area import SearchArea
from volery.autonomy.planning.viewpoints import next_viewpoint
from volery.autonomy.planning.voxel_space import SolidVoxels, VoxelSpace
from volery.core.errors import PlanError

SEARCH = PathSearch(radius_m=0.8, heights_m=(2.0, 4.0))


def ground(x, y):
    return 0.1 * x + 0.05 * y


def solid(obstacles, half_width=30.0):
    """Sloping ground with things (low corner, high corner above the ground) on it."""
    x, y = (a.ravel() for a in np.meshgrid(*[np.arange(-half_width, half_width, 0.5)] * 2))
    middles = [np.stack([x, y, ground(x, y)], -1)]
    for low, high in obstacles:
        steps = [np.arange(a + 0.1, b, 0.2) for a, b in zip(low, high, strict=True)]
        things = np.stack(np.meshgrid(*steps), -1).reshape(-1, 3)
        things[:, 2] += ground(things[:, 0], things[:, 1])
        middles.append(things)
    middle = np.concatenate(middles)
    return SolidVoxels(middle, np.full(len(middle), 0.2))


WALL = ((-0.3, -20.0, 0.0), (0.3, 4.0, 6.0))
START, GOAL = np.array([-10.0, 0.0, 2.0]), np.array([10.0, 0.0, 4.0])


@pytest.fixture(scope="module")
def walled():
    return VoxelSpace(solid([WALL]), 0.4, np.stack([START, GOAL]), 15.0)


def test_the_ground_and_distances_are_those_of_the_world(walled):
    for x, y in ((-10.0, 0.0), (3.0, 5.0), (9.0, -7.0)):
        assert walled.ground_at(np.array([x, y])) == pytest.approx(ground(x, y), abs=0.25)
    assert not walled.is_free(0.0, 0.0, 3.0, 0.4)
    assert not walled.is_free(-0.9, 0.0, 3.0, 0.9)
    assert walled.is_free(-1.8, 0.0, 3.0, 0.9)
    assert walled.is_free(5.0, 5.0, 3.0, 1.5)
    assert not walled.is_free_leg(-5.0, 0.0, 3.0, 5.0, 0.0, 3.0, 0.8)
    assert not walled.is_free(99.0, 0.0, 3.0, 0.1)


def test_a_path_leads_around_the_wall_over_the_sloping_ground(walled):
    path = plan_path(walled, START, GOAL, 3.0, SEARCH, 1)
    np.testing.assert_allclose(path[0, :2], START[:2])
    np.testing.assert_allclose(path[-1, :2], GOAL[:2])
    length = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).sum()
    assert 21.5 < length < 32.0
    fraction = np.linspace(0.0, 1.0, 50)[:, None]
    for a, b in itertools.pairwise(path):
        positions = a + fraction * (b - a)
        to_wall = np.hypot(
            np.maximum(np.abs(positions[:, 0]) - 0.3, 0), np.maximum(positions[:, 1] - 4.0, 0)
        )
        assert to_wall.min() > 0.4
        above = positions[:, 2] - ground(positions[:, 0], positions[:, 1])
        assert above.min() > 1.5
        assert above.max() < 4.6


def test_a_path_follows_from_its_seed_alone_whatever_other_threads_plan(walled):
    alone = {seed: plan_path(walled, START, GOAL, 3.0, SEARCH, seed) for seed in range(4)}
    assert any(not np.array_equal(alone[0], alone[k]) for k in (1, 2, 3))
    found = {}

    def plan(seeds):
        for seed in seeds:
            found[seed] = plan_path(walled, START, GOAL, 3.0, SEARCH, seed)

    threads = [threading.Thread(target=plan, args=(seeds,)) for seeds in ((3, 0), (1, 2))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for seed, path in alone.items():
        np.testing.assert_array_equal(found[seed], path)


def test_a_goal_beside_a_wall_is_moved_and_one_deep_inside_is_refused():
    block = ((5.0, -6.0, 0.0), (16.0, 6.0, 7.0))
    space = VoxelSpace(solid([block]), 0.4, np.stack([START, GOAL]), 15.0)
    with pytest.raises(PlanError, match=r"the goal \(10.0, 0.0\)"):
        plan_path(space, START, GOAL, 3.0, SEARCH, 1)
    path = plan_path(space, START, np.array([5.5, 0.0, 3.0]), 3.0, SEARCH, 1)
    assert path[-1, 0] < 4.4


def test_a_missing_path_is_reported_after_a_bounded_search():
    ring = [
        ((6.0, -4.0, 0.0), (6.6, 4.0, 8.0)),
        ((13.4, -4.0, 0.0), (14.0, 4.0, 8.0)),
        ((6.0, -4.0, 0.0), (14.0, -3.4, 8.0)),
        ((6.0, 3.4, 0.0), (14.0, 4.0, 8.0)),
    ]
    space = VoxelSpace(solid(ring), 0.4, np.stack([START, GOAL]), 10.0)
    with pytest.raises(PlanError, match="no path was found in 300 iterations"):
        plan_path(space, START, GOAL, 3.0, SEARCH._replace(iterations=300), 1)


def test_a_space_that_would_be_too_large_is_refused():
    with pytest.raises(PlanError, match="too far apart"):
        VoxelSpace(solid([]), 0.4, np.array([[0.0, 0.0], [9e3, 9e3]]), 10.0)
    with pytest.raises(PlanError, match="the map is empty"):
        VoxelSpace(solid([]), 0.4, np.array([[200.0, 200.0], [210.0, 200.0]]), 10.0)


# ---------------------------------------------------------------------------------------- search


def area(width=60.0, depth=40.0):
    return SearchArea(np.array([[0, 0], [width, 0], [width, depth], [0, depth]], float), 1.0)


def grid_of(blocked=lambda x, y: False, known=lambda x, y: True):
    """60 m x 40 m of cells of 0.4 m from (-10, -10) on."""
    x = (np.arange(200) * 0.4 - 9.8)[None, :]
    y = (np.arange(150) * 0.4 - 9.8)[:, None]
    values = np.where(np.vectorize(blocked)(x, y), 100, 0)
    return np.where(np.vectorize(known)(x, y), values, -1).astype(np.int8), np.full(2, -10.0), 0.4


def test_a_triangle_has_half_the_area_of_its_box():
    corners = np.array([[0.0, 0.0], [50.0, 0.0], [0.0, 30.0]])
    assert SearchArea(corners, 0.5).size_m2 == pytest.approx(750.0, rel=0.02)


@pytest.mark.parametrize(
    "corners", [[[0, 0], [1, 1]], [[0, 0], [np.nan, 1], [2, 2]], [[0, 0], [1, 1], [2, 2]]]
)
def test_what_is_no_area_is_refused(corners):
    with pytest.raises(PlanError):
        SearchArea(np.array(corners, float), 0.5)


def test_what_lies_behind_a_wall_or_is_not_known_has_not_been_seen():
    field = area()
    field.look(np.array([20.0, 20.0]), *grid_of(lambda x, y: 25.0 < x < 25.5), 10.0)
    assert field.seen[15, 20]
    assert not field.seen[27, 20]
    field = area()
    field.look(np.array([20.0, 20.0]), *grid_of(known=lambda x, y: x < 25.0), 10.0)
    assert field.seen[15, 20]
    assert not field.seen[27, 20]
    open_field = area()
    open_field.look(np.array([20.0, 20.0]), *grid_of(), 10.0)
    assert open_field.seen_m2 == pytest.approx(np.pi * 100.0, rel=0.12)  # cells at the rim


def test_a_search_covers_its_area_on_a_short_path():
    field, position, heading, length = area(), np.array([2.0, 2.0]), 0.0, 0.0
    grid, goal = grid_of(), None
    while length < 400.0:
        field.look(position, *grid, 8.0)
        gain = 0.0 if goal is None else field.gains(goal.position[None], 8.0)[0][0]
        if (
            goal is None
            or np.hypot(*(goal.position - position)) < 2.4
            or gain < 0.15 * goal.gain_m2
        ):
            goal = next_viewpoint(field, position, heading, 8.0)
            if goal is None:
                break
        heading = np.arctan2(*(goal.position - position)[::-1])
        position = position + 2.0 * np.array([np.cos(heading), np.sin(heading)])
        length += 2.0
    assert goal is None
    assert field.covered_fraction > 0.98
    assert length < 2.2 * field.size_m2 / 16.0  # lanes of 16 m without any turn are 150 m


def test_positions_that_were_refused_are_not_tried_again():
    field, position = area(), np.array([5.0, 5.0])
    first = next_viewpoint(field, position, 0.0, 8.0)
    second = next_viewpoint(field, position, 0.0, 8.0, [first.position])
    assert np.hypot(*(first.position - second.position)) > 2.0
    everywhere = [np.array([x, y]) for x in range(0, 60, 2) for y in range(0, 40, 2)]
    assert next_viewpoint(field, position, 0.0, 8.0, everywhere) is None
