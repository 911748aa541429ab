"""Alignment of trajectories in space and time, and the trunk map that poses are measured by."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.core import rotations
from volery.report.trunks import TrunkMap, trunks_of_scan
from volery.results.alignment import at_times, ate_rmse_m, common_times, time_shift, umeyama

ANGLES = st.floats(-3.0, 3.0)


def path_of(seconds: float, rate_hz: float = 20.0, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """A path with stops and turns."""
    time_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    random = np.random.default_rng(seed)
    knots = random.uniform(-1.0, 1.0, (int(seconds // 3) + 2, 3)).cumsum(axis=0) * 3.0
    return time_s, at_times(3.0 * np.arange(len(knots)), knots, time_s)


@given(ANGLES, ANGLES, ANGLES)
def test_a_moved_path_is_aligned(roll: float, pitch: float, yaw: float) -> None:
    _, path = path_of(30.0)
    turn = rotations.matrix(rotations.from_rpy(roll, pitch, yaw))
    found = umeyama(path, path @ turn.T + [3.0, -2.0, 1.0])
    np.testing.assert_allclose(found.rotation, turn, atol=1e-9)
    np.testing.assert_allclose(found.translation, [3.0, -2.0, 1.0], atol=1e-8)


def test_a_mirrored_path_is_rotated_and_not_mirrored() -> None:
    _, path = path_of(30.0)
    assert np.linalg.det(umeyama(path, path * [1.0, 1.0, -1.0]).rotation) == pytest.approx(1.0)


def test_what_is_left_is_the_noise() -> None:
    _, path = path_of(200.0)
    noise = np.random.default_rng(1).normal(0.0, 0.2, path.shape)
    turn = rotations.matrix(rotations.from_rpy(0.0, 0.0, 1.0))
    assert ate_rmse_m((path + noise) @ turn.T + 5.0, path) == pytest.approx(0.2 * 3**0.5, rel=0.02)
    assert ate_rmse_m(path + 7.0, path) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("late_s", [-7.3, 0.0, 12.4])
def test_two_logs_of_one_flight_find_their_common_time(late_s: float) -> None:
    time_s, path = path_of(60.0)
    turn = rotations.matrix(rotations.from_rpy(0.0, 0.0, 2.0))
    other_s, other = time_s[100:1000] + late_s, path[100:1000] @ turn.T + 30.0
    found = time_shift(time_s, path, other_s, other)
    assert found.seconds == pytest.approx(-late_s, abs=0.06)
    assert found.alike > 0.9


def test_times_in_common() -> None:
    assert common_times(np.arange(5.0), np.array([1.0, 2.5])).tolist() == [0, 1, 1, 0, 0]
    assert not common_times(np.arange(5.0), np.zeros(0)).any()


def scan_of(trunks: list[tuple[float, float, float]], wall_m: float = 20.0) -> np.ndarray:
    """Ranges of a scanner at the origin that sees circles (x, y, radius) before a round wall."""
    angles = np.radians(np.linspace(-135.0, 135.0, 1081))
    ranges = np.full(1081, wall_m)
    for x, y, r in trunks:
        along = x * np.cos(angles) + y * np.sin(angles)
        aside = np.abs(-x * np.sin(angles) + y * np.cos(angles))
        hit = (aside < r) & (along > 0.0)
        near = along - np.sqrt(np.maximum(r * r - aside**2, 0.0))
        ranges[hit] = np.minimum(ranges[hit], near[hit])
    return ranges


def test_trunks_are_found_where_they_stand() -> None:
    trunks = [(5.0, 1.0, 0.15), (8.0, -4.0, 0.3), (2.0, 3.0, 0.05), (0.0, -6.0, 2.0)]
    found = trunks_of_scan(scan_of(trunks), np.radians(-135.0), np.radians(0.25))
    expected = np.array([t[:2] for t in trunks[:3]])  # the last one is no trunk
    assert len(found) == 3
    away = np.linalg.norm(found[None, :, :2] - expected[:, None], axis=2).min(axis=1)
    assert away.max() < 0.05
    none = trunks_of_scan(np.full(1081, np.inf), np.radians(-135.0), np.radians(0.25))
    assert none.shape == (0, 3)


def test_a_map_from_several_scans() -> None:
    """Sightings within 0.8 m are of one trunk, whatever their heights."""
    trunks = TrunkMap()
    for step in (-0.2, 0.0, 0.2):
        trunks.add(np.array([[10.0 + step, 5.0, 3.0 + step], [20.0, 5.0 + 10.0 * step, 3.0]]))
    assert trunks.sightings.tolist() == [3, 1, 1, 1]
    np.testing.assert_allclose(trunks.seen_often, [[10.0, 5.0, 3.0]], atol=1e-9)


@pytest.mark.parametrize(
    ("poses", "golden"), [(50, 0.1568051246012699), (400, 0.17494651464471914)]
)
def test_the_error_is_that_of_evo(poses: int, golden: float) -> None:
    """Golden figures: `APE(translation_part)` of evo 1.38.1 after `align` without scale."""
    random, found = np.random.default_rng(11), 0.0
    for count in (50, 400):
        t = 0.1 * np.arange(count)
        truth = np.stack([5.0 * np.sin(0.2 * t), 0.5 * t, np.cos(0.1 * t)], axis=1)
        noisy = truth + random.normal(0.0, 0.1, (count, 3))
        turn = rotations.matrix(rotations.from_rpy(0.0, 0.0, 0.7))
        if count == poses:
            found = ate_rmse_m(noisy @ turn.T + [3.0, -2.0, 1.0], truth)
    assert found == pytest.approx(golden, abs=1e-12)
