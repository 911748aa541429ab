"""Local planning: primitives, distances, guidance, the guaranteed stop."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.autonomy.perception.scan_rays import Rays
from volery.autonomy.planning.clearance import clearance_of
from volery.autonomy.planning.cost_to_go import CellCosts, cost_to_go
from volery.autonomy.planning.distances import squared_distances
from volery.autonomy.planning.local_grid import UNKNOWN, LocalGrid
from volery.autonomy.planning.local_planner import PathLookahead
from volery.autonomy.planning.primitive_selection import judge
from volery.autonomy.planning.primitives import (
    MotionLimits,
    PrimitivePath,
    PrimitiveState,
    braking,
    changed,
    fan,
)
from volery.autonomy.planning.receding_horizon import (
    Observations,
    PlannerSettings,
    PlannerState,
    RecedingHorizonPlanner,
)
from volery.autonomy.planning.surface import Surface

LIMITS = MotionLimits(3.0, 2.5, 1.5, 1.5, 1.4)
CELL = 0.25
LEVEL = Surface(0.0, np.zeros(2))
OFFSETS = np.array([0.0, 0.75, -0.75])
vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


def nothing(x, y):
    return np.zeros(np.broadcast(x, y).shape, bool)


def everywhere(x, y):
    return ~nothing(x, y)


def trunks_at(positions, radius):
    """Round trunks (K, 2) as a world."""
    return lambda x, y: (
        np.hypot(x[..., None] - positions[:, 0], y[..., None] - positions[:, 1]).min(axis=-1)
        < radius
    )


def window(occupied=nothing, known=everywhere, shape=(96, 96, 24)):
    """Scores of upright things around the origin, and the lowest cell."""
    low = -np.array(shape) // 2
    x = (np.arange(shape[0]) + low[0] + 0.5)[:, None] * CELL
    y = (np.arange(shape[1]) + low[1] + 0.5)[None, :] * CELL
    x, y = np.broadcast_arrays(x, y)
    column = np.where(known(x, y), np.where(occupied(x, y), 5, -1), UNKNOWN)
    return np.repeat(column[:, :, None], shape[2], axis=2).astype(np.int8), low


def sight(*world, planes=()):
    scores, low = window(*world)
    return Observations(clearance_of(scores, low, CELL, 3), LEVEL, list(planes))


# ------------------------------------------------------------------------------------ primitives


@given(vectors, vectors, vectors, st.floats(0.3, 3.0))
def test_a_change_of_velocity_begins_and_ends_as_given(velocity, acceleration, wanted, seconds):
    start = PrimitiveState(np.zeros(3), velocity, acceleration)
    first, last = changed(start, wanted, seconds, 0.0), changed(start, wanted, seconds, seconds)
    np.testing.assert_allclose(first.velocity, velocity, atol=1e-9)
    np.testing.assert_allclose(first.acceleration, acceleration, atol=1e-9)
    np.testing.assert_allclose(last.velocity, wanted, atol=1e-9)
    np.testing.assert_allclose(last.acceleration, 0.0, atol=1e-8)
    h = 1e-4
    before, after = (changed(start, wanted, seconds, 0.5 * seconds + s * h) for s in (-1, 1))
    middle = changed(start, wanted, seconds, 0.5 * seconds)
    np.testing.assert_allclose(
        (after.position - before.position) / (2 * h), middle.velocity, atol=1e-6
    )
    np.testing.assert_allclose(
        (after.velocity - before.velocity) / (2 * h), middle.acceleration, atol=1e-5
    )


@given(vectors)
def test_braking_from_steady_flight_keeps_the_limits_and_ends_at_rest(velocity):
    path = braking(PrimitiveState(np.zeros(3), velocity, np.zeros(3)), LIMITS)
    times = np.linspace(0.0, path.duration_s, 60)
    bends = np.array([path.at(t).acceleration for t in times])
    assert np.hypot(bends[:, 0], bends[:, 1]).max() <= LIMITS.acceleration * 1.001
    assert np.abs(bends[:, 2]).max() <= LIMITS.climb_acceleration * 1.001
    for late in (path.duration_s, path.duration_s + 5.0):
        np.testing.assert_allclose(path.at(late).velocity, 0.0, atol=1e-9)
    np.testing.assert_allclose(path.at(99.0).position, path.at(path.duration_s).position)


def test_paths_are_smooth_where_their_parts_meet():
    path = PrimitivePath(
        PrimitiveState(np.zeros(3), np.array([1.0, 0, 0]), np.zeros(3)),
        np.array([2.0, 1, 0.5]),
        0.8,
        0.7,
        1.5,
    )
    for joint in (0.8, 1.5):
        before, after = path.at(joint - 1e-9), path.at(joint + 1e-9)
        for a, b in zip(before, after, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-6)


# --------------------------------------------------------------------------------------- the grid


def test_distances_are_those_of_brute_force():
    rng = np.random.default_rng(5)
    occupied = rng.random((20, 17, 12)) < 0.01
    square = squared_distances(occupied, 7)
    cells, things = np.argwhere(np.ones_like(occupied)), np.argwhere(occupied)
    plain = ((cells[:, None] - things[None]) ** 2).sum(-1).min(1).reshape(occupied.shape)
    np.testing.assert_array_equal(square, np.minimum(plain, 49))


def rays(starts, ends, hits):
    return Rays(
        np.atleast_2d(starts).astype(float), np.atleast_2d(ends).astype(float), np.array(hits)
    )


def test_the_grid_follows_the_vehicle_and_forgets_what_leaves_it():
    grid = LocalGrid(CELL, (32, 32, 16))
    grid.move_to(np.zeros(3))
    grid.add(rays([[0.1, 0.1, 0.1]], [[2.1, 0.1, 0.1]], [True]))
    scores, low = grid.window(np.zeros(3), (24, 24, 8))
    at = lambda x: tuple(np.floor(np.array(x) / CELL).astype(int) - low)  # noqa: E731
    assert scores[at([2.1, 0.1, 0.1])] > 0
    assert scores[at([1.0, 0.1, 0.1])] == -1
    assert scores[at([2.6, 0.1, 0.1])] == UNKNOWN
    assert scores[at([1.0, 0.6, 0.1])] == UNKNOWN
    for x in np.arange(0.0, 20.0, 0.7):  # away, and back again
        grid.move_to(np.array([x, 0.0, 0.0]))
    grid.move_to(np.zeros(3))
    scores, low = grid.window(np.zeros(3), (24, 24, 8))
    assert (scores == UNKNOWN).all()


def test_one_hit_of_a_scan_beats_its_misses():
    grid = LocalGrid(CELL, (32, 32, 16))
    grid.move_to(np.zeros(3))
    ends = np.stack([np.full(31, 3.6), np.linspace(-0.2, 0.2, 31), np.zeros(31)], -1)
    ends[15, 0] = 2.1
    hits = np.ones(31, bool)
    for _ in range(20):
        grid.add(rays(np.zeros((31, 3)), ends, hits))
    scores, low = grid.window(np.zeros(3), (32, 32, 16))
    assert scores[tuple(np.array([8, 0, 0]) - low)] > 0


@settings(max_examples=30)
@given(vectors, vectors, st.floats(-0.3, 0.3), st.floats(-0.2, 0.2))
def test_rays_visit_the_cells_of_fine_sampling(end, start, dx, dy):
    start, end = start + np.array([dx, dy, 0.013]), end + 0.017
    grid = LocalGrid(CELL, (40, 40, 40))
    grid.move_to(np.zeros(3))
    grid.add(rays([start], [end], [False]))
    scores, low = grid.window(np.zeros(3), (40, 40, 40))
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    cells = np.unique(np.floor((start + share * (end - start)) / CELL).astype(int), axis=0)
    free = np.argwhere(scores != UNKNOWN) + low
    assert {tuple(c) for c in cells} <= {tuple(c) for c in free}
    assert len(free) <= 2 * len(cells) + 2  # corners that sampling steps over
    aside = np.linalg.norm(np.cross((free + 0.5) * CELL - start, end - start), axis=1)
    assert (aside <= 0.87 * CELL * np.linalg.norm(end - start) + 1e-9).all()  # half a diagonal


# --------------------------------------------------------------------------------------- guidance


def test_the_guidance_goes_around_a_wall_and_knows_what_is_unreachable():
    wall = lambda x, y: (abs(x - 3.0) < 0.3) & (y > -5.0)  # noqa: E731
    costs = cost_to_go(
        sight(wall).clearance, LEVEL, OFFSETS, np.array([7.0, 0.0]), CellCosts(0.6, 1.6)
    )
    assert costs.at(np.zeros(2)) > math.hypot(3.0, 5.0) + math.hypot(4.0, 5.0)
    assert costs.at(np.array([6.0, 0.0])) < 4.0
    here = np.zeros(2)
    for _ in range(60):  # descending leads there
        angle = costs.descent(here, 0.5)
        if angle is None:
            break
        here = here + 0.25 * np.array([math.cos(angle), math.sin(angle)])
        assert not wall(*here)
    assert np.hypot(*(here - [7.0, 0.0])) < 3.0
    closed = lambda x, y: abs(np.maximum(abs(x - 7.0), abs(y)) - 2.3) < 0.3  # noqa: E731
    costs = cost_to_go(
        sight(closed).clearance, LEVEL, OFFSETS, np.array([7.0, 0.0]), CellCosts(0.6, 1.6)
    )
    assert costs.at(np.array([6.5, 0.0])) < 2.0


def test_candidates_are_judged_as_plain_sampling_would():
    trunk = lambda x, y: np.hypot(x - 3.0, y - 0.5) < 0.3  # noqa: E731
    seen = sight(trunk, lambda x, y: x < 5.0)
    costs = cost_to_go(seen.clearance, LEVEL, OFFSETS, np.array([8.0, 0.0]), CellCosts(0.6, 1.6))
    start = PrimitiveState(np.zeros(3), np.array([1.0, 0.5, 0.0]), np.array([0.3, -0.2, 0.1]))
    directions, speeds = np.linspace(-3.0, 3.0, 9), np.array([0.5, 1.5, 3.0])
    candidates = fan(start, directions, speeds, OFFSETS, np.zeros((9, 3, 3)), LIMITS)
    verdicts = judge(candidates, seen.clearance, costs, 1.6, 3.0)
    for k in range(len(candidates.rise_s)):
        path = candidates.path(k)
        times = np.minimum(np.arange(0.0, path.duration_s + 0.08, 0.08), path.duration_s)
        states = [path.at(t) for t in times]
        positions = np.array([s.position for s in states])
        assert verdicts.nearest_m[k] == pytest.approx(seen.clearance.at(positions).min(), abs=1e-9)
        assert verdicts.unknown[k] == (positions[:, 0] >= 5.0).any()
        max_acceleration = max(np.hypot(*s.acceleration[:2]) for s in states)
        assert verdicts.max_acceleration_m_s2[k] == pytest.approx(max_acceleration, abs=1e-9)


# ------------------------------------------------------------------------------- plan after plan


def fly(world, goal, seconds, planning=None, start=(0.0, 0.0, 0.0)):
    """Fly plans perfectly in a world that is all in sight; states every 0.1 s."""
    planning = planning or RecedingHorizonPlanner(PlannerSettings(LIMITS))
    now, state = 0, PrimitiveState(np.array(start), np.zeros(3), np.zeros(3))
    track, seen = [state], sight(*world)
    for _ in range(round(seconds / 0.2)):
        then = now + 100_000_000
        begin = planning.start(state, 0.0, now, then)
        planning.plan(begin, np.array(goal), seen, then)
        now += 200_000_000
        state = planning.state_at(now)
        track.append(state)
    return planning, track


def test_it_flies_between_trunks_at_speed():
    trunks = np.array([(3.0, 0.2), (4.5, -2.2), (6.0, 1.5), (3.5, 2.6)])
    world = (trunks_at(trunks, 0.2),)
    _, track = fly(world, (8.0, 0.0), 6.0)
    positions = np.array([s.position for s in track])
    nearest = min(np.hypot(*(positions[:, :2] - t).T).min() for t in trunks)
    assert nearest > 0.2 + 0.5
    assert positions[-1, 0] > 6.0
    assert max(np.linalg.norm(s.velocity) for s in track) > 2.0
    bends = [np.hypot(*s.acceleration[:2]) for s in track]
    assert max(bends) <= 1.25 * LIMITS.acceleration + 1e-6


def test_it_stops_before_what_is_not_known():
    world = (nothing, lambda x, y: x < 4.0)
    _, track = fly(world, (10.0, 0.0), 6.0)
    assert 2.0 < track[-1].position[0] < 4.0
    assert np.linalg.norm(track[-1].velocity) < 0.3
    bold = RecedingHorizonPlanner(PlannerSettings(LIMITS, avoid_unknown=False))
    _, track = fly(world, (10.0, 0.0), 4.0, bold)
    assert track[-1].position[0] > 4.0


@settings(max_examples=8)
@given(st.integers(0, 10_000))
def test_whenever_plans_cease_it_comes_to_rest_in_known_free_space(seed):
    rng = np.random.default_rng(seed)
    trunks = rng.uniform(-8.0, 8.0, (25, 2))
    trunks = trunks[np.hypot(*trunks.T) > 1.5]
    hidden = rng.uniform(2.0, 6.0)
    world = (trunks_at(trunks, 0.25), lambda x, y: np.hypot(x, y) < hidden)
    goal = 9.0 * np.array([math.cos(seed), math.sin(seed)])
    planning, _ = fly(world, goal, rng.uniform(0.4, 3.0))
    seen = sight(*world).clearance
    times = planning.began_ns + (np.arange(0.0, 8.0, 0.05) * 1e9).astype(np.int64)
    positions = np.array([planning.state_at(int(t)).position for t in times])
    radius_m = PlannerSettings(LIMITS).radius_m
    assert seen.at(positions).min() >= min(radius_m, float(seen.at(positions[:1])[0]))
    assert (np.hypot(*positions[:, :2].T) < hidden + CELL).all()
    np.testing.assert_allclose(planning.state_at(int(times[-1])).velocity, 0.0, atol=1e-6)


def test_a_new_obstacle_on_the_plan_is_braked_for():
    planning, track = fly((nothing,), (9.0, 0.0), 1.6)
    state, now = track[-1], 1_600_000_000
    x = state.position[0] + 3.6
    seen = sight(lambda a, b: abs(a - x) < 0.2)
    for _ in range(15):
        begin = planning.start(state, 0.0, now, now + 100_000_000)
        planning.plan(begin, np.array([9.0, 0.0]), seen, now + 100_000_000)
        now += 200_000_000
        state = planning.state_at(now)
    assert x - state.position[0] > 0.5


def test_shut_in_it_stays_and_says_so():
    world = (lambda x, y: abs(np.hypot(x, y) - 1.3) < 0.3,)
    planning, track = fly(world, (8.0, 0.0), 3.0)
    assert np.linalg.norm(track[-1].position) < 0.6
    assert planning.doing in (PlannerState.BLOCKED, PlannerState.TURNING)


def test_far_from_its_plan_it_begins_anew_from_where_it_is():
    planning, _ = fly((nothing,), (9.0, 0.0), 2.0)
    pushed = PrimitiveState(np.array([0.0, 5.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3))
    begin = planning.start(pushed, 0.0, 2_000_000_000, 2_100_000_000)
    np.testing.assert_allclose(begin.position, [0.0, 5.1, 0.0], atol=0.02)


def test_state_goes_back():
    planning, _ = fly((nothing,), (9.0, 0.0), 1.0)
    other = RecedingHorizonPlanner(planning.policy)
    other.set_state(planning.get_state())
    for a, b in zip(planning.state_at(1_300_000_000), other.state_at(1_300_000_000), strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_lookahead_point_goes_ahead_along_the_path_and_not_back():
    lookahead = PathLookahead(np.array([[0.0, 0, 0], [10.0, 0, 0], [10.0, 10, 0]]))
    np.testing.assert_allclose(
        lookahead.lookahead_point(np.array([2.0, 1.0]), 9.0), [10.0, 1.0], atol=0.3
    )
    assert lookahead.left_m(np.array([2.0, 0.0])) == pytest.approx(18.0, abs=0.3)
    lookahead.lookahead_point(np.array([9.0, 6.0]), 3.0)
    np.testing.assert_allclose(
        lookahead.lookahead_point(np.array([9.0, 6.0]), 9.0), [10.0, 10.0], atol=0.3
    )
    np.testing.assert_allclose(lookahead.lookahead_point(np.array([2.0, 0.0]), 0.0)[0], 10.0)
    one = PathLookahead(np.array([[3.0, 4.0, 0.0]]))
    np.testing.assert_allclose(one.lookahead_point(np.zeros(2), 9.0), [3.0, 4.0])
    assert one.left_m(np.zeros(2)) == pytest.approx(5.0)
