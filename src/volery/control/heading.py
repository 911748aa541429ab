"""The heading setpoint: direction of the x axis, seen from above."""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import four


@inner_kernel
def heading_of(estimate: Any) -> tuple[float, float]:
    """Returns cosine and sine of the present heading; (0, 0) if the x axis is vertical."""
    x, y, z, w = four(estimate.attitude)
    c, s = 1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y)
    n = math.sqrt(c * c + s * s)
    if n < 1e-6:
        return 0.0, 0.0
    return c / n, s / n


@inner_kernel
def turn_heading(control_state: Any, estimate: Any, gains: Any, rate: float) -> None:
    """Moves the heading setpoint by its rate, or towards its target; sets the feedforward rate.

    rate: rad/s at which the target itself turns.
    """
    c, s = control_state.heading[0], control_state.heading[1]
    max_step = gains.yaw_rate_limit * gains.tick
    if control_state.turning:
        step = min(max(control_state.yaw_rate_target * gains.tick, -max_step), max_step)
        hc, hs = heading_of(estimate)
        # wait for a vehicle that has fallen 30 degrees behind
        if c * hc + s * hs < 0.866 and step * (hc * s - hs * c) > 0.0:
            step = 0.0
    else:
        gc, gs = control_state.heading_target[0], control_state.heading_target[1]
        step = c * gs - s * gc  # the sine of the angle left
        if c * gc + s * gs < 0.0:
            step = math.copysign(1.0, step)
        step = min(max(gains.tick * (gains.yaw * step + rate), -max_step), max_step)
    # a turn by the small angle `step`, up to step^3 / 6, normalised by a Newton step
    turn = 1.0 - 0.5 * step * step
    c, s = c * turn - s * step, s * turn + c * step
    n = 1.5 - 0.5 * (c * c + s * s)
    control_state.heading[0], control_state.heading[1] = n * c, n * s
    control_state.yaw_rate = step * gains.inverse_tick
