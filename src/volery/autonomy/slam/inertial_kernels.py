"""Prediction of an error-state Kalman filter between two IMU samples, and its correction.

State: position (3,) m, velocity (3,) m/s, attitude (4,) x y z w, biases of gyroscope and
accelerometer (3,) each, gravity (3,) m/s^2. Errors, in this order, 17: position, velocity, attitude
(a small rotation about the frame's axes, applied from the left), gyroscope, accelerometer,
gravity's direction (a small rotation about the frame's x and y). Equations: J. Sola, Quaternion
kinematics for the error-state Kalman filter, 2017, section 7 (global angular errors).

Gravity is a state because the frame is that of the first map: at rest an accelerometer bias looks
like a tilt, so the frame may be tilted by a degree or two. Scan matching fixes the attitude in the
frame, and the accelerometer gradually shows the direction of gravity in it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import brief_kernel, inner_kernel
from volery.core.rotation_kernels import matrix_rows, quaternion_product, rotate_vector

STATES = 17
P, V, Q, BG, BA, G = 0, 3, 6, 10, 13, 16
"""Offsets of the parts of the state (19,)."""
STATE_NUMBERS = 19


@inner_kernel
def turn_left(state: Array, x: float, y: float, z: float) -> None:
    """Rotates the attitude by a rotation vector about the world's axes."""
    _product(state, x, y, z, True)


@inner_kernel
def _product(state: Array, x: float, y: float, z: float, left: bool) -> None:
    angle = math.sqrt(x * x + y * y + z * z)
    k = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    ax, ay, az, aw = k * x, k * y, k * z, math.cos(0.5 * angle)
    bx, by, bz, bw = state[Q], state[Q + 1], state[Q + 2], state[Q + 3]
    if not left:
        ax, ay, az, aw, bx, by, bz, bw = bx, by, bz, bw, ax, ay, az, aw
    qx, qy, qz, qw = quaternion_product(ax, ay, az, aw, bx, by, bz, bw)
    norm = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    state[Q], state[Q + 1], state[Q + 2], state[Q + 3] = qx * norm, qy * norm, qz * norm, qw * norm


@inner_kernel
def rotation_matrix(state: Array, matrix: Array) -> None:
    """Fills `matrix` (3, 3), world from body."""
    rows = matrix_rows(state[Q], state[Q + 1], state[Q + 2], state[Q + 3])
    for i in range(3):
        matrix[i, 0], matrix[i, 1], matrix[i, 2] = rows[i]


@brief_kernel
def move(
    state: Array, covariance: Array, gyro: Array, accel: Array, dt: float, noise: Array
) -> None:
    """Propagates state (19,) and covariance (17, 17) by `dt` s under mean IMU samples (3,).

    `noise` (5,): densities of gyroscope, accelerometer, of their biases' random walks, of
    gravity's.
    """
    turn = np.empty((3, 3))
    wx, wy, wz = gyro[0] - state[BG], gyro[1] - state[BG + 1], gyro[2] - state[BG + 2]
    _product(state, 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz, False)
    rotation_matrix(state, turn)
    ax, ay, az = accel[0] - state[BA], accel[1] - state[BA + 1], accel[2] - state[BA + 2]
    force = np.empty(3)
    for i in range(3):
        force[i] = turn[i, 0] * ax + turn[i, 1] * ay + turn[i, 2] * az
    for i in range(3):
        change = force[i] + state[G + i]
        state[P + i] += dt * (state[V + i] + 0.5 * dt * change)
        state[V + i] += dt * change
    _product(state, 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz, False)
    _move_covariance(covariance, turn, force, state[G : G + 3], dt)
    for i in range(3):
        covariance[3 + i, 3 + i] += noise[1] * noise[1] * dt
        covariance[6 + i, 6 + i] += noise[0] * noise[0] * dt
        covariance[9 + i, 9 + i] += noise[2] * noise[2] * dt
        covariance[12 + i, 12 + i] += noise[3] * noise[3] * dt
    for i in range(15, 17):
        covariance[i, i] += noise[4] * noise[4] * dt


@inner_kernel
def _move_covariance(
    covariance: Array, turn: Array, force: Array, gravity: Array, dt: float
) -> None:
    """Computes P <- F P F' in place, rows first; F differs from 1 by few blocks."""
    for column in range(STATES):
        _transition(covariance[:, column], turn, force, gravity, dt)
    for row in range(STATES):
        _transition(covariance[row], turn, force, gravity, dt)


@inner_kernel
def _transition(error: Array, turn: Array, force: Array, gravity: Array, dt: float) -> None:
    """Propagates errors (17,) in place; each line uses only values not changed yet."""
    for i in range(3):
        error[i] += dt * error[3 + i]
    tx, ty, tz = error[6], error[7], error[8]
    error[3] += dt * (force[2] * ty - force[1] * tz)
    error[4] += dt * (force[0] * tz - force[2] * tx)
    error[5] += dt * (force[1] * tx - force[0] * ty)
    error[3] += dt * error[16] * gravity[2]
    error[4] -= dt * error[15] * gravity[2]
    error[5] += dt * (error[15] * gravity[1] - error[16] * gravity[0])
    for i in range(3):
        for k in range(3):
            error[3 + i] -= dt * turn[i, k] * error[12 + k]
            error[6 + i] -= dt * turn[i, k] * error[9 + k]


@inner_kernel
def add_error(state: Array, error: Array) -> None:
    """Corrects a state (19,) by errors (17,)."""
    for i in range(3):
        state[P + i] += error[i]
        state[V + i] += error[3 + i]
        state[BG + i] += error[9 + i]
        state[BA + i] += error[12 + i]
    turn_left(state, error[6], error[7], error[8])
    gx, gy, gz = state[G], state[G + 1], state[G + 2]
    tx, ty = error[15], error[16]
    nx, ny, nz = gx + ty * gz, gy - tx * gz, gz + tx * gy - ty * gx
    keep = math.sqrt((gx * gx + gy * gy + gz * gz) / (nx * nx + ny * ny + nz * nz))
    state[G], state[G + 1], state[G + 2] = keep * nx, keep * ny, keep * nz


@brief_kernel
def remember(times: NDArray[np.int64], states: Array, time_ns: int, state: Array) -> None:
    """Shifts times (M,) and states (M, 19) by one and appends a new state."""
    last = len(times) - 1
    for k in range(last):
        times[k] = times[k + 1]
        for i in range(STATE_NUMBERS):
            states[k, i] = states[k + 1, i]
    times[last] = time_ns
    for i in range(STATE_NUMBERS):
        states[last, i] = state[i]


@brief_kernel
def observe(
    state: Array, covariance: Array, row: Array, innovation: float, variance: float
) -> float:
    """Applies a scalar measurement; `row` (17,) is its derivative.

    Returns the normalized innovation.
    """
    gain = np.zeros(STATES)
    for i in range(STATES):
        for k in range(STATES):
            gain[i] += covariance[i, k] * row[k]
    total = variance
    for i in range(STATES):
        total += row[i] * gain[i]
    for i in range(STATES):
        for k in range(i + 1):
            covariance[i, k] -= gain[i] * gain[k] / total
            covariance[k, i] = covariance[i, k]
    for i in range(STATES):
        gain[i] *= innovation / total
    add_error(state, gain)
    return innovation / math.sqrt(total)


@inner_kernel
def turned(state: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Returns a vector of the body along the world's axes."""
    return rotate_vector(state[Q], state[Q + 1], state[Q + 2], state[Q + 3], x, y, z)
