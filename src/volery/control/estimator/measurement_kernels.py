"""Expected measurement of each sensor, and its derivative by the error states.

A measurement of age t (between its stamp and the IMU measurement at which it is fused, less than an
IMU period) is compared with the state of its own time, position - t velocity.
"""

from __future__ import annotations

import math
from typing import Any

from volery.control.estimator.compiled import part_kernel
from volery.control.estimator.records import (
    GNSS,
    GNSS_OFFSET,
    HEADING_OFFSET,
    MAGNETIC,
    POSE,
    POSITION,
    PRESSURE,
    PRESSURE_OFFSET,
    RANGE,
    ROTATION,
    STATED_VELOCITY,
    STATES,
    VELOCITY,
)
from volery.core.arrays import Array
from volery.core.rotation_kernels import cross, rotate_vector
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import four, three, turned

_OFFSET_0 = PRESSURE_OFFSET


@part_kernel
def linearise(  # noqa: PLR0911
    state: Any, tuning: Any, measured: Any, part: int, work: Any
) -> int:
    """Fills residual, its Jacobian H and noise variance of a `WORK`; returns the rows filled.

    state: a `FILTER` at its horizon; measured: a `MEASUREMENT`; part: 0 or 1. No rows: this part is
    missing or not usable.
    """
    H, residual, variance = work.H, work.residual, work.variance
    for i in range(3):
        for j in range(STATES):
            H[i, j] = 0.0
    if not _has(measured, part):
        return 0
    age = (state.reading.stamp_ns - measured.stamp_ns) * 1e-9
    kind = measured.kind
    if kind == MAGNETIC:
        return _heading(state, tuning, measured, age, H, residual, variance) if part == 0 else 0
    if kind == PRESSURE:
        return _pressure(state, tuning, measured, age, H, residual, variance) if part == 0 else 0
    if kind == RANGE:
        return _range(state, tuning, measured, age, H, residual, variance) if part == 0 else 0
    if kind == POSE and part == 1:
        return _attitude(state, measured, age, H, residual, variance)
    if kind == STATED_VELOCITY or part == 1:
        return _velocity(state, tuning, measured, H, residual, variance)
    return _position(state, tuning, measured, age, H, residual, variance)


@inner_kernel
def _has(measured: Any, part: int) -> bool:
    first = 3 if measured.kind == STATED_VELOCITY else 3 * part
    if measured.kind == STATED_VELOCITY and part == 1:
        return False
    finite = True
    for k in range(first, first + 3):
        finite = finite and measured.variance[k] < math.inf
    return finite


@inner_kernel
def _arm(state: Any, tuning: Any, kind: int) -> tuple[float, float, float]:
    """Returns the vector from the IMU to the measured point, antenna or centre of mass; map, m."""
    x, y, z, w = four(state.rotation)
    sign = 1.0 if kind == GNSS else -1.0
    ax, ay, az = three(tuning.gnss_arm) if kind == GNSS else three(tuning.imu_arm)
    return rotate_vector(x, y, z, w, sign * ax, sign * ay, sign * az)


@inner_kernel
def _swing(H: Array, row: int, axis: int, ax: float, ay: float, az: float) -> None:
    """Fills a row of H for component `axis` of an arm that turns with the vehicle: -[arm]x."""
    if axis == 0:
        H[row, ROTATION + 1], H[row, ROTATION + 2] = az, -ay
    elif axis == 1:
        H[row, ROTATION], H[row, ROTATION + 2] = -az, ax
    else:
        H[row, ROTATION], H[row, ROTATION + 1] = ay, -ax


@inner_kernel
def turn_rate(state: Any) -> tuple[float, float, float]:
    """Returns the body rates at the horizon, rad/s, without bias."""
    gx, gy, gz = three(state.reading.gyro)
    bx, by, bz = three(state.gyro_bias)
    return gx - bx, gy - by, gz - bz


@part_kernel
def _position(
    state: Any, tuning: Any, measured: Any, age: float, H: Array, residual: Array, variance: Array
) -> int:
    ax, ay, az = _arm(state, tuning, measured.kind)
    for k, arm in ((0, ax), (1, ay), (2, az)):
        expected = state.position[k] - age * state.velocity[k] + arm
        H[k, POSITION + k] = 1.0
        H[k, VELOCITY + k] = -age
        _swing(H, k, k, ax, ay, az)
        if measured.kind == GNSS:
            expected += state.offset[GNSS_OFFSET + k - _OFFSET_0]
            H[k, GNSS_OFFSET + k] = 1.0
        residual[k] = measured.value[k] - expected
        variance[k] = measured.variance[k]
    return 3


@part_kernel
def _velocity(
    state: Any, tuning: Any, measured: Any, H: Array, residual: Array, variance: Array
) -> int:
    ax, ay, az = three(tuning.gnss_arm)
    if measured.kind != GNSS:
        ax, ay, az = -tuning.imu_arm[0], -tuning.imu_arm[1], -tuning.imu_arm[2]
    wx, wy, wz = turn_rate(state)
    sx, sy, sz = cross(wx, wy, wz, ax, ay, az)
    x, y, z, w = four(state.rotation)
    sx, sy, sz = rotate_vector(x, y, z, w, sx, sy, sz)
    # The gyro bias in the swing of the arm is left out: below 1 mm/s for an arm of 0.1 m.
    for k, swing in ((0, sx), (1, sy), (2, sz)):
        H[k, VELOCITY + k] = 1.0
        _swing(H, k, k, sx, sy, sz)
        residual[k] = measured.value[3 + k] - (state.velocity[k] + swing)
        variance[k] = measured.variance[3 + k]
    return 3


