"""Reciprocal avoidance, against brute force and in flights of several."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.autonomy.planning.reciprocal_avoidance import (
    HalfPlane,
    Neighbour,
    Separation,
    half_planes,
    violation,
)

S = 1_000_000_000
c, s = math.cos(0.35), math.sin(0.35)
SEPARATION = Separation(radius_m=2.0, horizon_s=4.0)


def at(x, y, vx=0.0, vy=0.0, z=0.0, time_ns=0):
    return Neighbour(np.array([x, y, z]), np.array([vx, vy, 0.0]), time_ns)


def avoiding_velocity(planes, preferred, top_speed):
    """Returns the allowed velocity (2,) nearest to the preferred one; else the smallest violation.

    With few constraints the optimum lies at the preferred velocity, at its projection on one of the
    lines or on the circle of `top_speed`, or at an intersection of two of them: all are tried. If
    no velocity is allowed, the fastest one out of each half plane is tried as well.
    """
    tries = [preferred, np.zeros(2)]
    tries += [plane.point + _along(plane) * _foot(plane, preferred) for plane in planes]
    for k, plane in enumerate(planes):
        tries += [top_speed * plane.normal, *_on_circle(plane, top_speed)]
        for other in planes[:k]:
            across = float(_along(plane) @ other.normal)
            if abs(across) > 1e-9:
                share = float((other.point - plane.point) @ other.normal) / across
                tries.append(plane.point + _along(plane) * share)
    speed = np.linalg.norm(preferred)
    if speed > 1e-9:
        tries.append(preferred * min(1.0, top_speed / speed))
    velocities = np.array([v for v in tries if np.linalg.norm(v) <= top_speed + 1e-9])
    worst = np.maximum(violation(planes, velocities), 1e-9)
    away = np.linalg.norm(velocities - preferred, axis=1)
    return np.asarray(velocities[np.lexsort((away, np.round(worst, 9)))[0]])


def _along(plane):
    return np.array([plane.normal[1], -plane.normal[0]])


def _foot(plane, velocity):
    return float((velocity - plane.point) @ _along(plane))


def _on_circle(plane, radius):
    along = _along(plane)
    half, rest = float(plane.point @ along), float(plane.point @ plane.point) - radius * radius
    root = half * half - rest
    if root < 0.0:
        return []
    return [plane.point + along * (-half + sign * math.sqrt(root)) for sign in (-1.0, 1.0)]


def step(positions, velocities, goals, seconds=0.2, speed=2.0):
    """All avoid each other at once."""
    chosen = []
    for k, (position, velocity) in enumerate(zip(positions, velocities, strict=True)):
        others = [at(*positions[j], *velocities[j]) for j in range(len(positions)) if j != k]
        planes = half_planes(
            np.append(position, 0.0), np.append(velocity, 0.0), others, SEPARATION, 0
        )
        offset = goals[k] - position
        length = np.hypot(*offset)
        wanted = offset / max(length, 1e-9) * min(speed, length / 0.5)
        if violation(planes, wanted[None])[0] > 0.0:  # keep right, lest all come to a stand
            wanted = np.array([[c, s], [-s, c]]) @ wanted
        chosen.append(avoiding_velocity(planes, wanted, speed))
    velocities = np.array(chosen)
    return positions + seconds * velocities, velocities


def fly(positions, goals, steps=200):
    positions, velocities, nearest = (
        np.array(positions, float),
        np.zeros((len(positions), 2)),
        math.inf,
    )
    for _ in range(steps):
        positions, velocities = step(positions, velocities, np.array(goals, float))
        apart = np.hypot(*(positions[:, None] - positions[None]).transpose(2, 0, 1))
        nearest = min(nearest, apart[~np.eye(len(positions), dtype=bool)].min())
    return nearest, np.hypot(*(positions - goals).T).max()


def test_two_that_meet_pass_each_other():
    nearest, left = fly([[0.0, 0.05], [20.0, 0.0]], [[20.0, 0.0], [0.0, 0.0]])
    assert nearest > 1.95
    assert left < 0.5


def test_six_on_a_circle_change_sides():
    angle = np.arange(6) * math.pi / 3 + np.array([0.01, -0.02, 0.03, 0.0, 0.02, -0.01])
    positions = 10.0 * np.stack([np.cos(angle), np.sin(angle)], -1)
    nearest, left = fly(positions, -positions, 90)
    assert nearest > 1.9
    assert left < 0.5


def test_each_takes_half_of_the_problem():
    (plane,) = half_planes(np.zeros(3), np.array([1.0, 0, 0]), [at(6.0, 0.5, -1.0)], SEPARATION, 0)
    (other,) = half_planes(
        np.array([6.0, 0.5, 0]), np.array([-1.0, 0, 0]), [at(0, 0, 1.0)], SEPARATION, 0
    )
    np.testing.assert_allclose(plane.normal, -other.normal, atol=1e-12)
    np.testing.assert_allclose(
        plane.point - [1.0, 0.0], -(other.point - np.array([-1.0, 0.0])), atol=1e-12
    )
    # Both changes together just leave the velocity obstacle: they touch at the radius.
    relative = plane.point - other.point
    times = np.linspace(0.0, 60.0, 60001)[:, None]
    gap = np.hypot(*(np.array([6.0, 0.5]) - times * relative).T).min()
    np.testing.assert_allclose(gap, 2.0, atol=1e-3)


def test_others_that_are_far_old_high_or_broken_do_not_matter():
    own = np.array([1.0, 0.0, 0.0])
    none = [
        at(6.0, 0.0, z=5.0),
        at(6.0, 0.0, time_ns=-6 * S),
        at(6.0, 0.0, time_ns=2 * S),
        at(math.nan, 0.0),
    ]
    assert half_planes(np.zeros(3), own, none, SEPARATION, 0) == []
    (plane,) = half_planes(np.zeros(3), own, [at(60.0, 0.0)], SEPARATION, 0)
    assert violation([plane], own[None, :2])[0] == 0.0


def test_an_old_report_is_extrapolated_and_widened():
    own = np.array([1.0, 0.0, 0.0])
    old = at(10.0, 0.0, -1.0, time_ns=-2 * S)
    carried = at(8.0, 0.0, -1.0)
    wide = SEPARATION._replace(radius_m=2.0 + 2 * SEPARATION.growth_m_s)
    (a,) = half_planes(np.zeros(3), own, [old], SEPARATION, 0)
    (b,) = half_planes(np.zeros(3), own, [carried], wide, 0)
    np.testing.assert_allclose(a.point, b.point)
    np.testing.assert_allclose(a.normal, b.normal)


def test_those_that_are_too_near_part():
    for other in (at(1.0, 0.0), at(0.0, 0.0)):
        planes = half_planes(np.zeros(3), np.zeros(3), [other], SEPARATION, 0)
        velocity = avoiding_velocity(planes, np.zeros(2), 3.0)
        assert np.hypot(*velocity) > 1.0
        assert velocity @ (np.zeros(2) - other.position[:2]) >= 0.0


@settings(max_examples=60)
@given(
    st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), max_size=4),
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
)
def test_the_velocity_is_the_best_of_a_fine_raster(planes, x, y):
    made = [HalfPlane(np.array([a, b]), np.array([math.cos(c), math.sin(c)])) for a, b, c in planes]
    found = avoiding_velocity(made, np.array([x, y]), 2.0)
    assert np.hypot(*found) <= 2.0 + 1e-6
    side = np.linspace(-2.0, 2.0, 81)
    raster = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    raster = raster[np.hypot(*raster.T) <= 2.0]
    allowed = raster[violation(made, raster) <= 1e-12]
    if len(allowed):
        assert violation(made, found[None])[0] <= 1e-6
        best = np.hypot(*(allowed - [x, y]).T).min()
        assert np.hypot(*(found - [x, y])) <= best + 1e-6
