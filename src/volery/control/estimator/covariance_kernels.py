"""Covariance of the error states: propagation, measurement updates and error resets.

The matrix P is flat, row i from i * STATES, and inner loops run down a column: the compiler then
knows the distances between rows and works on several columns at once, ten times as fast.
"""

from __future__ import annotations

import math
from typing import Any

from volery.control.estimator.compiled import part_kernel
from volery.control.estimator.records import (
    ACCEL_BIAS,
    GNSS_OFFSET,
    GYRO_BIAS,
    OFFSETS,
    POSITION,
    PRESSURE_OFFSET,
    ROTATION,
    STATES,
    VELOCITY,
)
from volery.core.arrays import Array
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import three

Vector = tuple[float, float, float]
_V, _R, _G, _A = (first * STATES for first in (VELOCITY, ROTATION, GYRO_BIAS, ACCEL_BIAS))


@part_kernel
def carry(P: Array, flow: Any, tuning: Any, keep: Array) -> None:
    """Propagates the covariance along the motion of a `FLOW` and adds process noise.

    P: (STATES^2,); keep: (STATES,) fraction of each state that its decay leaves, from `decay`.
    """
    transform(P, flow)
    transpose(P)
    transform(P, flow)
    for j in range(STATES):
        keep_j = keep[j]
        for i in range(STATES):
            P[i * STATES + j] *= keep_j * keep[i]
    _mirror(P)
    for i in range(OFFSETS):
        _spread(P, PRESSURE_OFFSET + i, tuning.offset_variance[i], keep)
    duration = flow.duration
    for i in range(3):
        P[(GYRO_BIAS + i) * (STATES + 1)] += tuning.bias_walk[0] * duration
        P[(ACCEL_BIAS + i) * (STATES + 1)] += tuning.bias_walk[1] * duration
    P[PRESSURE_OFFSET * (STATES + 1)] += tuning.pressure_walk * duration
    # White noise of the IMU, and what its saturated readings left out. The effect of the
    # gyroscope's noise on velocity is not counted: in a tenth of a second it is three orders of
    # magnitude below the accelerometer's.
    speed = tuning.accel_noise * duration + flow.lost_speed
    for k in range(3):
        p, v, r = POSITION + k, VELOCITY + k, ROTATION + k
        P[v * STATES + v] += speed
        P[p * STATES + p] += speed * duration * duration / 3.0
        P[p * STATES + v] += 0.5 * speed * duration
        P[v * STATES + p] = P[p * STATES + v]
        P[r * STATES + r] += tuning.gyro_noise * duration + flow.lost_turn


@part_kernel
def decay(tuning: Any, duration: float, keep: Array) -> None:
    """Computes `keep` (STATES,): fraction of each state's mean that is left after `duration` s."""
    for i in range(PRESSURE_OFFSET):
        keep[i] = 1.0
    for i in range(OFFSETS):
        keep[PRESSURE_OFFSET + i] = math.exp(-tuning.offset_rate[i] * duration)


@inner_kernel
def _spread(P: Array, i: int, variance: float, keep: Array) -> None:
    """Adds the noise of state `i`, a Gauss-Markov process with this stationary variance."""
    P[i * (STATES + 1)] += variance * (1.0 - keep[i] * keep[i])


@part_kernel
def transform(P: Array, flow: Any) -> None:
    """Computes Phi P of the motion in place; a second call on the transpose gives Phi P Phi'."""
    t = flow.duration
    b0, b1, b2 = three(flow.displacement)
    s0, s1, s2 = three(flow.speed)
    d0, d1, d2 = three(flow.turn[0]), three(flow.turn[1]), three(flow.turn[2])
    e0, e1, e2 = (
        three(flow.turn_integral[0]),
        three(flow.turn_integral[1]),
        three(flow.turn_integral[2]),
    )
    g0, g1, g2 = three(flow.gyro_speed[0]), three(flow.gyro_speed[1]), three(flow.gyro_speed[2])
    h0, h1, h2 = (
        three(flow.gyro_displacement[0]),
        three(flow.gyro_displacement[1]),
        three(flow.gyro_displacement[2]),
    )
    for j in range(STATES):
        v0, v1, v2 = P[_V + j], P[_V + STATES + j], P[_V + 2 * STATES + j]
        r0, r1, r2 = P[_R + j], P[_R + STATES + j], P[_R + 2 * STATES + j]
        g = (P[_G + j], P[_G + STATES + j], P[_G + 2 * STATES + j])
        a = (P[_A + j], P[_A + STATES + j], P[_A + 2 * STATES + j])
        P[j] += t * v0 - (b1 * r2 - b2 * r1) + _dot(h0, g) - _dot(e0, a)
        P[STATES + j] += t * v1 - (b2 * r0 - b0 * r2) + _dot(h1, g) - _dot(e1, a)
        P[2 * STATES + j] += t * v2 - (b0 * r1 - b1 * r0) + _dot(h2, g) - _dot(e2, a)
        P[_V + j] = v0 - (s1 * r2 - s2 * r1) + _dot(g0, g) - _dot(d0, a)
        P[_V + STATES + j] = v1 - (s2 * r0 - s0 * r2) + _dot(g1, g) - _dot(d1, a)
        P[_V + 2 * STATES + j] = v2 - (s0 * r1 - s1 * r0) + _dot(g2, g) - _dot(d2, a)
        P[_R + j] = r0 - _dot(d0, g)
        P[_R + STATES + j] = r1 - _dot(d1, g)
        P[_R + 2 * STATES + j] = r2 - _dot(d2, g)


