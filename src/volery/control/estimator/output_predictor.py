"""The present state: the state at the horizon, propagated through later IMU measurements."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.estimator.compiled import part_kernel
from volery.control.estimator.covariance_kernels import carry, decay, transform, transpose
from volery.control.estimator.motion_kernels import (
    add_saturation,
    flow_on,
    motion_at_horizon,
    still,
    travelled,
)
from volery.control.estimator.records import STATES
from volery.core.arrays import Array
from volery.core.rotation_kernels import cross, rotate_vector
from volery.vehicle.compiled import fused_kernel, inner_kernel
from volery.vehicle.rotation_math import four, three

Rows = NDArray[np.int64]
Records = NDArray[np.void]


@part_kernel
def renew_present(state: Any, tuning: Any, ring: Any) -> None:
    """Computes the state at the newest measurement, at the centre of mass."""
    motion = motion_at_horizon(state)
    gyro_bias, accel_bias = three(state.gyro_bias), three(state.accel_bias)
    before = state.reading
    slot = state.first_reading
    for _ in range(state.waiting_readings):
        reading = ring[slot]
        motion = travelled(motion, before, reading, gyro_bias, accel_bias)
        before = reading
        slot = slot + 1 if slot + 1 < len(ring) else 0
    for k in range(4):
        state.attitude[k] = motion[2][k]
    gx, gy, gz = three(before.gyro)
    state.omega_body[0] = gx - gyro_bias[0]
    state.omega_body[1] = gy - gyro_bias[1]
    state.omega_body[2] = gz - gyro_bias[2]
    arm, swing = _arm_and_swing(state, tuning)
    for k in range(3):
        state.position_map[k] = motion[0][k] - arm[k]
        state.velocity_map[k] = motion[1][k] - swing[k]


@inner_kernel
def _arm_and_swing(
    state: Any, tuning: Any
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Returns the vector from centre of mass to IMU, m, and its velocity, m/s; map frame."""
    x, y, z, w = four(state.attitude)
    ax, ay, az = three(tuning.imu_arm)
    wx, wy, wz = three(state.omega_body)
    sx, sy, sz = cross(wx, wy, wz, ax, ay, az)
    return rotate_vector(x, y, z, w, ax, ay, az), rotate_vector(x, y, z, w, sx, sy, sz)


@fused_kernel
def present_covariances(
    filters: Records, tunings: Records, rings: Records, rows: Rows, works: Records, out: Array
) -> None:
    """Computes present covariances `out` (S, STATES^2), at the centre of mass; works: (1,)."""
    work = works[0]
    flow, keep = work.flow, work.keep
    for s in range(len(rows)):
        state, tuning, ring = filters[rows[s]], tunings[rows[s]], rings[rows[s]]
        P = out[s]
        for i in range(STATES * STATES):
            P[i] = state.covariance[i]
        _copy_flow(flow, state.flow)
        gyro_bias, accel_bias = three(state.gyro_bias), three(state.accel_bias)
        motion = motion_at_horizon(state)
        before = state.reading
        for n in range(state.waiting_readings):
            reading = ring[(state.first_reading + n) % len(ring)]
            after = travelled(motion, before, reading, gyro_bias, accel_bias)
            duration = (reading.stamp_ns - before.stamp_ns) * 1e-9
            flow_on(flow, duration, motion, after)
            add_saturation(flow, duration, reading, tuning)
            motion = after
            before = reading
        decay(tuning, flow.duration, keep)
        carry(P, flow, tuning, keep)
        _lever(state, tuning, flow)
        transform(P, flow)
        transpose(P)
        transform(P, flow)


@inner_kernel
def _copy_flow(target: Any, source: Any) -> None:
    target.duration = source.duration
    target.lost_turn, target.lost_speed = source.lost_turn, source.lost_speed
    for i in range(3):
        target.speed[i], target.displacement[i] = source.speed[i], source.displacement[i]
        for j in range(3):
            target.turn[i, j], target.turn_integral[i, j] = (
                source.turn[i, j],
                source.turn_integral[i, j],
            )
            target.gyro_speed[i, j] = source.gyro_speed[i, j]
            target.gyro_displacement[i, j] = source.gyro_displacement[i, j]


@part_kernel
def _lever(state: Any, tuning: Any, flow: Any) -> None:
    """Sets `flow` to the transition of errors from the IMU to the centre of mass."""
    still(flow)
    arm, swing = _arm_and_swing(state, tuning)
    x, y, z, w = four(state.attitude)
    ax, ay, az = three(tuning.imu_arm)
    for k in range(3):
        flow.displacement[k] = -arm[k]
        flow.speed[k] = -swing[k]
        # -R [arm]x: effect of a gyroscope bias on the arm
        sx, sy, sz = cross(ax, ay, az, 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
        sx, sy, sz = rotate_vector(x, y, z, w, -sx, -sy, -sz)
        flow.gyro_speed[0, k], flow.gyro_speed[1, k], flow.gyro_speed[2, k] = sx, sy, sz
