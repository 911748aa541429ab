"""The filter is as wrong as it says: Monte Carlo over a batch of UAVs with noise of their own."""

import dataclasses

import numpy as np
import pytest
from estimator_truth import FIELD, Motion, Sensors, Straight, drive
from scipy.stats import chi2

from volery.control.estimator import records as r
from volery.control.estimator.alignment import align_at_rest
from volery.control.estimator.estimator import Estimator
from volery.control.estimator.settings import AT_REST, EstimatorSettings, Mounting, StartSigmas
from volery.core import rotations

COUNT = 64
SETTINGS = EstimatorSettings()
ARMS = {"gnss": (-0.1, 0.05, 0.2), "barometer": (0.0, 0.1, 0.05)}
MOUNTING = Mounting(gnss_position_body=ARMS["gnss"], barometer_position_body=ARMS["barometer"])
AIR = StartSigmas(position_m=(1.0, 1.0, 1.0), velocity_m_s=(0.3, 0.3, 0.3), heading_rad=0.05)


def airborne(motion, seed, *, settings=SETTINGS, mounting=MOUNTING, stamp_ns=0):
    """An estimator that starts wrong by as much as `AIR` says."""
    draw = np.random.default_rng(seed)
    position, velocity, attitude = motion.at(0.0)[:3]
    n = motion.count
    turn = rotations.exponential(draw.normal(size=(n, 3)) * [0.02, 0.02, 0.05])
    return Estimator(
        n,
        settings,
        position=position + draw.normal(size=(n, 3)),
        velocity=velocity + 0.3 * draw.normal(size=(n, 3)),
        attitude=rotations.multiply(turn, attitude),
        stamp_ns=stamp_ns,
        mounting=mounting,
        start=AIR,
    )


def errors(estimator, sensors, t):
    """True minus estimated (N, STATES) in the order of the error states."""
    position, velocity, attitude, _, _ = sensors.motion.at(t)
    state = estimator.state
    turn = rotations.multiply(attitude, rotations.conjugate(state.attitude))
    offset = estimator.get_state()["filters"]["offset"]
    return np.hstack(
        [
            position - state.position_map,
            velocity - state.velocity_map,
            rotations.logarithm(turn),
            sensors.true_gyro_bias - state.gyro_bias,
            sensors.true_accel_bias - state.accel_bias,
            (sensors.datum - offset[:, 0])[:, None],
            (sensors.heading_offset.value - offset[:, 1])[:, None],
            sensors.gnss_offset.value - offset[:, 2:],
        ]
    )


def nees(error, P, states):
    """Normalised squared error of some of the states, summed over the batch."""
    part = error[:, states]
    return np.einsum(
        "ni,ni->", part, np.linalg.solve(P[:, states][:, :, states], part[..., None])[..., 0]
    )


GROUPS = {
    "all 15": slice(0, 15),
    "position": slice(0, 3),
    "velocity": slice(3, 6),
    "attitude": slice(6, 9),
    "gyro bias": slice(9, 12),
    "accelerometer bias": slice(12, 15),
    "pressure datum": slice(15, 16),
    "heading offset": slice(16, 17),
    "receiver offset": slice(17, 20),
}


def assert_consistent(estimator, sensors, t):
    """Each group's sum within the central 99.98 % of its chi-square distribution."""
    error, P = errors(estimator, sensors, t), estimator.covariance(np.arange(len(estimator)))
    for name, part in GROUPS.items():
        states = np.arange(r.STATES)[part]
        low, high = chi2.ppf([1e-4, 1 - 1e-4], len(error) * len(states))
        total = nees(error, P, states)
        assert low < total < high, f"{name} at {t} s: {total:.0f} is not in {low:.0f} to {high:.0f}"
    within = np.abs(error) < 3.0 * np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert within.mean() > 0.99  # 0.9973 of a normal distribution, 1280 numbers


@pytest.fixture(scope="module")
def flight():
    """30 s with all aids, 60 s without GNSS, 10 s with all again; seeds 1, 2 and 3."""
    motion = Motion(COUNT, seed=1)
    sensors = Sensors(motion, SETTINGS, seed=2, arms=ARMS)
    estimator = airborne(motion, seed=3)
    seen = {"innovations": [], "sigmas": [], "lengths": []}

    def watch(k, t):
        if k in (10, 100, 1000, 3000) or (k > 6000 and k % 3000 == 0) or k == 20000:
            assert_consistent(estimator, sensors, t)
        if k % 200 == 0:
            P = estimator.covariance(np.arange(COUNT))
            assert (np.linalg.eigvalsh(P[:, :15, :15]) > 0).all()
            seen["sigmas"].append(np.sqrt(np.diagonal(P, axis1=1, axis2=2)).mean(axis=0))
            seen["innovations"].append([estimator.gate(a).innovation.mean() for a in AIDS])
            seen["lengths"].append(np.linalg.norm(estimator.state.attitude, axis=1))

    drive(estimator, sensors, 0, 30, each=watch)
    drive(estimator, sensors, 30, 90, gnss=False, each=watch)
    before = errors(estimator, sensors, 90.0)
    jumps = []

    def watch_return(k, t):
        watch(k, t)
        jumps.append(np.abs(errors(estimator, sensors, t)[:, :2]).max())

    drive(estimator, sensors, 90, 100, each=watch_return)
    return estimator, {name: np.array(v) for name, v in seen.items()}, before, np.array(jumps)


