"""Filter steps for rows of UAVs: integrate an IMU measurement, fuse what is due.

The filter runs at a horizon a fixed time behind the present, where every measurement is fused at
its own time and in order, however late it arrived. The present is that state, propagated through
the IMU measurements since (the delayed fusion horizon of PX4's EKF2, after A. Khosravian, J.
Trumpf, R. Mahony, T. Hamel, "Recursive attitude estimation in the presence of multi-rate and
multi-delay vector measurements", 2015; here the measurements are integrated again each time,
instead of tracked by a complementary filter, so that the present adds no lag of its own).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.estimator.compiled import part_kernel
from volery.control.estimator.covariance_kernels import (
    carry,
    correct,
    decay,
    forget,
    forget_position,
    normalised_innovation,
    turn_errors,
)
from volery.control.estimator.measurement_kernels import linearise
from volery.control.estimator.motion_kernels import (
    add_saturation,
    flow_on,
    motion_at_horizon,
    still,
    travelled,
)
from volery.control.estimator.output_predictor import renew_present
from volery.control.estimator.records import (
    ACCEL_BIAS,
    GNSS,
    GYRO_BIAS,
    OFFSETS,
    PARTS,
    POSE,
    POSITION,
    PRESSURE_OFFSET,
    ROTATION,
    STATES,
    VELOCITY,
)
from volery.core.arrays import Array
from volery.core.rotation_kernels import rotate_vector
from volery.vehicle.compiled import fused_kernel, inner_kernel
from volery.vehicle.rotation_math import four, product, three

Rows = NDArray[np.int64]
Records = NDArray[np.void]

_LONGEST_FLOW = 0.1
"""s; a longer interval is propagated into the covariance even without measurements."""
_LARGE_TURN = 1e-6
"""rad^2; a smaller correction of attitude changes the covariance by less than a thousandth."""


@fused_kernel
def predict_rows(
    filters: Records,
    tunings: Records,
    rings: Records,
    queues: Records,
    rows: Rows,
    stamp_ns: int,
    gyro: Array,
    accel: Array,
    works: Records,
) -> int:
    """Integrates an IMU measurement of each of `rows` (S,), in sensor axes (S, 3).

    rings: (N, readings); queues: (N, QUEUE); works: (1,). Returns the number of rows processed
    before one that already has a measurement of this or a later time.
    """
    work = works[0]
    capacity = rings.shape[1]
    for s in range(len(rows)):
        i = rows[s]
        state, tuning, ring, queue = filters[i], tunings[i], rings[i], queues[i]
        first_ever = state.readings == 0
        if stamp_ns < state.newest_ns or (stamp_ns == state.newest_ns and not first_ever):
            return s
        slot = (state.first_reading + state.waiting_readings) % capacity
        _store(ring[slot], tuning, stamp_ns, gyro[s], accel[s])
        state.waiting_readings += 1
        state.newest_ns = stamp_ns
        if first_ever:  # the time before counts as now
            _copy_reading(state.reading, ring[slot], state.reading.stamp_ns)
        state.readings += 1
        horizon_ns = stamp_ns - tuning.horizon_ns
        while state.waiting_readings > 0 and (
            ring[state.first_reading].stamp_ns <= horizon_ns or state.waiting_readings == capacity
        ):
            _move_horizon(state, tuning, ring[state.first_reading])
            state.first_reading = (state.first_reading + 1) % capacity
            state.waiting_readings -= 1
            _fuse_due(state, tuning, queue, work)
        renew_present(state, tuning, ring)
    return len(rows)


@inner_kernel
def _store(slot: Any, tuning: Any, stamp_ns: int, gyro: Array, accel: Array) -> None:
    """Writes a measurement, rotated from sensor to body axes, into the ring."""
    x, y, z, w = four(tuning.imu_attitude)
    a, b, c = three(gyro)
    slot.gyro[0], slot.gyro[1], slot.gyro[2] = rotate_vector(x, y, z, w, a, b, c)
    a, b, c = three(accel)
    slot.accel[0], slot.accel[1], slot.accel[2] = rotate_vector(x, y, z, w, a, b, c)
    slot.gyro_cut = _is_cut(gyro, tuning.gyro_range)
    slot.accel_cut = _is_cut(accel, tuning.accel_range)
    slot.stamp_ns = stamp_ns


@inner_kernel
def _is_cut(values: Array, full_scale: float) -> int:
    """Returns 1 if one of (3,) values is at full scale, else 0."""
    return int(max(abs(values[0]), abs(values[1]), abs(values[2])) >= full_scale)


@inner_kernel
def _copy_reading(target: Any, source: Any, stamp_ns: int) -> None:
    for k in range(3):
        target.gyro[k], target.accel[k] = source.gyro[k], source.accel[k]
    target.gyro_cut, target.accel_cut = source.gyro_cut, source.accel_cut
    target.stamp_ns = stamp_ns


@inner_kernel
def _move_horizon(state: Any, tuning: Any, reading: Any) -> None:
    before = motion_at_horizon(state)
    gyro_bias, accel_bias = three(state.gyro_bias), three(state.accel_bias)
    after = travelled(before, state.reading, reading, gyro_bias, accel_bias)
    duration = (reading.stamp_ns - state.reading.stamp_ns) * 1e-9
    flow_on(state.flow, duration, before, after)
    add_saturation(state.flow, duration, reading, tuning)
    for k in range(3):
        state.position[k] = after[0][k]
        state.velocity[k] = after[1][k]
    for k in range(4):
        state.rotation[k] = after[2][k]
    _copy_reading(state.reading, reading, reading.stamp_ns)


@part_kernel
def _fuse_due(state: Any, tuning: Any, queue: Any, work: Any) -> None:
    caught_up = False
    while (
        state.waiting_measurements > 0
        and queue[state.first_measurement].stamp_ns <= state.reading.stamp_ns
    ):
        if not caught_up:
            _catch_up(state, tuning, work)
            caught_up = True
        fuse(state, tuning, queue[state.first_measurement], work)
        state.first_measurement = (state.first_measurement + 1) % len(queue)
        state.waiting_measurements -= 1
    if state.flow.duration > _LONGEST_FLOW:
        _catch_up(state, tuning, work)


@part_kernel
def _catch_up(state: Any, tuning: Any, work: Any) -> None:
    """Propagates the covariance and decaying states to the time of the horizon."""
    keep = work.keep
    decay(tuning, state.flow.duration, keep)
    carry(state.covariance, state.flow, tuning, keep)
    still(state.flow)
    for k in range(OFFSETS):
        state.offset[k] *= keep[PRESSURE_OFFSET + k]


@part_kernel
def fuse(state: Any, tuning: Any, measured: Any, work: Any) -> None:
    """Corrects the state at the horizon by a measurement, each part if it passes its gate."""
    missed = False
    for part in range(PARTS):
        count = linearise(state, tuning, measured, part, work)
        if count == 0:
            continue
        aid = PARTS * measured.kind + part
        ratio = normalised_innovation(state.covariance, count, work)
        state.innovation[aid] = ratio
        is_fix = measured.kind == GNSS and part == 0
        if ratio <= (tuning.gate_1 if count == 1 else tuning.gate_3):  # false for NaN
            correct(state.covariance, count, work)
            take_over(state, work.error)
            state.accepted[aid] += 1
            if is_fix:
                state.rejected_since_ns = -1
        else:
            state.rejected[aid] += 1
            missed = True
            if is_fix and _is_lost(state, tuning.restart_ns, measured):
                _restart(state, measured, work.residual)
    if measured.kind == POSE and not missed:
        state.rejected_since_ns = -1
    elif measured.kind == POSE and _is_lost(state, tuning.pose_restart_ns, measured):
        _restart_from_pose(state, tuning, measured, work)


@inner_kernel
def _is_lost(state: Any, timeout_ns: int, measured: Any) -> bool:
    """Returns whether positions were rejected for long enough to restart from this one."""
    if state.rejected_since_ns < 0:
        state.rejected_since_ns = measured.stamp_ns
    complete = True
    for k in range(6):
        complete = complete and (measured.kind == POSE or measured.variance[k] < np.inf)
    lost: bool = measured.stamp_ns - state.rejected_since_ns > timeout_ns
    return lost and complete


@inner_kernel
def _restart(state: Any, measured: Any, residual: Array) -> None:
    """Restarts position and velocity from a GNSS fix."""
    for k in range(3):
        state.position[k] += residual[k]
        state.velocity[k] = measured.value[3 + k]
    forget_position(state.covariance, measured.variance)
    state.rejected_since_ns = -1
    state.restarts += 1


@part_kernel
def _restart_from_pose(state: Any, tuning: Any, measured: Any, work: Any) -> None:
    """Restarts position and attitude from a pose; the velocity in body axes is unchanged."""
    if linearise(state, tuning, measured, 1, work) == 3:
        for k in range(STATES):
            work.error[k] = 0.0
        for k in range(3):
            work.error[ROTATION + k] = work.residual[k]
        x, y, z, w = four(state.rotation)
        vx, vy, vz = three(state.velocity)
        vx, vy, vz = rotate_vector(-x, -y, -z, w, vx, vy, vz)
        take_over(state, work.error)
        x, y, z, w = four(state.rotation)
        state.velocity[0], state.velocity[1], state.velocity[2] = rotate_vector(
            x, y, z, w, vx, vy, vz
        )
        forget(state.covariance, ROTATION, work.variance)
    if linearise(state, tuning, measured, 0, work) == 3:
        for k in range(3):
            state.position[k] += work.residual[k]
        forget(state.covariance, POSITION, work.variance)
    state.rejected_since_ns = -1
    state.restarts += 1


@part_kernel
def take_over(state: Any, error: Array) -> None:
    """Adds the estimated error (STATES,) to the state at the horizon."""
    for k in range(3):
        state.position[k] += error[k]
        state.velocity[k] += error[VELOCITY + k]
        state.gyro_bias[k] += error[GYRO_BIAS + k]
        state.accel_bias[k] += error[ACCEL_BIAS + k]
    for k in range(OFFSETS):
        state.offset[k] += error[PRESSURE_OFFSET + k]
    rx, ry, rz = error[ROTATION], error[ROTATION + 1], error[ROTATION + 2]
    size = rx * rx + ry * ry + rz * rz
    half = 0.5 * np.sqrt(size)
    scale = 0.5 if half < 1e-4 else 0.5 * np.sin(half) / half
    # exp(error) * rotation
    ex, ey, ez, ew = scale * rx, scale * ry, scale * rz, np.cos(half)
    x, y, z, w = four(state.rotation)
    qx, qy, qz, qw = product(ex, ey, ez, ew, x, y, z, w)
    length = np.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    state.rotation[0], state.rotation[1] = qx / length, qy / length
    state.rotation[2], state.rotation[3] = qz / length, qw / length
    if size > _LARGE_TURN:
        turn_errors(state.covariance, rx, ry, rz)
