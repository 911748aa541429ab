"""The estimator as its users see it: order of arrival, resets, gates, aids, errors."""

import numpy as np
import pytest

from volery.control.estimator.alignment import align_at_rest
from volery.control.estimator.errors import (
    estimation_error,
    pose_covariance,
    twist_covariance,
)
from volery.control.estimator.estimator import Estimate, Estimator
from volery.control.estimator.records import AidingSource
from volery.control.estimator.settings import EstimatorSettings, Mounting, StartSigmas
from volery.core import rotations
from volery.core.errors import EstimatorError

G = 9.80665
SETTINGS = EstimatorSettings()
UP = np.array([0.0, 0.0, G])
FIELD = np.array(EstimatorSettings().magnetic_field_map)
STEP = 5_000_000
FIX_VARIANCE = np.array([0.1, 0.1, 0.2, 0.04, 0.04, 0.1])


def still(count, settings=SETTINGS, **options):
    """An estimator that starts at the origin, unless `options` say otherwise."""
    given = {
        "position": np.zeros((count, 3)),
        "velocity": np.zeros((count, 3)),
        "attitude": np.tile(rotations.IDENTITY, (count, 1)),
        **options,
    }
    return Estimator(count, settings, **given)


def hover(estimator, rows, first, last, seed=0, *, gnss=True, offset=(0.0, 0.0, 0.0)):
    """Steps first..last of a hovering flight with noise that depends on row and step alone."""
    for k in range(first, last + 1):
        draw = np.random.default_rng([seed, k]).normal(size=(8, 12))[rows]
        estimator.fuse_magnetic(rows, k * STEP, FIELD + 4e-7 * draw[:, :3], 1.6e-13)
        if gnss and k % 40 == 24:
            fix = np.asarray(offset) + 0.3 * draw[:, 3:6]
            estimator.fuse_gnss(rows, (k - 24) * STEP, fix, 0.2 * draw[:, 6:9], FIX_VARIANCE)
        force = [0, 0, G] + 0.05 * draw[:, 9:]
        estimator.predict(rows, k * STEP, 0.005 * draw[:, 6:9], force)


def bytes_of(estimator, row):
    return [part[row].tobytes() for part in estimator.get_state().values()]


def test_a_reset_uav_is_a_new_one_and_its_neighbours_do_not_notice():
    used, fresh = still(3), still(3)
    hover(used, np.arange(3), 0, 300)
    hover(fresh, np.array([0, 2]), 0, 300)
    start = {
        "position": [[1.0, 2.0, 3.0]],
        "velocity": [[0.1, 0.0, 0.0]],
        "attitude": rotations.from_rpy([0.1], [0.0], [1.0]),
        "stamp_ns": 301 * STEP,
    }
    used.reset([1], **start)
    born_later = Estimator(
        3,
        EstimatorSettings(),
        **{k: np.repeat(v, 3, 0) for k, v in start.items() if k != "stamp_ns"},
        stamp_ns=301 * STEP,
    )
    assert bytes_of(used, 1) == bytes_of(born_later, 1)
    for estimator in (used, born_later):
        hover(estimator, np.array([1]), 301, 500, seed=1)
    hover(used, np.array([0, 2]), 301, 500)
    hover(fresh, np.array([0, 2]), 301, 500)
    assert bytes_of(used, 1) == bytes_of(born_later, 1)
    for row in (0, 2):
        assert bytes_of(used, row) == bytes_of(fresh, row)


def test_a_kept_state_is_gone_back_to_exactly():
    estimator = still(2)
    rows = np.arange(2)
    hover(estimator, rows, 0, 130)  # a fix and some fields wait in the queue
    kept = estimator.get_state()
    hover(estimator, rows, 131, 200)
    first = [bytes_of(estimator, i) for i in rows]
    other = still(2, position=np.ones((2, 3)))
    other.set_state(kept)
    hover(other, rows, 131, 200)
    assert first == [bytes_of(other, i) for i in rows]