AIDS = [
    r.AidingSource.GNSS_POSITION,
    r.AidingSource.GNSS_VELOCITY,
    r.AidingSource.PRESSURE_HEIGHT,
    r.AidingSource.MAGNETIC_HEADING,
]


def test_errors_are_as_large_as_the_covariance_says(flight):
    """The checks stand in `watch`: at the start, in flight, in the outage and after it."""
    estimator, seen, _, _ = flight
    assert np.abs(seen["lengths"] - 1.0).max() < 1e-12
    assert estimator.dropped.sum() == 0
    assert estimator.restarts.sum() == 0
    for aid in AIDS:
        gate = estimator.gate(aid)
        assert gate.rejected.sum() <= 1e-4 * gate.accepted.sum()


def test_innovations_are_as_large_as_predicted(flight):
    """Means over the batch and 28 s; they are white, so that their spread is known."""
    seen = flight[1]["innovations"][2:30]
    for values, dof in zip(seen.T, (3, 3, 1, 1), strict=True):
        low, high = chi2.ppf([1e-4, 1 - 1e-4], values.size * COUNT * dof) / (values.size * COUNT)
        assert low < values.mean() < high


def test_an_outage_widens_the_covariance_and_is_recovered_from(flight):
    _, seen, before, jumps = flight
    sigma_x = seen["sigmas"][:, 0]
    assert (np.diff(sigma_x[31:90]) > 0).all()  # it grows without bound ...
    assert sigma_x[89] > 10.0
    rms = np.sqrt((before[:, :2] ** 2).mean())
    assert 0.7 < rms / sigma_x[89] < 1.4  # ... with the error
    tilt = seen["sigmas"][:, 6]
    # nothing but the gyroscope holds the tilt: a few mrad after a minute
    assert tilt[29] < tilt[89] < 0.01
    assert (np.diff(jumps) < 1.0).all()  # no jump away from the truth,
    assert jumps[80:].max() < 3.0  # back at once: 0.4 s after the first fix


class Wobbling(Motion):
    """Pitch and yaw swing in quadrature at 6 rad/s: the axis of rotation turns all the while."""

    def __init__(self, count, seed):
        super().__init__(count, seed)
        self.turn = np.tile([[0.2], [0.5], [1.0]], count)
        self.turn_pulse[1:] = 6.0
        self.turn_phase[1] = self.turn_phase[2] + 0.5 * np.pi


def test_aggressive_flight_and_an_outage_of_30_s():
    """The turning axis makes the mean of two rates drift by half a mrad/s, as a bias does not."""
    motion = Wobbling(COUNT, seed=12)
    sensors = Sensors(motion, SETTINGS, seed=13, arms=ARMS)
    estimator = airborne(motion, seed=14)
    drive(estimator, sensors, 0, 8)
    assert_consistent(estimator, sensors, 8.0)
    drive(estimator, sensors, 8, 38, gnss=False)
    assert_consistent(estimator, sensors, 38.0)


class HardLanding(Straight):
    """Sinks at 4 m/s, and stops within 10 ms, with 41 g, at 2 s."""

    AT, LASTS, SPEED = 2.0, 0.01, 4.0

    def at(self, t):
        position, velocity, level, omega, force = super().at(t)
        stopped = np.clip((t - self.AT) / self.LASTS, 0.0, 1.0)
        velocity[:, 2] = -self.SPEED * (1.0 - stopped)
        distance = min(t, self.AT) + self.LASTS * (stopped - 0.5 * stopped**2)
        position[:, 2] = -self.SPEED * distance
        if 0.0 < stopped < 1.0:
            force[:, 2] += self.SPEED / self.LASTS
        return position, velocity, level, omega, force


class Saturated(Sensors):
    """The accelerometer ends at 18 g."""

    FULL_SCALE = 176.52

    def imu(self, t):
        gyro, accel = super().imu(t)
        return gyro, np.clip(accel, -self.FULL_SCALE, self.FULL_SCALE)


