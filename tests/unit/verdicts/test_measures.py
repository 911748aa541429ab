"""Nearest obstacles, nearest pairs and areas of flights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_runs import Posts, flight_of, line

from volery.verdicts.measures import MAX_CLEARANCE_M, area_m2, nearest_obstacle, nearest_pair


@given(seed=st.integers(0, 10_000))
def test_the_nearest_obstacle_is_that_of_all_samples(seed):
    rng = np.random.default_rng(seed)
    steps = rng.normal(0.0, rng.choice([0.05, 0.5, 5.0]), (3, 60, 3))
    flight = flight_of(np.cumsum(steps, axis=1))
    scene = Posts(rng.uniform(-20.0, 20.0, (rng.integers(1, 6), 2)))
    radius = rng.uniform(0.1, 0.5, 3)
    found = nearest_obstacle(flight, scene, radius_m=radius)
    distance = np.array([scene.clearance(p, 1e9, False).distance for p in flight.position_map])
    gaps = np.minimum(distance, MAX_CLEARANCE_M) - radius[:, None]
    assert found.distance_m == pytest.approx(gaps.min())
    assert gaps[found.uav, found.sample] == pytest.approx(gaps.min())


def test_samples_that_cannot_be_nearer_are_not_asked():
    flight = flight_of([line([0.0, 0.0, 2.0], [100.0, 0.0, 2.0], 2001)])
    scene = Posts([[50.0, 3.0]])
    found = nearest_obstacle(flight, scene)
    assert found.distance_m == pytest.approx(3.0)
    assert found.sample == 1000
    assert scene.asked < 1000


def test_uavs_that_do_not_exist_are_left_out():
    path = line([0.0, 0.0, 2.0], [10.0, 0.0, 2.0], 11)
    path[:5] = np.nan
    flight = flight_of([path])
    assert nearest_obstacle(flight, Posts([[0.0, 0.0]])).sample == 5
    assert nearest_obstacle(flight_of([path * np.nan]), Posts([])).uav == -1


def test_the_nearest_pair_counts_radii_and_chosen_uavs():
    still = np.tile([[0.0, 0.0, 0.0]], (5, 1))
    beside = still + np.array([3.0, 0.0, 0.0])
    flight = flight_of([still, beside, line([9.0, 0.0, 0.0], [5.0, 0.0, 0.0], 5)])
    pair = nearest_pair(flight)
    assert (pair.uavs, pair.distance_m, pair.sample) == ((1, 2), 2.0, 4)
    first = nearest_pair(flight, rows=np.array([0]), radius_m=np.array([0.5, 0.25, 0.0]))
    assert (first.uavs, first.distance_m) == ((0, 1), 2.25)
    last = nearest_pair(flight, rows=np.array([2]))
    assert (last.uavs, last.distance_m) == ((1, 2), 2.0)
    early = nearest_pair(flight, samples=np.array([0, 1]))
    assert (early.uavs, early.distance_m) == ((0, 1), 3.0)
    assert np.isinf(nearest_pair(flight_of([still])).distance_m)


def test_the_area_of_a_line():
    path = np.array([line([0.0, 0.0, 5.0], [100.0, 0.0, 5.0], 11)])
    assert area_m2(path, 2.0) == pytest.approx(
        100.0 * 4.0 + np.pi * 4.0, rel=0.15
    )  # in cells of 0.5 m
