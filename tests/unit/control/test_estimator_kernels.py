"""Parts of the filter against numerical derivatives and dense matrices."""

import numpy as np
import pytest

from volery.control.estimator import records as r
from volery.control.estimator.covariance_kernels import (
    carry,
    correct,
    decay,
    forget_position,
    normalised_innovation,
    transform,
    turn_errors,
)
from volery.control.estimator.filter_kernels import take_over
from volery.control.estimator.measurement_kernels import linearise
from volery.control.estimator.motion_kernels import flow_on, motion_at_horizon, travelled
from volery.control.estimator.settings import EstimatorSettings, Mounting
from volery.core import rotations
from volery.vehicle.compiled import fused_kernel
from volery.vehicle.rotation_math import three

N = r.STATES
MOUNTING = Mounting(
    imu_position_body=(0.1, -0.2, 0.05),
    gnss_position_body=(-0.3, 0.1, 0.4),
    barometer_position_body=(0.2, 0.3, -0.1),
    magnetometer_attitude_body=tuple(rotations.from_rpy(0.3, -0.2, 1.0)),
    range_position_body=(0.1, 0.1, -0.2),
)


@fused_kernel
def _linearise(filters, tunings, measured, part, works):
    return linearise(filters[0], tunings[0], measured[0], part, works[0])


@fused_kernel
def _take_over(filters, works):
    take_over(filters[0], works[0].error)


@fused_kernel
def _fly(filters, readings, works):
    state = filters[0]
    gyro, accel = three(state.gyro_bias), three(state.accel_bias)
    motion = motion_at_horizon(state)
    before = state.reading
    for i in range(len(readings)):
        after = travelled(motion, before, readings[i], gyro, accel)
        flow_on(works[0].flow, (readings[i].stamp_ns - before.stamp_ns) * 1e-9, motion, after)
        motion = after
        before = readings[i]
    return motion


@fused_kernel
def _transform(P, works):
    transform(P, works[0].flow)


@fused_kernel
def _carry(P, tunings, works):
    decay(tunings[0], works[0].flow.duration, works[0].keep)
    carry(P, works[0].flow, tunings[0], works[0].keep)


@fused_kernel
def _correct(P, rows, works):
    ratio = normalised_innovation(P, rows, works[0])
    correct(P, rows, works[0])
    return ratio


@fused_kernel
def _turn_errors(P, x, y, z):
    turn_errors(P, x, y, z)


@fused_kernel
def _forget_position(P, variance):
    forget_position(P, variance)


def some_filter(draw, rpy=(0.15, -0.12, 2.0)):
    state = np.zeros(1, r.FILTER)
    state["position"] = draw.normal(size=3) * 10
    state["velocity"] = draw.normal(size=3) * 5
    state["rotation"] = rotations.from_rpy(*rpy)
    state["gyro_bias"] = draw.normal(size=3) * 0.01
    state["accel_bias"] = draw.normal(size=3) * 0.2
    state["offset"] = draw.normal(size=r.OFFSETS) * 0.1
    state["reading"]["gyro"] = draw.normal(size=3)
    state["reading"]["accel"] = draw.normal(size=3) + np.array([0, 0, 9.8])
    return state


def moved(state, error):
    work = np.zeros(1, r.WORK)
    work["error"] = error
    other = state.copy()
    _take_over(other, work)
    return other


def some_covariance(draw):
    root = draw.normal(size=(N, N)) * draw.uniform(0.01, 2.0, N)[:, None]
    return root @ root.T


def measurement(kind, state, draw):
    m = np.zeros(1, r.MEASUREMENT)
    m["kind"], m["stamp_ns"], m["variance"] = kind, -3_000_000, 0.04
    m["value"] = draw.normal(size=7)
    if kind == r.MAGNETIC:
        # near the true field, where the derivative is taken
        body = rotations.rotate(
            rotations.conjugate(state["rotation"][0]), EstimatorSettings().magnetic_field_map
        )
        mount = rotations.conjugate(MOUNTING.magnetometer_attitude_body)
        m["value"][0, :3] = rotations.rotate(mount, body)
        m["stamp_ns"] = 0
    if kind == r.POSE:
        q = rotations.multiply(rotations.exponential([0.01, 0.02, -0.01]), state["rotation"][0])
        m["value"][0, 3:] = -q  # the other sign is the same attitude
        m["stamp_ns"] = 0
    return m