def test_order_of_arrival_does_not_matter():
    """A fix that comes 100 ms late is fused at its own time."""
    prompt, tardy = still(1), still(1)
    for k in range(200):
        for estimator, delay in ((prompt, 0), (tardy, 20)):
            if (k - delay) % 40 == 0 and k >= delay:
                moment = (k - delay) * STEP
                fix = np.array([[0.5, 0.1 * (k - delay), -0.2]])
                estimator.fuse_gnss([0], moment, fix, np.zeros((1, 3)), FIX_VARIANCE)
            estimator.fuse_pressure_height([0], k * STEP, [0.1], 0.01)
            estimator.predict([0], k * STEP, np.zeros((1, 3)), [[0.1, 0, G]])
    a, b = (e.get_state()["filters"][0] for e in (prompt, tardy))
    for name in ("position_map", "attitude", "covariance", "offset", "accepted"):
        assert np.array_equal(a[name], b[name])


def test_present_and_horizon_agree_where_nothing_is_fused():
    """The present of a filter with a horizon is the state of one without."""
    draw = np.random.default_rng(2)
    lagging = still(1)
    prompt = still(1, settings=EstimatorSettings(horizon_s=0.0))
    for k in range(100):
        reading = draw.normal(size=(1, 3)), draw.normal(size=(1, 3)) + UP
        for estimator in (lagging, prompt):
            estimator.predict([0], k * STEP, *reading)
    for name in Estimate._fields[:4]:
        np.testing.assert_allclose(
            getattr(lagging.state, name), getattr(prompt.state, name), atol=1e-9
        )
    np.testing.assert_allclose(
        lagging.covariance([0]), prompt.covariance([0]), rtol=2e-3, atol=1e-6
    )


def test_late_and_absent_measurements():
    estimator = still(2)
    rows = np.arange(2)
    hover(estimator, rows, 0, 100, gnss=False)
    fix = np.zeros((2, 3))
    estimator.fuse_gnss(rows, 10 * STEP, fix, fix, FIX_VARIANCE)
    assert estimator.dropped.tolist() == [1, 1]
    estimator.fuse_gnss(rows, 90 * STEP, fix, fix, FIX_VARIANCE, valid=[True, False])
    estimator.fuse_gnss(rows, 91 * STEP, fix + np.array([[0], [np.nan]]), fix, FIX_VARIANCE)
    estimator.fuse_range(rows, 92 * STEP, [np.inf, 1.0], 0.01, -1.0)
    estimator.fuse_pressure_height(rows, 92 * STEP, [0.0, 0.0], np.array([np.inf, np.nan]))
    hover(estimator, rows, 101, 140, gnss=False)
    assert estimator.gate(AidingSource.PRESSURE_HEIGHT).accepted.tolist() == [0, 0]
    assert np.isfinite(estimator.covariance(rows)).all()
    assert estimator.gate(AidingSource.GNSS_POSITION).accepted.tolist() == [2, 0]
    assert estimator.gate(AidingSource.RANGE_TO_GROUND).accepted.tolist() == [0, 1]
    assert np.isfinite(estimator.state.position_map).all()


def test_an_outlier_is_rejected_and_a_lasting_one_believed():
    estimator = still(1)
    rows = np.array([0])
    hover(estimator, rows, 0, 800)
    before = estimator.state.position_map.copy()
    hover(estimator, rows, 801, 2000, offset=(30.0, 0.0, 0.0))
    gate = estimator.gate(AidingSource.GNSS_POSITION)
    assert gate.rejected[0] == 30
    assert gate.innovation[0] > 32
    np.testing.assert_allclose(estimator.state.position_map, before, atol=2.0)
    assert estimator.restarts[0] == 0
    hover(estimator, rows, 2001, 3000, offset=(30.0, 0.0, 0.0))  # 7 s are over
    assert estimator.restarts[0] == 1
    assert abs(estimator.state.position_map[0, 0] - 30.0) < 2.0
    assert gate.rejected[0] < 45


def test_a_slam_pose_replaces_gnss():
    estimator = still(1)
    rows = np.array([0])
    pose = rotations.from_rpy(0.01, -0.02, 0.3)
    true = np.array([[1.0, -2.0, 0.5]])
    loose = StartSigmas(position_m=(3.0, 3.0, 3.0), heading_rad=0.5)
    estimator.reset(
        rows,
        position=[[0, 0, 0]],
        velocity=[[0, 0, 0]],
        attitude=[rotations.IDENTITY],
        stamp_ns=0,
        start=loose,
    )
    force = rotations.rotate(rotations.conjugate(pose), [[0, 0, G]])
    for k in range(400):
        if k % 10 == 0:
            estimator.fuse_pose(rows, k * STEP, true, pose[None], [0.01] * 3 + [1e-4] * 3)
        estimator.predict(rows, k * STEP, np.zeros((1, 3)), force)
    np.testing.assert_allclose(estimator.state.position_map, true, atol=0.05)
    turn = rotations.multiply(estimator.state.attitude[0], rotations.conjugate(pose))
    assert np.linalg.norm(rotations.logarithm(turn)) < 0.01
    assert estimator.covariance(rows)[0, 2, 2] < 0.01