def test_a_shock_beyond_full_scale_is_doubted_and_corrected():
    """It hides 3 m/s. A filter that knows the full scale doubts its velocity, and takes fixes."""
    aware = SETTINGS.model_copy(update={"accel_range_m_s2": Saturated.FULL_SCALE})
    ratios, refused = [], []
    for settings in (aware, SETTINGS):
        motion = HardLanding(8, 0.0)
        sensors = Saturated(motion, settings, seed=15)
        estimator = airborne(motion, seed=16, settings=settings, mounting=Mounting())
        drive(estimator, sensors, 0, 2.02)
        variance = estimator.covariance(np.arange(8))[:, r.VELOCITY + 2, r.VELOCITY + 2]
        wrong = np.abs(errors(estimator, sensors, 2.02)[:, r.VELOCITY + 2])
        assert wrong.min() > 2.0
        ratios.append(wrong / np.sqrt(variance))
        drive(estimator, sensors, 2.02, 3.5)
        assert np.abs(errors(estimator, sensors, 3.5)[:, r.VELOCITY + 2]).max() < 0.8
        assert np.isfinite(estimator.covariance(np.arange(8))).all()
        assert estimator.restarts.sum() == 0
        refused.append(estimator.gate(r.AidingSource.GNSS_VELOCITY).rejected.sum())
    assert ratios[0].max() < 5.0 < ratios[1].min()
    assert refused[0] == 0 < refused[1]


def test_lever_arm_of_the_imu():
    """Far from the centre of mass, as consistent as in it."""
    arms = {"imu": (0.3, -0.2, 0.1), **ARMS}
    mounting = dataclasses.replace(MOUNTING, imu_position_body=arms["imu"])
    motion = Motion(COUNT, seed=4)
    sensors = Sensors(motion, SETTINGS, seed=5, arms=arms)
    estimator = airborne(motion, seed=6, mounting=mounting)
    drive(estimator, sensors, 0, 8)
    assert_consistent(estimator, sensors, 8.0)
    blind = airborne(motion, seed=6)
    sensors = Sensors(motion, SETTINGS, seed=5, arms=arms)
    drive(blind, sensors, 0, 8)
    with pytest.raises(AssertionError, match=" s: "):
        assert_consistent(blind, sensors, 8.0)


class AtRest(Straight):
    """On the ground, each with a heading and a tilt of its own."""

    def __init__(self, count, seed):
        super().__init__(count, 0.0)
        draw = np.random.default_rng(seed)
        self.attitude = rotations.from_rpy(*(draw.uniform(-1, 1, (3, count)).T * [0.1, 0.1, 3]).T)

    def at(self, t):
        position, velocity, _, omega, force = super().at(t)
        force = rotations.rotate(rotations.conjugate(self.attitude), force)
        return position, velocity, self.attitude, omega, force


def test_alignment_at_rest_knows_its_errors():
    motion = AtRest(COUNT, seed=7)
    sensors = Sensors(motion, SETTINGS, seed=8)
    force = np.mean([sensors.imu(0.0)[1] for _ in range(200)], axis=0)
    field = np.mean([sensors.magnetic(0.0) for _ in range(100)], axis=0)
    draw = np.random.default_rng(9)
    estimator = Estimator(
        COUNT,
        SETTINGS,
        position=0.5 * draw.normal(size=(COUNT, 3)),
        velocity=0.01 * draw.normal(size=(COUNT, 3)),
        attitude=align_at_rest(force, field, FIELD),
        start=AT_REST,
    )
    assert_consistent(estimator, sensors, 0.0)
    drive(estimator, sensors, 0, 5, gnss=False)
    assert_consistent(estimator, sensors, 5.0)


def test_delay_leaves_no_lag():
    """At 10 m/s a receiver 120 ms late: fused as if fresh, it drags the estimate 1.2 m behind."""
    settings = EstimatorSettings(gnss_offset_sigma_m=(0.0, 0.0, 0.0))
    motion = Straight(COUNT, 10.0)

    def lag(own, stamp_shift):
        sensors = Sensors(motion, settings, seed=10)
        estimator = airborne(motion, seed=11, settings=own, mounting=Mounting())
        if stamp_shift:
            late = estimator.fuse_gnss
            estimator.fuse_gnss = lambda rows, stamp, *fix: late(rows, stamp + stamp_shift, *fix)
        drive(estimator, sensors, 0, 10)
        return -errors(estimator, sensors, 10.0)[:, 0].mean()

    naive = settings.model_copy(update={"horizon_s": 0.0})
    assert abs(lag(settings, 0)) < 0.05
    assert lag(naive, 120_000_000) == pytest.approx(-1.2, abs=0.1)


def test_gates_refuse_good_measurements_as_rarely_as_five_sigma():
    alarm = chi2.sf(25.0, 1)
    assert SETTINGS.gate_1 == 25.0
    assert chi2.sf(SETTINGS.gate_3, 3) == pytest.approx(alarm, rel=0.2)
