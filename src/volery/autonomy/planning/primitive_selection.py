"""Selects the primitive to fly: the cheapest of those that are safe."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planning.clearance import Clearance
from volery.autonomy.planning.cost_to_go import CostToGo
from volery.autonomy.planning.distances import Squares
from volery.autonomy.planning.primitives import PrimitiveCandidates
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel

Integers = NDArray[np.int64]

_STEP_S = 0.08
"""Time between checked points: 0.24 m at 3 m/s, a cell."""


class PrimitiveVerdicts(NamedTuple):
    """Verdict on each candidate, all (C,)."""

    nearest_m: Array
    """Min distance to an obstacle."""
    unknown: NDArray[np.bool_]
    """Whether it passes through unknown space."""
    max_acceleration_m_s2: Array
    """Max horizontal acceleration."""
    cost: Array
    """Cost to go at the end of the cruise, plus the cost of closeness to obstacles."""


def judge(
    candidates: PrimitiveCandidates,
    clearance: Clearance,
    costs: CostToGo,
    soft_m: float,
    near: float,
) -> PrimitiveVerdicts:
    """Checks each candidate along its whole length, until rest."""
    count = len(candidates.rise_s)
    verdicts = PrimitiveVerdicts(
        np.empty(count), np.empty(count, np.bool_), np.empty(count), np.empty(count)
    )
    _judge(
        *candidates.start,
        candidates.velocity,
        candidates.rise_s,
        candidates.cruise_s,
        candidates.brake_s,
        clearance.square,
        clearance.known,
        clearance.low,
        clearance.cell_m,
        costs.cost,
        soft_m,
        near,
        verdicts.nearest_m,
        verdicts.unknown,
        verdicts.max_acceleration_m_s2,
        verdicts.cost,
    )
    return verdicts


@kernel
def _judge(
    position: Array,
    velocity: Array,
    acceleration: Array,
    cruise_velocity: Array,
    rise_s: Array,
    cruise_s: Array,
    brake_s: Array,
    square: Squares,
    known: NDArray[np.bool_],
    low: Integers,
    cell: float,
    costs: Array,
    soft: float,
    near: float,
    nearest: Array,
    unknown: NDArray[np.bool_],
    max_acceleration: Array,
    cost: Array,
) -> None:
    nx, ny, nz = square.shape
    p, v, a = np.empty(3), np.empty(3), np.empty(3)
    q, w, rest = np.empty(3), np.empty(3), np.zeros(3)
    for c in range(len(rise_s)):
        total = rise_s[c] + cruise_s[c] + brake_s[c]
        steps = math.ceil(total / _STEP_S)
        min_distance, blind, peak, price = math.inf, False, 0.0, 0.0
        go = math.inf
        for step in range(steps + 1):
            time = min(step * _STEP_S, total)
            rising = min(time, rise_s[c])
            _change(
                position, velocity, acceleration, cruise_velocity[c], rise_s[c], rising, p, v, a
            )
            if time > rise_s[c]:
                _after_rise(time - rise_s[c], cruise_s[c], brake_s[c], p, v, a, q, w, rest)
            i = math.floor(p[0] / cell) - low[0]
            j = math.floor(p[1] / cell) - low[1]
            k = math.floor(p[2] / cell) - low[2]
            if not (0 <= i < nx and 0 <= j < ny and 0 <= k < nz):
                blind = True
                break
            distance = cell * math.sqrt(square[i, j, k])
            min_distance = min(min_distance, distance)
            blind |= not known[i, j, k]
            peak = max(peak, math.hypot(a[0], a[1]))
            if distance < soft:
                lack = (soft - distance) / soft
                price += near * lack * lack * math.hypot(v[0], v[1]) * _STEP_S
            if time <= rise_s[c] + cruise_s[c] + 0.5 * _STEP_S:
                go = costs[i, j]
        nearest[c], unknown[c], max_acceleration[c], cost[c] = min_distance, blind, peak, go + price


@inner_kernel
def _after_rise(
    t: float,
    cruise_s: float,
    brake_s: float,
    p: Array,
    v: Array,
    a: Array,
    q: Array,
    w: Array,
    rest: Array,
) -> None:
    """Advances the state at the end of the rise by `t`: it cruises, then brakes to rest.

    `q`, `w`: scratch for the start of the braking; `rest`: zeros.
    """
    cruised = min(t, cruise_s)
    for axis in range(3):
        p[axis] += v[axis] * cruised
        a[axis] = 0.0
    if t > cruise_s:
        for axis in range(3):
            q[axis], w[axis] = p[axis], v[axis]
        _change(q, w, rest, rest, brake_s, min(t - cruise_s, brake_s), p, v, a)


@inner_kernel
def _change(
    position: Array,
    velocity: Array,
    acceleration: Array,
    wanted: Array,
    duration: float,
    t: float,
    p: Array,
    v: Array,
    a: Array,
) -> None:
    """Computes `primitives.changed` into `p`, `v`, `a`."""
    for axis in range(3):
        v0, a0 = velocity[axis], acceleration[axis]
        dv = wanted[axis] - v0 - a0 * duration
        beta = (-12.0 * dv - 6.0 * duration * a0) / duration**3
        gamma = (6.0 * duration * dv + 2.0 * duration**2 * a0) / duration**3
        p[axis] = position[axis] + t * (v0 + t * (a0 / 2 + t * (gamma / 6 + t * beta / 24)))
        v[axis] = v0 + t * (a0 + t * (gamma / 2 + t * beta / 6))
        a[axis] = a0 + t * (gamma + t * beta / 2)