@part_kernel
def _attitude(
    state: Any, measured: Any, age: float, H: Array, residual: Array, variance: Array
) -> int:
    x, y, z, w = four(state.rotation)
    rx, ry, rz = turn_rate(state)
    k = -0.5 * age
    x, y, z, w = turned(x, y, z, w, k * rx, k * ry, k * rz)
    mx, my, mz, mw = four(measured.value[3:7])
    # error = measured * conjugate(expected)
    ex = -mw * x + mx * w - my * z + mz * y
    ey = -mw * y + mx * z + my * w - mz * x
    ez = -mw * z - mx * y + my * x + mz * w
    ew = mw * w + mx * x + my * y + mz * z
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    factor = 2.0
    if length > 1e-9:
        factor = 2.0 * math.atan2(length, abs(ew)) / length
    if ew < 0.0:
        factor = -factor
    residual[0], residual[1], residual[2] = factor * ex, factor * ey, factor * ez
    for i in range(3):
        H[i, ROTATION + i] = 1.0
        variance[i] = measured.variance[3 + i]
    return 3


@part_kernel
def _pressure(
    state: Any, tuning: Any, measured: Any, age: float, H: Array, residual: Array, variance: Array
) -> int:
    x, y, z, w = four(state.rotation)
    ax, ay, az = three(tuning.pressure_arm)
    ax, ay, az = rotate_vector(x, y, z, w, ax, ay, az)
    H[0, POSITION + 2] = 1.0
    H[0, VELOCITY + 2] = -age
    _swing(H, 0, 2, ax, ay, az)
    H[0, PRESSURE_OFFSET] = 1.0
    height = state.position[2] - age * state.velocity[2] + az
    residual[0] = measured.value[0] - height - state.offset[PRESSURE_OFFSET - _OFFSET_0]
    variance[0] = measured.variance[0]
    return 1


@part_kernel
def _range(
    state: Any, tuning: Any, measured: Any, age: float, H: Array, residual: Array, variance: Array
) -> int:
    """Measures the height over the plane at value[1] by the slant range value[0].

    A tilt within the cone does not lengthen the range, as the nearest echo remains straight below;
    beyond it the range grows with the rest of the tilt (the error of the tilt is left out:
    millimetres).
    """
    x, y, z, w = four(state.rotation)
    ax, ay, az = three(tuning.range_axis)
    _, _, down = rotate_vector(x, y, z, w, ax, ay, az)
    tilt = math.acos(min(max(-down, -1.0), 1.0))
    if tilt > tuning.range_largest_tilt:
        return 0
    slant = math.cos(max(0.0, tilt - tuning.range_half_cone))
    ax, ay, az = three(tuning.range_arm)
    ax, ay, az = rotate_vector(x, y, z, w, ax, ay, az)
    H[0, POSITION + 2] = 1.0
    H[0, VELOCITY + 2] = -age
    _swing(H, 0, 2, ax, ay, az)
    height = state.position[2] - age * state.velocity[2] + az - measured.value[1]
    residual[0] = measured.value[0] * slant - height
    variance[0] = measured.variance[0] * slant * slant + tuning.ground_variance
    return 1


@part_kernel
def _heading(
    state: Any, tuning: Any, measured: Any, age: float, H: Array, residual: Array, variance: Array
) -> int:
    """Measures the angle between the horizontal parts of the measured and the known field.

    Only this angle is used: strength and dip of the field add little to the attitude from gravity,
    and nearby iron disturbs them first.
    """
    rx, ry, rz = turn_rate(state)
    x, y, z, w = four(tuning.magnetic_attitude)
    mx, my, mz = three(measured.value[0:3])
    mx, my, mz = rotate_vector(x, y, z, w, mx, my, mz)
    cx, cy, cz = cross(rx, ry, rz, mx, my, mz)
    x, y, z, w = four(state.rotation)
    mx, my, mz = rotate_vector(x, y, z, w, mx - age * cx, my - age * cy, mz - age * cz)
    fx, fy, fz = three(tuning.field)
    known = math.sqrt(fx * fx + fy * fy + fz * fz)
    strength = math.sqrt(mx * mx + my * my + mz * mz)
    if not abs(strength - known) <= tuning.field_tolerance * known:
        return 0
    across = fx * fx + fy * fy
    residual[0] = math.atan2(mx * fy - my * fx, mx * fx + my * fy)
    residual[0] += state.offset[HEADING_OFFSET - _OFFSET_0]
    dip = fz / across
    H[0, ROTATION] = -dip * fx
    H[0, ROTATION + 1] = -dip * fy
    H[0, ROTATION + 2] = 1.0
    H[0, HEADING_OFFSET] = -1.0
    variance[0] = measured.variance[0] / across
    return 1
