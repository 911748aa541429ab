"""A motion known in closed form, and sensors that feel it, for the checks of the estimator."""

import numpy as np

from volery.core import rotations

GRAVITY = 9.80665
UP = np.array([0.0, 0.0, GRAVITY])
GYRO_CORRELATION_S, ACCEL_CORRELATION_S = 1000.0, 300.0
"""Of the biases' moving part, in RotorS' ADIS16448."""
FIELD = np.array([1.13e-6, 2.161e-5, -4.302e-5])


class Motion:
    """Each of N vehicles on a figure of eight of its own, turning and tilting all the while."""

    def __init__(self, count, seed, speed=8.0):
        self.last = None
        self.count = count
        draw = np.random.default_rng(seed)
        self.amplitude = draw.uniform(0.7, 1.3, (3, count)) * np.array([[20.0], [12.0], [3.0]])
        pulse = speed / self.amplitude[0]
        self.pulse = np.array([pulse, 2 * pulse, 1.3 * pulse])
        self.phase = draw.uniform(0, 2 * np.pi, (3, count))
        self.turn = draw.uniform(0.7, 1.3, (3, count)) * np.array([[0.3], [0.25], [1.2]])
        self.turn_pulse = draw.uniform(0.4, 1.6, (3, count))
        self.turn_phase = draw.uniform(0, 2 * np.pi, (3, count))

    def at(self, t):
        """As `moving`, computed once an instant."""
        if self.last is None or self.last[0] != t:
            self.last = t, self.moving(t)
        return self.last[1]

    def moving(self, t):
        """Position, velocity, attitude, rates in the body, acceleration and specific force."""
        a, w, p = self.amplitude, self.pulse, self.phase
        position = (a * np.sin(w * t + p)).T
        velocity = (a * w * np.cos(w * t + p)).T
        acceleration = -(a * w**2 * np.sin(w * t + p)).T
        roll, pitch, yaw = self.turn * np.sin(self.turn_pulse * t + self.turn_phase)
        dr, dp, dy = self.turn * self.turn_pulse * np.cos(self.turn_pulse * t + self.turn_phase)
        attitude = rotations.from_rpy(roll, pitch, yaw)
        omega = np.stack(
            [
                dr - dy * np.sin(pitch),
                dp * np.cos(roll) + dy * np.sin(roll) * np.cos(pitch),
                -dp * np.sin(roll) + dy * np.cos(roll) * np.cos(pitch),
            ],
            axis=1,
        )
        force = rotations.rotate(rotations.conjugate(attitude), acceleration + UP)
        return position, velocity, attitude, omega, force

    def omega_rate(self, t, h=1e-4):
        return (self.moving(t + h)[3] - self.moving(t - h)[3]) / (2 * h)


class Straight:
    """East at a constant speed, level, all alike."""

    def __init__(self, count, speed):
        self.count, self.speed = count, speed

    def at(self, t):
        n = self.count
        level, force = np.tile(rotations.IDENTITY, (n, 1)), np.tile([0, 0, GRAVITY], (n, 1))
        position, velocity = np.zeros((n, 3)), np.zeros((n, 3))
        position[:, 0], velocity[:, 0] = self.speed * t, self.speed
        return position, velocity, level, np.zeros((n, 3)), force


class GaussMarkov:
    """A bias that walks, b+ = decay b + spread n, on a constant one."""

    def __init__(self, draw, shape, first, walk, tau, dt, constant=0.0):
        self.draw, self.moving = draw, draw.normal(size=shape) * first
        self.constant = draw.normal(size=shape) * constant if constant else 0.0
        self.decay = np.exp(-dt / tau)
        self.spread = walk * np.sqrt(tau / 2 * (1 - self.decay**2))

    @property
    def value(self):
        return self.moving + self.constant

    def step(self):
        now = self.value
        noise = self.draw.normal(size=self.moving.shape)
        self.moving = self.decay * self.moving + self.spread * noise
        return now