@inner_kernel
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part_kernel
def transpose(P: Array) -> None:
    """Transposes P in place."""
    for i in range(1, STATES):
        for j in range(i):
            P[i * STATES + j], P[j * STATES + i] = P[j * STATES + i], P[i * STATES + j]


@part_kernel
def _mirror(P: Array) -> None:
    """Makes P exactly symmetric."""
    for i in range(1, STATES):
        for j in range(i):
            P[i * STATES + j] = P[j * STATES + i]


@part_kernel
def normalised_innovation(P: Array, rows: int, work: Any) -> float:
    """Returns the squared innovation r' S^-1 r of up to three numbers, with S = H P H' + R.

    work: a `WORK` with H, residual and variance.
    """
    s, y = work.square, work.whitened
    total = 0.0
    for i in range(rows):
        _times(P, work.H[i], work.product)
        for j in range(i + 1):
            s[i, j] = _product(work.H[j], work.product)
        s[i, i] += work.variance[i]
    for i in range(rows):  # Cholesky and forward substitution
        for j in range(i + 1):
            left = s[i, j]
            for k in range(j):
                left -= s[i, k] * s[j, k]
            s[i, j] = math.sqrt(left) if i == j else left / s[j, j]
        left = work.residual[i]
        for k in range(i):
            left -= s[i, k] * y[k]
        y[i] = left / s[i, i]
        total += y[i] * y[i]
    return total


@part_kernel
def correct(P: Array, rows: int, work: Any) -> None:
    """Fuses up to three numbers one after the other; `work.error` becomes the estimated error.

    The covariance is updated in Joseph's form, (I - k h) P (I - k h)' + k r k', written out.
    """
    product, gain, rest, error = work.product, work.gain, work.rest, work.error
    for i in range(STATES):
        error[i] = 0.0
    for i in range(rows):
        h = work.H[i]
        _times(P, h, product)
        total = _product(h, product) + work.variance[i]
        step = work.residual[i] - _product(h, error)
        for k in range(STATES):
            gain[k] = product[k] / total
        for k in range(STATES):
            rest[k] = 0.5 * total * gain[k] - product[k]
            error[k] += gain[k] * step
        for j in range(STATES):
            gain_j, rest_j = gain[j], rest[j]
            for k in range(STATES):
                P[k * STATES + j] += gain_j * rest[k] + rest_j * gain[k]
    _mirror(P)


@inner_kernel
def _times(P: Array, h: Array, out: Array) -> None:
    """Computes `out` = P h, for an h of mostly zeros."""
    for k in range(STATES):
        out[k] = 0.0
    for i in range(STATES):
        scale = h[i]
        if scale != 0.0:
            for k in range(STATES):
                out[k] += scale * P[i * STATES + k]


@inner_kernel
def _product(h: Array, vector: Array) -> float:
    total = 0.0
    for i in range(STATES):
        if h[i] != 0.0:
            total += h[i] * vector[i]
    return total


@part_kernel
def turn_errors(P: Array, x: float, y: float, z: float) -> None:
    """Updates the covariance after the attitude absorbed the rotation error (x, y, z) rad.

    G = I + [r]x / 2 for errors in the map (Sola 2017, section 7).
    """
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    for _ in range(2):
        for j in range(STATES):
            a, b, c = P[_R + j], P[_R + STATES + j], P[_R + 2 * STATES + j]
            P[_R + j] = a + y * c - z * b
            P[_R + STATES + j] = b + z * a - x * c
            P[_R + 2 * STATES + j] = c + x * b - y * a
        transpose(P)
    _mirror(P)


@part_kernel
def forget(P: Array, first: int, variance: Array) -> None:
    """Resets three states from `first` on to independent ones with variance (3,)."""
    for k in range(first, first + 3):
        for j in range(STATES):
            P[k * STATES + j] = 0.0
            P[j * STATES + k] = 0.0
        P[k * (STATES + 1)] = variance[k - first]


@part_kernel
def forget_position(P: Array, variance: Array) -> None:
    """Resets position and velocity to a GNSS fix with variance (6,).

    The new position has the receiver's error: minus its offset, plus noise.
    """
    for k in range(3):
        p, v, o = (POSITION + k) * STATES, (VELOCITY + k) * STATES, (GNSS_OFFSET + k) * STATES
        for j in range(STATES):
            P[v + j] = 0.0
            P[p + j] = -P[o + j] if j >= ROTATION else 0.0
    for i in range(ROTATION):
        for j in range(ROTATION, STATES):
            P[j * STATES + i] = P[i * STATES + j]
    for k in range(3):
        for m in range(3):
            P[(POSITION + k) * STATES + POSITION + m] = P[
                (GNSS_OFFSET + k) * STATES + GNSS_OFFSET + m
            ]
        P[(POSITION + k) * (STATES + 1)] += variance[k]
        P[(VELOCITY + k) * (STATES + 1)] = variance[3 + k]
