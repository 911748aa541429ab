"""The IMU's noise as its data sheet would show it: Allan variance over averaging times.

IEEE Std 952: white noise of density N has Allan variance N^2 / tau, a random walk K K^2 tau / 3.
A Gauss-Markov bias looks like a random walk as long as tau is short against its correlation time.
"""

import math

import numpy as np
import pytest

from volery.control.fleet import Fleet
from volery.core.clock import Schedule
from volery.sensors.bank import SensorGroup
from volery.sensors.imu import ImuBank, ImuModel
from volery.sensors.mount import make_mount
from volery.sensors.samples import SensorId
from volery.vehicle.airframe import load_airframe

RATE_HZ, SECONDS, SENSORS = 50.0, 400, 100


def fleet():
    return Fleet([load_airframe("f450")], [[0.0, 0.0, 1.0]], [[0.0, 0.0, 0.0, 1.0]])


def bank_of(model, count, rate_hz=RATE_HZ):
    sensors = tuple(SensorId(0, f"u{i}", "imu") for i in range(count))
    keys = np.arange(count, dtype=np.uint64) + np.uint64(7)
    mounts = (make_mount(),) * count
    return ImuBank(model, SensorGroup(Schedule.from_hz(rate_hz), sensors, mounts, keys))


@pytest.fixture(scope="module")
def second_means():
    """Means over each second, (seconds, sensors, 6), of IMUs that rest."""
    bank, still, per_second = bank_of(ImuModel.load("adis16448"), SENSORS), fleet(), int(RATE_HZ)
    means = np.zeros((SECONDS, SENSORS, 6))
    for k in range(SECONDS * per_second):
        reading = bank.sample(k, 0, still)
        means[k // per_second, :, :3] += reading.angular_velocity
        means[k // per_second, :, 3:] += reading.specific_force
    return means / per_second


def allan_variance(second_means, tau):
    """Allan variance of each axis (6,) at tau seconds, and how many differences it rests on."""
    blocks = second_means.reshape(SECONDS // tau, tau, SENSORS, 6).mean(axis=1)
    steps = np.diff(blocks, axis=0)
    return 0.5 * (steps**2).mean(axis=(0, 1)), steps.shape[0] * SENSORS


def expected(tau):
    model = ImuModel.load("adis16448")
    white = [model.gyro_noise_density_rad_s_sqrt_hz, model.accel_noise_density_m_s2_sqrt_hz]
    walk = [model.gyro_random_walk_rad_s2_sqrt_hz, model.accel_random_walk_m_s3_sqrt_hz]
    return np.repeat(np.square(white) / tau + np.square(walk) * tau / 3.0, 3)


@pytest.mark.parametrize("tau", [1, 2, 5, 10, 20])
def test_allan_variance_is_that_of_the_model(second_means, tau):
    variance, differences = allan_variance(second_means, tau)
    # Neighbouring differences share a block: fewer are independent, by a factor below 2. The bias'
    # correlation time (300 s and more) takes some tau / 300 off the walk.
    tolerance = 4.5 * math.sqrt(2.0 * 2.0 / differences) + tau / 300.0
    np.testing.assert_allclose(variance, expected(tau), rtol=tolerance)


def test_white_noise_alone_reads_its_density_at_one_second(second_means):
    """With the walk's share taken off: N itself, within a percent."""
    model = ImuModel.load("adis16448")
    variance, _ = allan_variance(second_means, 1)
    walk = np.repeat(
        [model.gyro_random_walk_rad_s2_sqrt_hz, model.accel_random_walk_m_s3_sqrt_hz], 3
    )
    density = np.sqrt(variance - walk**2 / 3.0)
    np.testing.assert_allclose(density[:3], model.gyro_noise_density_rad_s_sqrt_hz, rtol=0.02)
    np.testing.assert_allclose(density[3:], model.accel_noise_density_m_s2_sqrt_hz, rtol=0.03)


def test_slopes_are_those_of_white_noise_and_of_a_walk(second_means):
    """Deviation over tau: -1/2 where white noise rules (gyro), +1/2 where the walk does (accel)."""
    gyro = [allan_variance(second_means, tau)[0][:3].mean() for tau in (1, 5)]
    accel = [allan_variance(second_means, tau)[0][3:].mean() for tau in (10, 20)]
    assert 0.5 * math.log(gyro[1] / gyro[0], 5) == pytest.approx(-0.5, abs=0.07)
    assert 0.5 * math.log(accel[1] / accel[0], 2) == pytest.approx(0.5, abs=0.07)


def test_a_cold_imu_warms_up():
    model = ImuModel.load("adis16448").model_copy(
        update={
            "gyro_turn_on_bias_rad_s": 0.0,
            "gyro_random_walk_rad_s2_sqrt_hz": 0.0,
            "gyro_noise_density_rad_s_sqrt_hz": 0.0,
            "gyro_warm_up_bias_rad_s": 0.02,
            "warm_up_time_constant_s": 30.0,
        }
    )
    bank, still = bank_of(model, 2000), fleet()
    cold, warm, hot = (
        bank.sample(k, time_s * 10**9, still).angular_velocity
        for k, time_s in enumerate((0, 30, 600))
    )
    assert cold.std() == pytest.approx(0.02, rel=0.04)
    np.testing.assert_allclose(warm, cold / math.e, atol=1e-12)
    np.testing.assert_allclose(hot, 0.0, atol=1e-9)
    bank.reset(None, None, 700 * 10**9, 3)
    again = bank.sample(3, 730 * 10**9, still).angular_velocity
    np.testing.assert_allclose(again, warm, atol=1e-12)