@pytest.mark.parametrize(
    ("kind", "part", "rows"),
    [
        (r.GNSS, 0, 3),
        (r.GNSS, 1, 3),
        (r.PRESSURE, 0, 1),
        (r.MAGNETIC, 0, 1),
        (r.RANGE, 0, 1),
        (r.POSE, 0, 3),
        (r.POSE, 1, 3),
        (r.STATED_VELOCITY, 0, 3),
    ],
)
def test_measurement_jacobians_are_the_numerical_ones(kind, part, rows):
    draw = np.random.default_rng(5)
    state = some_filter(draw)
    tuning = r.tuning_of(EstimatorSettings(), MOUNTING)
    measured, work = measurement(kind, state, draw), np.zeros(1, r.WORK)

    def residual(error):
        assert _linearise(moved(state, error), tuning, measured, part, work) == rows
        return work["residual"][0, :rows].copy()

    residual(np.zeros(N))
    H = work["H"][0, :rows].copy()
    assert np.abs(H).sum(axis=1).min() > 0.5
    h = 1e-6
    for k in range(N):
        if part == 1 and r.GYRO_BIAS <= k < r.ACCEL_BIAS:
            continue  # left out on purpose; see the kernel
        if kind == r.STATED_VELOCITY and r.GYRO_BIAS <= k < r.ACCEL_BIAS:
            continue
        step = np.eye(N)[k] * h
        slope = (residual(step) - residual(-step)) / (2 * h)
        # the residual of an attitude 0.02 rad off turns a little with the attitude
        np.testing.assert_allclose(
            -slope, H[:, k], atol=0.02 if (kind, part) == (r.POSE, 1) else 1e-6
        )


def test_missing_and_useless_measurements_have_no_rows():
    draw = np.random.default_rng(6)
    state, work = some_filter(draw), np.zeros(1, r.WORK)
    tuning = r.tuning_of(EstimatorSettings(), MOUNTING)
    fix = measurement(r.GNSS, state, draw)
    fix["variance"][0, 4] = np.inf
    assert _linearise(state, tuning, fix, 0, work) == 3
    assert _linearise(state, tuning, fix, 1, work) == 0
    compass = measurement(r.MAGNETIC, state, draw)
    compass["value"] *= 1.4
    assert _linearise(state, tuning, compass, 0, work) == 0
    steep = some_filter(draw, rpy=(0.6, 0.0, 0.0))
    assert _linearise(steep, tuning, measurement(r.RANGE, steep, draw), 0, work) == 0


def readings(draw, count=26):
    out = np.zeros(count, r.READING)
    out["stamp_ns"] = 5_000_000 * (1 + np.arange(count))
    t = out["stamp_ns"][:, None] * 1e-9
    out["gyro"] = np.sin(20 * t + draw.normal(size=3)) * [2.0, 1.5, 3.0]
    out["accel"] = [0, 0, 9.8] + 4 * np.sin(15 * t + draw.normal(size=3))
    return out


def test_error_transition_is_the_numerical_one():
    draw = np.random.default_rng(7)
    state, path = some_filter(draw), readings(draw)
    work = np.zeros(1, r.WORK)
    p, v, q, _ = map(np.array, _fly(state, path, work))
    phi = np.eye(N).ravel()
    _transform(phi, work)
    phi = phi.reshape(N, N)
    assert work["flow"]["duration"][0] == pytest.approx(0.13)
    h = 1e-6
    for k in range(15):
        other = moved(state, np.eye(N)[k] * h)
        p2, v2, q2, _ = map(np.array, _fly(other, path, np.zeros(1, r.WORK)))
        turn = rotations.logarithm(rotations.multiply(q2, rotations.conjugate(q)))
        slope = np.concatenate([p2 - p, v2 - v, turn]) / h
        np.testing.assert_allclose(slope, phi[:9, k], rtol=2e-3, atol=2e-5)


def test_motion_is_the_closed_form_of_a_steady_turn():
    """Constant rate about z and constant force in the body: a circle."""
    state, path = some_filter(np.random.default_rng(1), rpy=(0, 0, 0)), np.zeros(100, r.READING)
    rate, force = 2.0, np.array([3.0, 0.0, 9.80665])
    for name in ("position", "velocity", "gyro_bias", "accel_bias"):
        state[name] = 0
    path["stamp_ns"] = 5_000_000 * (1 + np.arange(100))
    for record in (path, state["reading"]):
        record["gyro"], record["accel"] = [0, 0, rate], force
    p, v, q, _ = map(np.array, _fly(state, path, np.zeros(1, r.WORK)))
    t = 0.5
    np.testing.assert_allclose(
        v, [3 / rate * np.sin(rate * t), 3 / rate * (1 - np.cos(rate * t)), 0], atol=3e-5
    )
    np.testing.assert_allclose(
        p,
        [3 / rate**2 * (1 - np.cos(rate * t)), 3 / rate * (t - np.sin(rate * t) / rate), 0],
        atol=3e-5,
    )
    np.testing.assert_allclose(q, rotations.from_rpy(0, 0, rate * t), atol=1e-12)


