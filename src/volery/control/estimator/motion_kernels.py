"""Motion from IMU measurements, and the error transition along it.

The error of attitude is a rotation vector r in the map: true = exp(r) * estimated (the "global
angular error" of J. Sola, "Quaternion kinematics for the error-state Kalman filter", 2017, section
7). It does not turn with the vehicle, so that the error transition over any motion is a few
integrals (`records.FLOW`), updated at each measurement.
"""

from __future__ import annotations

from typing import Any

from volery.control.estimator.compiled import part_kernel
from volery.core.rotation_kernels import cross, rotate_vector
from volery.vehicle.airframe import GRAVITY
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import four, matrix_of, three, turned

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Motion = tuple[Vector, Vector, Quaternion, Vector]
"""Position m, velocity m/s, rotation map from body, specific force m/s^2; map frame."""


@inner_kernel
def travelled(
    motion: Motion, before: Any, reading: Any, gyro_bias: Vector, accel: Vector
) -> Motion:
    """Returns the motion at `reading`, from that at the measurement `before`.

    IMU measurements are momentary values: their mean holds for the time between them. accel: bias
    of the accelerometer.

    Where the axis of rotation turns, the mean leaves out (dt^2 / 6) w0 x w1 of each rotation
    vector, which does not average out: half of it is the coning of a rate that changes linearly (J.
    Bortz, "A new mathematical formulation for strapdown inertial navigation", 1971), half the error
    of the trapezoidal rule, -dt^3 / 12 w'', summed in the map.
    """
    (px, py, pz), (vx, vy, vz), (x, y, z, w), (ax, ay, az) = motion
    dt = (reading.stamp_ns - before.stamp_ns) * 1e-9
    fx, fy, fz = _unbiased(before.gyro, gyro_bias)
    lx, ly, lz = _unbiased(reading.gyro, gyro_bias)
    cx, cy, cz = cross(fx, fy, fz, lx, ly, lz)
    k, c = 0.25 * dt, dt * dt / 12.0  # halves: of the mean of two, of the sixth
    x, y, z, w = turned(
        x,
        y,
        z,
        w,
        k * (fx + lx) + c * cx,
        k * (fy + ly) + c * cy,
        k * (fz + lz) + c * cz,
    )
    rotation = (x, y, z, w)
    bx, by, bz = felt(rotation, reading, accel)
    half, third, sixth = 0.5 * dt, dt * dt / 3.0, dt * dt / 6.0  # linear between the readings
    return (
        (
            px + dt * vx + third * ax + sixth * bx,
            py + dt * vy + third * ay + sixth * by,
            pz + dt * vz + third * az + sixth * bz - half * dt * GRAVITY,
        ),
        (vx + half * (ax + bx), vy + half * (ay + by), vz + half * (az + bz) - dt * GRAVITY),
        rotation,
        (bx, by, bz),
    )


@inner_kernel
def _unbiased(gyro: Any, bias: Vector) -> Vector:
    """Returns the rates (3,) of a reading, rad/s, without their bias."""
    return gyro[0] - bias[0], gyro[1] - bias[1], gyro[2] - bias[2]


@inner_kernel
def felt(rotation: Quaternion, reading: Any, accel_bias: Vector) -> Vector:
    """Returns the specific force in the map, m/s^2, without its bias."""
    x, y, z, w = rotation
    fx, fy, fz = three(reading.accel)
    return rotate_vector(x, y, z, w, fx - accel_bias[0], fy - accel_bias[1], fz - accel_bias[2])


@inner_kernel
def motion_at_horizon(state: Any) -> Motion:
    """Returns the motion of a `FILTER` at its horizon, at the IMU."""
    rotation = four(state.rotation)
    force = felt(rotation, state.reading, three(state.accel_bias))
    return three(state.position), three(state.velocity), rotation, force


@part_kernel
def flow_on(flow: Any, dt: float, before: Motion, after: Motion) -> None:
    """Adds the motion between two measurements, `dt` s apart, to a `FLOW`."""
    half = 0.5 * dt
    x, y, z, w = before[2]
    first = matrix_of(x, y, z, w)
    x, y, z, w = after[2]
    second = matrix_of(x, y, z, w)
    ax = half * (before[3][0] + after[3][0])
    ay = half * (before[3][1] + after[3][1])
    az = half * (before[3][2] + after[3][2])
    for j in range(3):
        # rotation by the gyro bias of axis j, mean over the step
        mx = flow.turn[0, j] + half * first[j]
        my = flow.turn[1, j] + half * first[3 + j]
        mz = flow.turn[2, j] + half * first[6 + j]
        cx, cy, cz = cross(ax, ay, az, mx, my, mz)
        flow.gyro_displacement[0, j] += dt * (flow.gyro_speed[0, j] + 0.5 * cx)
        flow.gyro_displacement[1, j] += dt * (flow.gyro_speed[1, j] + 0.5 * cy)
        flow.gyro_displacement[2, j] += dt * (flow.gyro_speed[2, j] + 0.5 * cz)
        flow.gyro_speed[0, j] += cx
        flow.gyro_speed[1, j] += cy
        flow.gyro_speed[2, j] += cz
        for i in range(3):
            turn = half * (first[3 * i + j] + second[3 * i + j])
            flow.turn_integral[i, j] += dt * (flow.turn[i, j] + 0.5 * turn)
            flow.turn[i, j] += turn
    for axis, speed in ((0, ax), (1, ay), (2, az)):
        flow.displacement[axis] += dt * (flow.speed[axis] + 0.5 * speed)
        flow.speed[axis] += speed
    flow.duration += dt


@part_kernel
def add_saturation(flow: Any, dt: float, reading: Any, tuning: Any) -> None:
    """Adds what a reading at full scale leaves out, over `dt` s, to a `FLOW`.

    Such a reading is a lower bound. What is missing is taken as normal, with the full scale as its
    standard deviation on each axis.
    """
    if reading.gyro_cut:
        missing = dt * tuning.gyro_range
        flow.lost_turn += missing * missing
    if reading.accel_cut:
        missing = dt * tuning.accel_range
        flow.lost_speed += missing * missing


@part_kernel
def still(flow: Any) -> None:
    """Resets a `FLOW` to no motion."""
    flow.duration = 0.0
    flow.lost_turn = flow.lost_speed = 0.0
    for i in range(3):
        flow.speed[i] = flow.displacement[i] = 0.0
        for j in range(3):
            flow.turn[i, j] = flow.turn_integral[i, j] = 0.0
            flow.gyro_speed[i, j] = flow.gyro_displacement[i, j] = 0.0