def hover_by_poses(estimator, first, last, *, position=(0.0, 0.0, 0.0), yaw=0.0):
    attitude = rotations.from_rpy([0.0], [0.0], [yaw])
    variances = [2.5e-3] * 3 + [3e-4] * 3
    for k in range(first, last + 1):
        if k % 20 == 0:
            estimator.fuse_pose([0], k * STEP, [position], attitude, variances)
        estimator.predict([0], k * STEP, np.zeros((1, 3)), UP[None])


def test_a_slam_that_found_itself_elsewhere_is_believed_when_it_insists():
    estimator, position, yaw = still(1, velocity=[[0.5, 0.0, 0.0]]), (4.0, -3.0, 0.0), 0.6
    hover_by_poses(estimator, 0, 1, position=(0.0, 0.0, 0.0))
    hover_by_poses(estimator, 2, 200, position=position, yaw=yaw)  # not for a second yet
    gate = estimator.gate(AidingSource.POSE_POSITION)
    assert gate.rejected[0] == 8
    assert np.linalg.norm(estimator.state.position_map[0]) < 0.6
    hover_by_poses(estimator, 201, 275, position=position, yaw=yaw)
    assert estimator.restarts[0] == 1
    assert gate.rejected[0] == 12
    np.testing.assert_allclose(estimator.state.position_map[0], position, atol=0.2)
    assert rotations.yaw_of(estimator.state.attitude[0]) == pytest.approx(yaw, abs=0.02)
    course = [0.5 * np.cos(yaw), 0.5 * np.sin(yaw), 0.0]
    np.testing.assert_allclose(estimator.state.velocity_map[0], course, atol=0.15)
    assert np.linalg.eigvalsh(estimator.covariance([0])[0]).min() > 0.0


def test_standing_still_and_ranges_hold_a_uav_without_gnss():
    estimator = still(1, position=[[0.0, 0.0, 0.4]])
    for k in range(2000):
        if k % 20 == 0:
            estimator.fuse_range([0], k * STEP, [1.0], 1e-4, 0.0)
            estimator.fuse_velocity([0], k * STEP, np.zeros((1, 3)), [1e-4] * 3)
        estimator.predict([0], k * STEP, [[0.002, -0.001, 0.003]], [[0.1, 0, G + 0.1]])
    np.testing.assert_allclose(estimator.state.velocity_map, 0.0, atol=0.01)
    assert estimator.state.position_map[0, 2] == pytest.approx(1.0, abs=0.02)
    assert estimator.state.accel_bias[0, 2] == pytest.approx(0.1, abs=0.01)
    np.testing.assert_allclose(estimator.state.gyro_bias[0, :2], [0.002, -0.001], atol=3e-4)


def test_a_range_of_a_box_below_is_not_the_ground():
    estimator = still(1, position=[[0.0, 0.0, 3.0]])
    for k in range(200):
        if k % 20 == 0:
            box = 100 <= k < 140
            estimator.fuse_range([0], k * STEP, [2.0 if box else 3.0], 1e-4, 0.0)
        estimator.predict([0], k * STEP, np.zeros((1, 3)), [[0, 0, G]])
    assert estimator.gate(AidingSource.RANGE_TO_GROUND).rejected[0] == 2
    assert estimator.state.position_map[0, 2] == pytest.approx(3.0, abs=0.05)


def test_sensors_may_be_turned_in_the_body():
    mount = rotations.from_rpy(0.2, -0.4, 2.0)
    turned = still(1, mounting=Mounting(imu_attitude_body=tuple(mount)))
    straight = still(1)
    draw = np.random.default_rng(3)
    for k in range(50):
        gyro, accel = draw.normal(size=(1, 3)), draw.normal(size=(1, 3)) + UP
        straight.predict([0], k * STEP, gyro, accel)
        back = rotations.conjugate(mount)
        turned.predict([0], k * STEP, rotations.rotate(back, gyro), rotations.rotate(back, accel))
    np.testing.assert_allclose(turned.state.position_map, straight.state.position_map, atol=1e-9)


