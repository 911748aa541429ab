"""The inner layers: attitude to body rates at 250 Hz, rates to rotor speeds at each step.

The attitude error is split into tilt (the shortest turn that aligns the thrust axis) and the turn
about it, so that a large yaw error never spoils the tilt (D. Brescianini, R. D'Andrea, "Tilt-
prioritized quadrocopter attitude control", 2018). Rates are held by a proportional-integral law
on angular acceleration; the gyroscopic torque and the rotors' drag are fed forward, and integrals
do not grow while a rotor is at its limit.
"""

from __future__ import annotations

import math
from typing import Any

from volery.control.mixer import mix
from volery.control.setpoints import ControlLevel
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import four, three

_STOPPED = int(ControlLevel.STOPPED)
_ROTORS = int(ControlLevel.ROTORS)
_ATTITUDE = int(ControlLevel.ATTITUDE)


@inner_kernel
def hold_rates(control_state: Any, ox: float, oy: float, oz: float, gains: Any, dt: float) -> None:
    """Computes rotor speeds from rates setpoint and thrust; (ox, oy, oz): body rates, rad/s."""
    if control_state.level <= _ROTORS:
        max_speed = 0.0 if control_state.level == _STOPPED else _full_speed(control_state, gains)
        for r in range(gains.rotors):
            control_state.rotor_reference[r] = min(control_state.rotor_target[r], max_speed)
        return
    gx, gy, gz = three(gains.gyroscopic)
    ax = _angular_acceleration(control_state, gains, 0, ox, dt) + gx * oy * oz
    ay = _angular_acceleration(control_state, gains, 1, oy, dt) + gy * oz * ox
    az = _angular_acceleration(control_state, gains, 2, oz, dt) + gz * ox * oy
    mix(gains, control_state.thrust, ax, ay, az, control_state)


@inner_kernel
def _full_speed(control_state: Any, gains: Any) -> float:
    """Returns the speed of a rotor at full thrust, rad/s."""
    return math.sqrt(control_state.full_thrust * gains.inverse_thrust_constant)


@inner_kernel
def _angular_acceleration(
    control_state: Any, gains: Any, axis: int, rate: float, dt: float
) -> float:
    error = control_state.rates[axis] - rate
    integral = control_state.rate_integral[axis]
    if not (control_state.saturated and error * integral > 0.0):
        limit = gains.rate_integral_limit[axis]
        integral += gains.rate_integral[axis] * error * dt
        integral = min(max(integral, -limit), limit)
        control_state.rate_integral[axis] = integral
    wanted: float = (
        gains.rate_drag[axis] * control_state.rates[axis] + gains.rate[axis] * error + integral
    )
    return wanted


@inner_kernel
def hold_attitude(control_state: Any, estimate: Any, gains: Any) -> None:
    """Computes body rates that turn the present attitude into the setpoint.

    estimate: a record with `attitude`.
    """
    if control_state.level < _ATTITUDE:
        return
    x, y, z, w = four(estimate.attitude)
    sx, sy, sz, sw = four(control_state.attitude)
    # error = conjugate(present) * wanted
    ex = w * sx - x * sw - y * sz + z * sy
    ey = w * sy + x * sz - y * sw - z * sx
    ez = w * sz - x * sy + y * sx - z * sw
    ew = w * sw + x * sx + y * sy + z * sz
    # error = tilt * turn about z; n = cos(tilt / 2)
    n = math.sqrt(ez * ez + ew * ew)
    if n > 1e-6:
        k = 2.0 / n
        px = k * gains.attitude * (ew * ex - ez * ey)
        py = k * gains.attitude * (ez * ex + ew * ey)
        turn = k * gains.yaw * ez
        if ew < 0.0:
            turn = -turn
    else:  # upside down: all directions are equally short
        px, py, turn = 2.0 * gains.attitude, 0.0, 0.0
    limit = gains.rate_limit
    size = px * px + py * py
    if size > limit * limit:
        k = limit / math.sqrt(size)
        px *= k
        py *= k
    # the commanded turn is about the map's z: its components about the body's axes
    up_x, up_y = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w)
    up_z = 1.0 - 2.0 * (x * x + y * y)
    limit = gains.yaw_rate_limit
    turn = min(max(turn + control_state.yaw_rate * up_z, -limit), limit)
    control_state.rates[0] = px + control_state.yaw_rate * up_x
    control_state.rates[1] = py + control_state.yaw_rate * up_y
    control_state.rates[2] = turn
