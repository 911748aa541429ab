"""From thrust and torque to rotor speeds, and what gives way when a rotor has no more to give.

Thrusts are `allocation_matrix` times (thrust, torques). Where that leaves a rotor's range, the
vehicle keeps its attitude first: roll and pitch are scaled only where they alone exceed the range,
thrust then moves to where roll and pitch fit, and yaw gets what room is left.
A battery that sags leaves the rotors less: the mixer shares out `pilot.full_thrust`, as an
autopilot does whose outputs are shares of the present full throttle.
"""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.compiled import inner_kernel


@inner_kernel
def mix(gains: Any, thrust: float, tx: float, ty: float, tz: float, pilot: Any) -> None:
    """Rotor speeds into `pilot.rotor_reference`, rad/s, for a thrust (N) and torques (N m), FLU."""
    lowest, highest = math.inf, -math.inf
    k = gains.inverse_thrust_constant
    for r in range(gains.rotors):
        f = (
            gains.allocation[r, 0] * thrust
            + gains.allocation[r, 1] * tx
            + gains.allocation[r, 2] * ty
            + gains.allocation[r, 3] * tz
        )
        pilot.rotor_reference[r] = math.sqrt(abs(f) * k)  # below zero: done again below
        lowest = min(lowest, f)
        highest = max(highest, f)
    pilot.saturated = not (gains.idle_thrust <= lowest and highest <= pilot.full_thrust)
    if pilot.saturated:
        _share(gains, thrust, tx, ty, tz, pilot)


@inner_kernel
def _share(gains: Any, thrust: float, tx: float, ty: float, tz: float, pilot: Any) -> None:
    """Like `mix` where a rotor's range is exceeded."""
    low, high = gains.idle_thrust, pilot.full_thrust
    # the largest share of roll and pitch for which some collective thrust keeps all rotors in range
    share = 1.0
    for a in range(gains.rotors):
        for b in range(gains.rotors):
            ca, cb = gains.allocation[a, 0], gains.allocation[b, 0]
            ua = gains.allocation[a, 1] * tx + gains.allocation[a, 2] * ty
            ub = gains.allocation[b, 1] * tx + gains.allocation[b, 2] * ty
            # low <= ca T + s ua and cb T + s ub <= high
            need = ub / cb - ua / ca
            room = high / cb - low / ca
            if need > room:
                share = min(share, max(room, 0.0) / need)
    least, most = -math.inf, math.inf
    for r in range(gains.rotors):
        c = gains.allocation[r, 0]
        u = share * (gains.allocation[r, 1] * tx + gains.allocation[r, 2] * ty)
        least = max(least, (low - u) / c)
        most = min(most, (high - u) / c)
    total = min(max(thrust, least), most)
    turn = 1.0
    for r in range(gains.rotors):
        f = gains.allocation[r, 0] * total + share * (
            gains.allocation[r, 1] * tx + gains.allocation[r, 2] * ty
        )
        pilot.rotor_reference[r] = f
        y = gains.allocation[r, 3] * tz
        if y > 0.0:
            turn = min(turn, max(high - f, 0.0) / y)
        elif y < 0.0:
            turn = min(turn, max(f - low, 0.0) / -y)
    for r in range(gains.rotors):
        f = pilot.rotor_reference[r] + turn * gains.allocation[r, 3] * tz
        f = min(max(f, low), high)
        pilot.rotor_reference[r] = math.sqrt(f * gains.inverse_thrust_constant)