def test_alignment_finds_the_attitude_of_perfect_readings():
    attitude = rotations.from_rpy([0.2, -0.3, 0.0], [0.1, 0.2, -0.4], [3.0, -1.0, 0.5])
    back = rotations.conjugate(attitude)
    found = align_at_rest(rotations.rotate(back, [0, 0, G]), rotations.rotate(back, FIELD), FIELD)
    turn = rotations.logarithm(rotations.multiply(found, back))
    np.testing.assert_allclose(turn, 0.0, atol=1e-12)


def test_estimation_error_gives_the_estimate_back():
    draw = np.random.default_rng(4)

    def some():
        q = rotations.normalize(draw.normal(size=(5, 4)))
        return Estimate(*draw.normal(size=(2, 5, 3)), q, *draw.normal(size=(3, 5, 3)))

    truth, estimate = some(), some()
    error = estimation_error(estimate, truth)
    np.testing.assert_allclose(truth.position_map + error.position_map, estimate.position_map)
    np.testing.assert_allclose(truth.velocity_map + error.velocity_map, estimate.velocity_map)
    np.testing.assert_allclose(truth.omega_body + error.omega_body, estimate.omega_body)
    same = rotations.multiply(error.rotation_map, truth.attitude)
    np.testing.assert_allclose(np.abs((same * estimate.attitude).sum(axis=1)), 1.0)
    assert (error.rotation_map[:, 3] >= 0).all()


def test_odometry_covariances_are_those_of_drawn_errors():
    """Errors drawn from the covariance, put into pose and twist."""
    estimator = still(1, velocity=[[3.0, -2.0, 1.0]], attitude=[rotations.from_rpy(0.1, 0.2, 1.0)])
    P = estimator.covariance([0]) * 1e-4
    draw = np.random.default_rng(5).multivariate_normal(np.zeros(20), P[0], 100_000)
    state = estimator.state
    turned = rotations.multiply(rotations.exponential(draw[:, 6:9]), state.attitude)
    velocity = rotations.rotate(rotations.conjugate(turned), state.velocity_map + draw[:, 3:6])
    twist = np.hstack([velocity, -draw[:, 9:12]])
    wanted = np.cov(twist.T)
    got = twist_covariance(P, state.velocity_map, state.attitude, 0.0)[0]
    np.testing.assert_allclose(got, wanted, atol=0.03 * wanted.max())
    with_noise = twist_covariance(P, state.velocity_map, state.attitude, 1e-3)[0]
    np.testing.assert_allclose(np.diag(with_noise - got), [0, 0, 0, 1e-3, 1e-3, 1e-3], atol=1e-15)
    pose = pose_covariance(P)[0]
    np.testing.assert_allclose(np.diag(pose), np.diag(P[0])[[0, 1, 2, 6, 7, 8]])
    np.testing.assert_allclose(pose[0, 4], P[0, 0, 7])


def test_misuse_is_an_error():
    estimator = still(2)
    estimator.predict([0], 5, np.zeros((1, 3)), np.zeros((1, 3)))
    with pytest.raises(EstimatorError, match="row 0 at 5 ns is not later"):
        estimator.predict([0], 5, np.zeros((1, 3)), np.zeros((1, 3)))
    with pytest.raises(EstimatorError, match="rows"):
        estimator.predict([2], 6, np.zeros((1, 3)), np.zeros((1, 3)))
    with pytest.raises(EstimatorError, match="shape"):
        estimator.predict([0, 1], 6, np.zeros((1, 3)), np.zeros((1, 3)))
    with pytest.raises(EstimatorError, match="unit quaternions"):
        still(1, attitude=np.zeros((1, 4)))
    with pytest.raises(EstimatorError, match="settings"):
        Estimator(
            2,
            [EstimatorSettings()],
            position=np.zeros((2, 3)),
            velocity=np.zeros((2, 3)),
            attitude=np.tile(rotations.IDENTITY, (2, 1)),
        )
