"""Every free cell is visited once, by closed tours through connected areas, whatever the map."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.ndimage import label

from volery.autonomy.coverage.components import level_shares
from volery.autonomy.coverage.plan import NOT_TO_VISIT, UNREACHABLE, plan_coverage

maps = arrays(
    np.bool_,
    array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=12),
    elements=st.sampled_from([True, True, True, False]),
)


@st.composite
def maps_and_starts(draw):
    free = draw(maps.filter(lambda free: free.any()))
    cells = np.argwhere(free)
    count = draw(st.integers(1, min(5, len(cells))))
    chosen = draw(st.permutations(range(len(cells))))[:count]
    return free, cells[chosen]


def check_tours(plan, free):
    """Tours are closed, step by step, and come through each sub-cell of their areas once."""
    visits = np.zeros((2 * free.shape[0], 2 * free.shape[1]), np.int64)
    for uav, route in enumerate(plan.routes):
        for tour in route:
            steps = np.abs(np.diff(tour.sub_cells, axis=0, append=tour.sub_cells[:1]))
            assert (steps.sum(axis=1) == 1).all()
            np.add.at(visits, tuple(tour.sub_cells.T), 1)
            rows, columns = (tour.sub_cells // 2).T
            assert (plan.owner[rows, columns] == uav).all()
    np.testing.assert_array_equal(visits, np.kron(plan.owner >= 0, np.ones((2, 2), np.int64)))


@settings(max_examples=150)
@given(maps_and_starts(), st.booleans())
def test_every_free_cell_is_visited_once_by_closed_tours(case, flies_over):
    free, starts = case
    plan = plan_coverage(free, starts, flies_over=flies_over)
    np.testing.assert_array_equal(plan.owner == NOT_TO_VISIT, ~free)
    check_tours(plan, free)
    parts, _ = label(free)  # neighbours by sides, as an implementation of others sees them
    reached = np.isin(parts, parts[tuple(starts.T)])
    np.testing.assert_array_equal(plan.owner == UNREACHABLE, free & ~reached & (not flies_over))


@settings(max_examples=150)
@given(maps_and_starts())
def test_areas_are_connected_and_hold_their_starts(case):
    free, starts = case
    plan = plan_coverage(free, starts)
    for uav, (row, column) in enumerate(starts):
        assert plan.owner[row, column] == uav
        assert label(plan.owner == uav)[1] == 1
        assert tuple(plan.routes[uav][0].sub_cells[0] // 2) == (row, column)


@settings(max_examples=60)
@given(maps_and_starts(), st.data())
def test_what_is_left_is_visited_once_from_anywhere(case, data):
    free, starts = case
    to_visit = free & data.draw(arrays(np.bool_, free.shape))
    plan = plan_coverage(free, starts, to_visit=to_visit, flies_over=True)
    np.testing.assert_array_equal(plan.owner >= 0, to_visit)
    check_tours(plan, free)


@given(
    st.lists(st.integers(0, 50), min_size=1, max_size=6),
    st.integers(0, 100),
)
def test_loads_are_as_even_as_can_be(carried, more):
    carried = np.array(carried)
    cells = len(carried) + more
    given_ = level_shares(cells, carried)
    assert given_.sum() == cells
    assert given_.min() >= 1
    load = carried + given_
    # a UAV that has more than one cell of the part could not give one to another for an evener load
    givers = load[given_ > 1]
    assert givers.size == 0 or givers.max() - load.min() <= 1


def test_open_maps_are_divided_within_one_cell():
    rng = np.random.default_rng(5)
    for _ in range(60):
        rows, columns = rng.integers(6, 40, 2)
        robots = int(rng.integers(2, 7))
        starts = np.unravel_index(rng.choice(rows * columns, robots, False), (rows, columns))
        plan = plan_coverage(np.ones((rows, columns), bool), np.stack(starts, axis=1))
        assert plan.spread <= 1
        assert np.ptp(plan.shares) == (1 if rows * columns % robots else 0)
