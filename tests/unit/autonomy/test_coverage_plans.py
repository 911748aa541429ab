"""Coverage: the published reference cases, distances, parts, tours, refusals, flights."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from volery.autonomy.coverage.cells import FAR, MAX_CELLS, CoverageCells
from volery.autonomy.coverage.components import level_shares
from volery.autonomy.coverage.field import CoverageField
from volery.autonomy.coverage.flight import CoverageFlight, CoveragePhase
from volery.autonomy.coverage.plan import UNREACHABLE, plan_coverage
from volery.autonomy.coverage.spanning_tree import CoverageTour
from volery.autonomy.coverage.waypoints import HeightProfile, WaypointProgress, route_waypoints
from volery.core.errors import PlanError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import OccupancyGrid
from volery_benchmarks.coverage import CASES


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_reference_cases_are_divided_within_one_cell(case):
    free, starts = case.free(), case.start_cells()
    plan = plan_coverage(free, starts)
    share, more = divmod(int(free.sum()), len(starts))
    assert sorted(plan.shares) == [share] * (len(starts) - more) + [share + 1] * more
    assert plan.spread == (1 if more else 0)
    assert [len(route[0].sub_cells) for route in plan.routes] == (4 * plan.shares).tolist()


def test_the_same_seed_gives_the_same_plan():
    free = np.random.default_rng(3).random((30, 30)) > 0.15
    starts = np.argwhere(free)[[0, 50, 300]]
    one, two = plan_coverage(free, starts, seed=4), plan_coverage(free, starts, seed=4)
    np.testing.assert_array_equal(one.owner, two.owner)
    for a, b in zip(one.routes, two.routes, strict=True):
        np.testing.assert_array_equal(a[0].sub_cells, b[0].sub_cells)


def test_starts_side_by_side_get_equal_areas():
    plan = plan_coverage(np.ones((40, 40), bool), [(0, i) for i in range(8)])
    assert plan.spread == 0


def test_distances_are_those_of_an_independent_solver():
    free = np.random.default_rng(7).random((20, 25)) > 0.3
    cells = CoverageCells.of(free)
    found = cells.distances([0])
    ends, lengths = [], []
    for k, (row, column) in enumerate(cells.rows_and_columns()):
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            other = cells.number(row + down, column + right)
            passes = (
                down == 0 or right == 0 or (free[row, column + right] and free[row + down, column])
                if 0 <= column + right < 25 and row + down < 20
                else False
            )
            if other >= 0 and passes:
                ends.append((k, other))
                lengths.append(1.4 if down and right else 1.0)
    graph = coo_array((lengths, np.array(ends).T), shape=(len(cells), len(cells)))
    expected = dijkstra(graph.tocsr(), directed=False, indices=0)
    np.testing.assert_allclose(np.where(found == FAR, np.inf, found), expected, rtol=1e-6)


def test_a_path_goes_around_what_is_blocked():
    free = np.ones((5, 5), bool)
    free[1:, 2] = False
    cells = CoverageCells.of(free)
    path = cells.rows_and_columns()[cells.path(cells.number(4, 0), cells.number(4, 4))]
    assert path[0].tolist() == [4, 0]
    assert path[-1].tolist() == [4, 4]
    assert [0, 2] in path.tolist()
    assert np.abs(np.diff(path, axis=0)).max() == 1


def test_a_part_without_a_uav_goes_to_the_nearest_which_gets_less_of_its_own():
    free = np.ones((4, 11), bool)
    free[:, 8] = False  # 32 cells with the UAVs, 8 beyond
    plan = plan_coverage(free, [(0, 0), (0, 7)], flies_over=True)
    assert plan.shares.tolist() == [20, 20]
    assert (plan.owner[:, 9:] == 1).all()
    assert [len(tour.sub_cells) for tour in plan.routes[1]] == [4 * 12, 4 * 8]
    shut_in = plan_coverage(free, [(0, 0), (0, 7)])
    assert (shut_in.owner[:, 9:] == UNREACHABLE).all()
    assert shut_in.unreachable == 8
    assert shut_in.shares.tolist() == [16, 16]


def test_loads_are_levelled_as_far_as_that_goes():
    assert level_shares(10, np.array([0, 0, 0])).tolist() == [4, 3, 3]
    assert level_shares(10, np.array([100, 0, 0])).tolist() == [1, 5, 4]
    assert level_shares(10, np.array([2, 0])).tolist() == [4, 6]
    assert level_shares(3, np.array([9, 9, 9])).tolist() == [1, 1, 1]


@pytest.mark.parametrize(
    ("free", "starts", "reason"),
    [
        (np.ones((3, 3), bool), [(1, 1), (2, 2), (1, 1)], "UAVs 1 and 3 both start in row 1"),
        (np.eye(3, dtype=bool), [(0, 1)], "row 0, column 1, which is blocked"),
        (np.ones((3, 3), bool), [(0, 3)], "lies outside the map"),
        (np.ones((3, 3), bool), [(-1, 0)], "lies outside the map"),
        (np.zeros((3, 3), bool), [(0, 0)], "no free cell"),
        (np.zeros((0, 3), bool), [(0, 0)], "rows and columns"),
        (np.ones((3, 3), bool), [], "at least one UAV"),
        (np.ones((4096, 4096), bool), [(0, 0)], f"at most {MAX_CELLS:,} can be planned"),
        (np.ones((1, 4096 * 4096 + 1), bool), [(0, 0)], "4096 x 4096"),
    ],
)
def test_what_cannot_be_planned_is_refused_with_the_reason(free, starts, reason):
    with pytest.raises(PlanError, match=reason):
        plan_coverage(free, starts)


def test_too_many_uavs_for_a_large_map_are_refused():
    with pytest.raises(PlanError, match="70 UAVs for 262,144 cells"):
        plan_coverage(np.ones((512, 512), bool), [(0, k) for k in range(70)])


def test_the_smallest_maps():
    one = plan_coverage(np.ones((1, 1), bool), [(0, 0)])
    assert one.routes[0][0].sub_cells.tolist() == [[0, 0], [0, 1], [1, 1], [1, 0]]
    full = plan_coverage(np.ones((2, 2), bool), [(0, 0), (0, 1), (1, 0), (1, 1)])
    assert full.shares.tolist() == [1, 1, 1, 1]


def test_a_sparse_map_as_large_as_any_is_planned():
    free = np.zeros((4096, 4096), bool)
    free[2000:2004] = True
    plan = plan_coverage(free, [(2000, 0), (2003, 4095)])
    assert plan.shares.tolist() == [8192, 8192]


def test_the_order_with_fewest_turns_is_taken():
    wide = plan_coverage(np.ones((2, 10), bool), [(0, 0)]).routes[0][0]
    high = plan_coverage(np.ones((10, 2), bool), [(0, 0)]).routes[0][0]
    assert wide.turns == high.turns == 8  # two long spines and one link, either way
    assert len(wide.corners()) == 8


# --------------------------------------------------------------------------------------- in the map


def map_message(free, cell_m=2.0, origin=(0.0, 0.0), yaw=0.0):
    message = zero_message(OccupancyGrid.__msgtype__)
    message.info.resolution = cell_m
    message.info.height, message.info.width = free.shape
    message.info.origin.position.x, message.info.origin.position.y = origin
    message.info.origin.orientation.z = np.sin(0.5 * yaw)
    message.info.origin.orientation.w = np.cos(0.5 * yaw)
    message.data = np.where(free, 0, 100).astype(np.int8).ravel()
    return message


def test_a_turned_field_knows_its_cells():
    free = np.ones((3, 5), bool)
    field = CoverageField.from_message(map_message(free, 2.0, (10.0, -4.0), 0.5))
    cells = np.argwhere(free)
    np.testing.assert_array_equal(field.cells_at(field.centres(cells)), cells)
    np.testing.assert_allclose(
        field.centres([0, 0]),
        [10.0 + np.cos(0.5) - np.sin(0.5), -4.0 + np.sin(0.5) + np.cos(0.5)],
    )
    np.testing.assert_array_equal(field.sub_cells_at(field.sub_centres([3, 7])), [3, 7])


def test_unknown_and_occupied_cells_are_not_free():
    message = map_message(np.ones((1, 4), bool))
    message.data = np.array([0, 49, 50, -1], np.int8)
    np.testing.assert_array_equal(
        CoverageField.from_message(message).free, [[True, True, False, False]]
    )


@pytest.mark.parametrize("fault", ["size", "resolution", "origin"])
def test_maps_that_are_none_are_refused(fault):
    message = map_message(np.ones((2, 2), bool))
    if fault == "size":
        message.info.width = 3
    elif fault == "resolution":
        message.info.resolution = 0.0
    else:
        message.info.origin.position.x = np.nan
    with pytest.raises(PlanError):
        CoverageField.from_message(message)


def test_transits_are_flown_apart_and_around_what_is_blocked():
    free = np.ones((5, 5), bool)
    free[1:, 2] = False
    field = CoverageField(free, 2.0, (0.0, 0.0))
    tour = CoverageTour(np.array([[8, 8], [8, 9], [9, 9], [9, 8]], np.int32), 4)
    home = np.array([1.0, 9.0, 0.0])
    for uav in (0, 1):
        waypoints = route_waypoints(
            field, CoverageCells.of(free), HeightProfile(2.0, 1.5, 0.0), uav, home, home, [tour]
        )
        transit = waypoints.positions[~waypoints.covering][:-1]
        np.testing.assert_allclose(transit[:, 2], 2.0 + 1.5 * (uav + 1))
        assert (transit[:, 1] < 2.0).any()  # through the gap in the lowest row
        np.testing.assert_allclose(waypoints.positions[waypoints.covering][:, 2], 2.0)
        np.testing.assert_allclose(waypoints.positions[-1], [1.0, 9.0, 2.0])


def test_a_uav_that_gets_nowhere_is_lost():
    flight = CoverageFlight("uav1", phase=CoveragePhase.COVER)
    flight.moved(np.zeros(3), 0.0, 0)
    flight.send(WaypointProgress(np.array([[10.0, 0, 0], [20.0, 0, 0]]), np.array([True, True])), 0)
    for second in range(1, 8):
        now = second * 1_000_000_000
        flight.moved(np.array([float(min(second, 3)), 0.0, 0.0]), 0.0, now)
        flight.goal(0.3, now)
        assert flight.is_lost(3.5, now) is (second == 7)
    flight.moved(np.array([10.0, 0.1, 0.0]), 0.0, now)
    assert flight.goal(0.3, now)[0] == 20.0
    assert not flight.is_lost(3.5, now)