def test_carried_covariance_is_the_dense_product():
    draw = np.random.default_rng(8)
    settings = EstimatorSettings()
    tuning, work = r.tuning_of(settings, MOUNTING), np.zeros(1, r.WORK)
    _fly(some_filter(draw), readings(draw), work)
    phi = np.eye(N).ravel()
    _transform(phi, work)
    phi = phi.reshape(N, N)
    start = some_covariance(draw)
    P = start.ravel().copy()
    _carry(P, tuning, work)
    P = P.reshape(N, N)
    t = 0.13
    rate = np.zeros(N)
    rate[16], rate[17:] = 1 / 600, 1 / 60
    keep = np.exp(-rate * t)
    noise = np.zeros((N, N))
    accel = settings.accel_noise_density_m_s2_sqrt_hz**2
    i = np.arange(3)
    noise[i, i], noise[i + 3, i + 3] = accel * t**3 / 3, accel * t
    noise[i, i + 3] = noise[i + 3, i] = accel * t**2 / 2
    noise[i + 6, i + 6] = settings.gyro_noise_density_rad_s_sqrt_hz**2 * t
    noise[i + 9, i + 9], noise[i + 12, i + 12] = 3.879e-5**2 * t, 0.006**2 * t
    noise[15, 15] = 0.05**2 * t
    noise[16, 16] = 0.02**2 * (1 - keep[16] ** 2)
    noise[i + 17, i + 17] = np.square([0.5, 0.5, 0.8]) * (1 - keep[17] ** 2)
    wanted = keep[:, None] * (phi @ start @ phi.T) * keep + noise
    np.testing.assert_allclose(P, wanted, rtol=1e-9, atol=1e-12)
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_correction_is_the_dense_joseph_form(rows):
    draw = np.random.default_rng(9)
    start = some_covariance(draw)
    work = np.zeros(1, r.WORK)
    H = draw.normal(size=(3, N)) * (draw.uniform(size=(3, N)) < 0.4)
    residual, variance = draw.normal(size=3), draw.uniform(0.1, 1.0, 3)
    work["H"], work["residual"], work["variance"] = H, residual, variance
    P = start.ravel().copy()
    ratio = _correct(P, rows, work)
    H, residual, R = H[:rows], residual[:rows], np.diag(variance[:rows])
    S = H @ start @ H.T + R
    K = np.linalg.solve(S, H @ start).T
    rest = np.eye(N) - K @ H
    np.testing.assert_allclose(
        P.reshape(N, N), rest @ start @ rest.T + K @ R @ K.T, rtol=1e-8, atol=1e-9
    )
    np.testing.assert_allclose(work["error"][0], K @ residual, atol=1e-9)
    assert ratio == pytest.approx(residual @ np.linalg.solve(S, residual))
    assert np.array_equal(P.reshape(N, N), P.reshape(N, N).T)


def test_taking_over_a_turn_turns_the_remaining_error():
    """The error left after a correction d: log(exp(d + e) exp(-d)), differentiated by e."""
    d, h = np.array([0.005, -0.008, 0.01]), 1e-6
    slope = np.zeros((3, 3))
    undo = rotations.exponential(-d)
    for k in range(3):
        e = np.eye(3)[k] * h
        slope[:, k] = (
            rotations.logarithm(rotations.multiply(rotations.exponential(d + e), undo)) / h
        )
    start = some_covariance(np.random.default_rng(10))
    G = np.eye(N)
    G[6:9, 6:9] = slope
    P = start.ravel().copy()
    _turn_errors(P, *d)
    np.testing.assert_allclose(P.reshape(N, N), G @ start @ G.T, rtol=1e-3, atol=1e-3)
    assert np.abs(start - G @ start @ G.T).max() > 0.01  # which would be wrong


def test_a_restarted_position_is_as_wrong_as_the_receiver():
    start = some_covariance(np.random.default_rng(11))
    P, variance = start.ravel().copy(), np.array([1.0, 2, 3, 4, 5, 6])
    _forget_position(P, variance)
    A = np.eye(N)
    A[:6] = 0
    A[range(3), range(17, 20)] = -1
    noise = np.zeros((N, N))
    noise[range(6), range(6)] = variance
    np.testing.assert_allclose(P.reshape(N, N), A @ start @ A.T + noise, atol=1e-12)