class Sensors:
    """Noise as RotorS (IMU) and PX4's simulation (the others) have it."""

    RATE = 200

    def __init__(self, motion, settings, seed, arms=None):
        self.motion, self.settings = motion, settings
        self.count = motion.count
        self.draw = draw = np.random.default_rng(seed)
        self.dt = dt = 1 / self.RATE
        s, n = settings, self.count
        self.gyro_white = s.gyro_noise_density_rad_s_sqrt_hz / np.sqrt(dt)
        self.accel_white = s.accel_noise_density_m_s2_sqrt_hz / np.sqrt(dt)
        self.gyro_bias = GaussMarkov(
            draw,
            (n, 3),
            0.0,
            s.gyro_random_walk_rad_s2_sqrt_hz,
            GYRO_CORRELATION_S,
            dt,
            s.gyro_turn_on_bias_rad_s,
        )
        self.accel_bias = GaussMarkov(
            draw,
            (n, 3),
            0.0,
            s.accel_random_walk_m_s3_sqrt_hz,
            ACCEL_CORRELATION_S,
            dt,
            s.accel_turn_on_bias_m_s2,
        )
        tau = s.gnss_offset_correlation_s
        sigma = np.array(s.gnss_offset_sigma_m)
        self.gnss_offset = GaussMarkov(draw, (n, 3), sigma, sigma * np.sqrt(2 / tau), tau, 0.2)
        tau, sigma = s.heading_offset_correlation_s, s.heading_offset_sigma_rad
        self.heading_offset = GaussMarkov(draw, n, sigma, sigma * np.sqrt(2 / tau), tau, 0.01)
        self.datum = draw.normal(size=n) * s.pressure_offset_sigma_m
        self.arms = arms or {}

    def _arm(self, name):
        return np.array(self.arms.get(name, (0.0, 0.0, 0.0)))

    def imu(self, t):
        _, _, _, omega, force = self.motion.at(t)
        arm = self._arm("imu")
        if arm.any():
            swing = np.cross(omega, np.cross(omega, arm))
            force = force + np.cross(self.motion.omega_rate(t), arm) + swing
        self.true_gyro_bias, self.true_accel_bias = self.gyro_bias.step(), self.accel_bias.step()
        noise = self.draw.normal(size=(2, self.count, 3))
        return (
            omega + self.true_gyro_bias + self.gyro_white * noise[0],
            force + self.true_accel_bias + self.accel_white * noise[1],
        )

    GNSS_SIGMA = np.array([0.3, 0.3, 0.5, 0.2, 0.2, 0.4])

    def gnss(self, t):
        position, velocity, attitude, omega, _ = self.motion.at(t)
        arm = np.broadcast_to(self._arm("gnss"), omega.shape)
        fix = np.hstack(
            [
                position + rotations.rotate(attitude, arm) + self.gnss_offset.step(),
                velocity + rotations.rotate(attitude, np.cross(omega, arm)),
            ]
        ) + self.GNSS_SIGMA * self.draw.normal(size=(self.count, 6))
        return fix[:, :3], fix[:, 3:]

    PRESSURE_SIGMA = 0.1

    def pressure_height(self, t):
        position, _, attitude, _, _ = self.motion.at(t)
        self.datum = self.datum + self.settings.pressure_drift_m_sqrt_s * np.sqrt(
            0.02
        ) * self.draw.normal(size=self.count)
        arm = np.broadcast_to(self._arm("barometer"), position.shape)
        height = (position + rotations.rotate(attitude, arm))[:, 2]
        return height + self.datum + self.PRESSURE_SIGMA * self.draw.normal(size=self.count)

    MAGNETIC_SIGMA = 4e-7

    def magnetic(self, t):
        attitude = self.motion.at(t)[2]
        zero = np.zeros(self.count)
        off = rotations.from_rpy(zero, zero, self.heading_offset.step())
        field = rotations.rotate(rotations.conjugate(attitude), rotations.rotate(off, FIELD))
        return field + self.MAGNETIC_SIGMA * self.draw.normal(size=(self.count, 3))


def drive(estimator, sensors, start, stop, *, gnss=True, delay=0.12, each=None):
    """Feed an estimator from time `start` up to `stop`, s; `each(k, t)` sees it after each step."""
    rows = np.arange(sensors.count)
    first = round(start * sensors.RATE)
    if first == 0:
        estimator.predict(rows, 0, *sensors.imu(0.0))
    lag = round(delay * sensors.RATE)
    for k in range(first + 1, round(stop * sensors.RATE) + 1):
        t, stamp = k / sensors.RATE, k * 5_000_000
        if k % 2 == 0:
            estimator.fuse_magnetic(rows, stamp, sensors.magnetic(t), sensors.MAGNETIC_SIGMA**2)
        if k % 4 == 0:
            estimator.fuse_pressure_height(
                rows, stamp, sensors.pressure_height(t), sensors.PRESSURE_SIGMA**2
            )
        if gnss and k % 40 == lag % 40 and k >= lag:
            fix = sensors.gnss((k - lag) / sensors.RATE)
            estimator.fuse_gnss(rows, (k - lag) * 5_000_000, *fix, sensors.GNSS_SIGMA**2)
        estimator.predict(rows, stamp, *sensors.imu(t))
        if each is not None:
            each(k, t)
