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
    """
    (px, py, pz), (vx, vy, vz), (x, y, z, w), (ax, ay, az) = motion
    dt = (reading.stamp_ns - before.stamp_ns) * 1e-9
    k = 0.25 * dt  # half of the mean of two
    x, y, z, w = turned(
        x,
        y,
        z,
        w,
        k * (before.gyro[0] + reading.gyro[0] - 2.0 * gyro_bias[0]),
        k * (before.gyro[1] + reading.gyro[1] - 2.0 * gyro_bias[1]),
        k * (before.gyro[2] + reading.gyro[2] - 2.0 * gyro_bias[2]),
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
        flow.gyro_way[0, j] += dt * (flow.gyro_speed[0, j] + 0.5 * cx)
        flow.gyro_way[1, j] += dt * (flow.gyro_speed[1, j] + 0.5 * cy)
        flow.gyro_way[2, j] += dt * (flow.gyro_speed[2, j] + 0.5 * cz)
        flow.gyro_speed[0, j] += cx
        flow.gyro_speed[1, j] += cy
        flow.gyro_speed[2, j] += cz
        for i in range(3):
            turn = half * (first[3 * i + j] + second[3 * i + j])
            flow.turn_way[i, j] += dt * (flow.turn[i, j] + 0.5 * turn)
            flow.turn[i, j] += turn
    for axis, speed in ((0, ax), (1, ay), (2, az)):
        flow.way[axis] += dt * (flow.speed[axis] + 0.5 * speed)
        flow.speed[axis] += speed
    flow.duration += dt


@part_kernel
def still(flow: Any) -> None:
    """Resets a `FLOW` to no motion."""
    flow.duration = 0.0
    for i in range(3):
        flow.speed[i] = flow.way[i] = 0.0
        for j in range(3):
            flow.turn[i, j] = flow.turn_way[i, j] = 0.0
            flow.gyro_speed[i, j] = flow.gyro_way[i, j] = 0.0
