"""Mixer: rotor speeds from thrust and angular acceleration, with priorities at the rotors' limits.

Thrusts are `allocation_matrix` times (thrust, torques); the gains' `by_thrust` and so on contain it
multiplied by the inertia. Where a thrust leaves a rotor's range, attitude has priority: roll and
pitch are scaled only where they alone exceed the range, then thrust is moved to where roll and
pitch fit, and yaw uses the rest.

A low battery reduces the rotors' thrust: the mixer distributes `control_state.full_thrust`, like an
autopilot with outputs relative to the present full throttle.
"""

from __future__ import annotations

import math
from typing import Any

from volery.core.simd import LANES, any_outside, lanes_at, magnitudes, put_lanes, roots
from volery.vehicle.compiled import inner_kernel


@inner_kernel
def mix(gains: Any, thrust: float, ax: float, ay: float, az: float, control_state: Any) -> None:
    """Writes rotor speeds to `control_state.rotor_reference`, rad/s.

    thrust: N. (ax, ay, az): angular acceleration by the rotors' torque, rad/s^2, FLU.
    """
    beyond = False
    for first in range(0, gains.rotors, LANES):
        f = (
            lanes_at(gains.by_thrust, first) * thrust
            + lanes_at(gains.by_roll, first) * ax
            + lanes_at(gains.by_pitch, first) * ay
            + lanes_at(gains.by_yaw, first) * az
        )
        # thrusts below zero are recomputed below
        speed = roots(magnitudes(f) * gains.inverse_thrust_constant)
        put_lanes(control_state.rotor_reference, first, speed)
        beyond |= any_outside(f, lanes_at(gains.min_thrusts, first), control_state.full_thrust)
    control_state.saturated = beyond
    if control_state.saturated:
        _mix_rotors(gains, thrust, ax, ay, az, control_state)


@inner_kernel
def _mix_rotors(
    gains: Any, thrust: float, ax: float, ay: float, az: float, control_state: Any
) -> None:
    """Mixes where a rotor's range is exceeded; see `mix`."""
    low, high = gains.idle_thrust, control_state.full_thrust
    # the largest fraction of roll and pitch at which a collective thrust keeps all rotors in range
    fraction = 1.0
    for a in range(gains.rotors):
        for b in range(gains.rotors):
            ca, cb = gains.by_thrust[a], gains.by_thrust[b]
            ua = gains.by_roll[a] * ax + gains.by_pitch[a] * ay
            ub = gains.by_roll[b] * ax + gains.by_pitch[b] * ay
            # low <= ca T + s ua and cb T + s ub <= high
            need = ub / cb - ua / ca
            room = high / cb - low / ca
            if need > room:
                fraction = min(fraction, max(room, 0.0) / need)
    low_limit, high_limit = -math.inf, math.inf
    for r in range(gains.rotors):
        c = gains.by_thrust[r]
        u = fraction * (gains.by_roll[r] * ax + gains.by_pitch[r] * ay)
        low_limit = max(low_limit, (low - u) / c)
        high_limit = min(high_limit, (high - u) / c)
    total = min(max(thrust, low_limit), high_limit)
    turn = 1.0
    for r in range(gains.rotors):
        f = gains.by_thrust[r] * total + fraction * (gains.by_roll[r] * ax + gains.by_pitch[r] * ay)
        control_state.rotor_reference[r] = f
        y = gains.by_yaw[r] * az
        if y > 0.0:
            turn = min(turn, max(high - f, 0.0) / y)
        elif y < 0.0:
            turn = min(turn, max(f - low, 0.0) / -y)
    for r in range(gains.rotors):
        f = control_state.rotor_reference[r] + turn * gains.by_yaw[r] * az
        f = min(max(f, low), high)
        control_state.rotor_reference[r] = math.sqrt(f * gains.inverse_thrust_constant)
