"""Filter update by one sweep: classification of returns, and their information on the pose.

The update is that of an iterated error-state Kalman filter in the form for many measurements (W. Xu
and F. Zhang, FAST-LIO, RA-L 2021): with prior P, and information A and gradient g of all returns on
position and attitude, only a 6 by 6 system is solved.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.ground_kernels import Keys, add_ground, plane_at
from volery.autonomy.slam.inertial_kernels import STATES, P, Q, add_error, rotation_matrix
from volery.autonomy.slam.linear import eliminate
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.upright_kernels import add_upright, nearest_upright
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel, owning_kernel
from volery.core.rotation_kernels import quaternion_product, rotate_vector

Kinds = NDArray[np.int8]

LEFT_OUT, UPRIGHT, GROUND, NEW_GROUND = 0, 1, 2, 3
_ON_GROUND_M = 0.25
"""Distance to the plane of known ground within which a return is ground."""
_OVER_GROUND_M = 0.5
"""Height below which no return counts as upright: grass, feet of trees, errors of the ground
map.
"""
_PER_M = 0.12
"""Growth of the height error of unobserved ground with distance, per metre (modelling choice)."""
_LEVEL_M = 0.3
"""Without known ground, returns so much lower than the vehicle may be ground."""
_YOUNG = 25
"""Known ground cells around the vehicle below which ground may begin away from them."""
_GATE_M = 0.6
_ROBUST = 2.0
"""Normalized distance at which a return's weight is one half (Cauchy's weight)."""


@inner_kernel
def _placed(state: Array, turn: Array, point: Array) -> tuple[float, float, float]:
    """Returns a point (3,) of the body in the world; `turn` is the matrix of the attitude."""
    bx, by, bz = point[0], point[1], point[2]
    return (
        state[P] + turn[0, 0] * bx + turn[0, 1] * by + turn[0, 2] * bz,
        state[P + 1] + turn[1, 0] * bx + turn[1, 1] * by + turn[1, 2] * bz,
        state[P + 2] + turn[2, 0] * bx + turn[2, 1] * by + turn[2, 2] * bz,
    )


@kernel
def classify(
    points: Array,
    state: Array,
    keys: Keys,
    sums: Array,
    broad: Array,
    known_broad: int,
    kinds: Kinds,
    planes: Array,
) -> None:
    """Classifies returns (K, 3); `planes` (K, 3) gets height and slopes for ground returns.

    `broad` (6,) is the ground plane around the vehicle, from `known_broad` cells.
    """
    turn = np.empty((3, 3))
    rotation_matrix(state, turn)
    plane = np.zeros(6)
    for n in range(points.shape[0]):
        x, y, z = _placed(state, turn, points[n])
        kinds[n] = UPRIGHT
        if known_broad == 0:
            if z < state[P + 2] - _LEVEL_M:
                kinds[n] = LEFT_OUT
            continue
        away = math.hypot(x - broad[3], y - broad[4])
        over = z - broad[5] - broad[1] * (x - broad[3]) - broad[2] * (y - broad[4])
        if over > 1.0 + 0.3 * away:
            continue
        known = plane_at(keys, sums, x, y, 2, broad[1:3], plane)
        if known == 0:
            if over < _OVER_GROUND_M + _PER_M * max(away - 4.0, 0.0):
                is_first = known_broad < _YOUNG and away < 6.0 and abs(over) < 0.1 + _PER_M * away
                kinds[n] = NEW_GROUND if is_first else LEFT_OUT
            continue
        off = z - plane[0]
        near = math.hypot(x - plane[3], y - plane[4])
        if abs(off) < _ON_GROUND_M + (0.1 if known < 4 else 0.0):
            kinds[n] = GROUND if known >= 4 and near < 1.5 else NEW_GROUND
            planes[n, 0], planes[n, 1], planes[n, 2] = plane[0], plane[1], plane[2]
            planes[n, 0] -= plane[1] * x + plane[2] * y
        elif off < _OVER_GROUND_M:
            kinds[n] = LEFT_OUT


@inner_kernel
def _add_row(information: Array, gradient: Array, row: Array, weight: float, off: float) -> None:
    for i in range(6):
        gradient[i] += row[i] * weight * off
        for k in range(i + 1):
            information[i, k] += row[i] * weight * row[k]


@inner_kernel
def _fill_row(row: Array, nx: float, ny: float, nz: float, ax: float, ay: float, az: float) -> None:
    """Fills the derivative along n of a point at (ax, ay, az) from the vehicle, by pose."""
    row[0], row[1], row[2] = nx, ny, nz
    row[3] = ay * nz - az * ny
    row[4] = az * nx - ax * nz
    row[5] = ax * ny - ay * nx


@owning_kernel
def gather(
    state: Array,
    points: Array,
    kinds: Kinds,
    planes: Array,
    maps: Submaps,
    upright_variance: float,
    ground_variance: float,
    information: Array,
    gradient: Array,
    sums: Array,
) -> None:
    """Sums up all returns; `sums` (4,): matched uprights, of how many, ground, cost."""
    turn, row, found = np.empty((3, 3)), np.empty(6), np.empty(5)
    rotation_matrix(state, turn)
    information[:] = 0.0
    gradient[:] = 0.0
    sums[:] = 0.0
    for n in range(points.shape[0]):
        kind = kinds[n]
        if kind in (LEFT_OUT, NEW_GROUND):
            continue
        x, y, z = _placed(state, turn, points[n])
        ax, ay, az = x - state[P], y - state[P + 1], z - state[P + 2]
        if kind == GROUND:
            sx, sy = planes[n, 1], planes[n, 2]
            off = z - planes[n, 0] - sx * x - sy * y
            weight = 1.0 / (ground_variance * (1.0 + off * off / (4.0 * ground_variance)))
            _fill_row(row, -sx, -sy, 1.0, ax, ay, az)
            _add_row(information, gradient, row, weight, off)
            sums[2] += 1.0
            continue
        sums[1] += 1.0
        if not nearest_upright(maps.upright_keys, maps.cells, x, y, z, _GATE_M, found):
            continue
        dx, dy = x - found[0], y - found[1]
        cxx, cxy, cyy = found[2] + upright_variance, found[3], found[4] + upright_variance
        under = cxx * cyy - cxy * cxy
        wxx, wxy, wyy = cyy / under, -cxy / under, cxx / under
        square = dx * (wxx * dx + wxy * dy) + dy * (wxy * dx + wyy * dy)
        robust = 1.0 / (1.0 + square / (_ROBUST * _ROBUST))
        sums[0] += robust
        sums[3] += square * robust
        # W = L L': two independent rows.
        l11 = math.sqrt(wxx)
        l21 = wxy / l11
        l22 = math.sqrt(max(wyy - l21 * l21, 0.0))
        _fill_row(row, l11, l21, 0.0, ax, ay, az)
        _add_row(information, gradient, row, robust, l11 * dx + l21 * dy)
        _fill_row(row, 0.0, l22, 0.0, ax, ay, az)
        _add_row(information, gradient, row, robust, l22 * dy)
    for i in range(6):
        for k in range(i):
            information[k, i] = information[i, k]


@inner_kernel
def _state_index(i: int) -> int:
    """Returns the row among the 17 errors of one of the six of the pose."""
    return i if i < 3 else i + 3


@inner_kernel
def _copy(state: Array, into: Array) -> None:
    for i in range(len(state)):  # an assignment of arrays takes seconds to compile
        into[i] = state[i]


@kernel
def update(
    state: Array,
    covariance: Array,
    points: Array,
    kinds: Kinds,
    planes: Array,
    maps: Submaps,
    upright_variance: float,
    ground_variance: float,
    trust: float,
    rounds: int,
    information: Array,
    sums: Array,
) -> bool:
    """Corrects state (19,) and covariance (17, 17) by classified returns; False: unsolvable.

    `information` (6, 6) and `sums` (4,) are those of the last round; see `gather`.
    """
    prior, error = state.copy(), np.zeros(STATES)
    gradient, right, left = np.empty(6), np.empty((6, 1)), np.empty((6, 6))
    for _ in range(rounds):
        gather(
            state,
            points,
            kinds,
            planes,
            maps,
            upright_variance,
            ground_variance,
            information,
            gradient,
            sums,
        )
        for i in range(6):
            right[i, 0] = -trust * gradient[i]
            for k in range(6):
                right[i, 0] += trust * information[i, k] * error[_state_index(k)]
                left[i, k] = 1.0 if i == k else 0.0
                for j in range(6):
                    left[i, k] += (
                        trust * information[i, j] * covariance[_state_index(j), _state_index(k)]
                    )
        if not eliminate(left, right):
            _copy(prior, state)
            return False
        for i in range(STATES):
            error[i] = 0.0
            for k in range(6):
                error[i] += covariance[i, _state_index(k)] * right[k, 0]
        _copy(prior, state)
        add_error(state, error)
    return _shrink(covariance, information, trust)


@owning_kernel
def _shrink(covariance: Array, information: Array, trust: float) -> bool:
    """Computes P <- P - P S' (1 + A S P S')^-1 A S P."""
    left, right = np.empty((6, 6)), np.empty((6, STATES))
    for i in range(6):
        for k in range(6):
            left[i, k] = 1.0 if i == k else 0.0
            for j in range(6):
                left[i, k] += (
                    trust * information[i, j] * covariance[_state_index(j), _state_index(k)]
                )
        for k in range(STATES):
            right[i, k] = 0.0
            for j in range(6):
                right[i, k] += trust * information[i, j] * covariance[_state_index(j), k]
    if not eliminate(left, right):
        return False
    less = np.zeros((STATES, STATES))
    for i in range(STATES):
        for k in range(STATES):
            for j in range(6):
                less[i, k] += covariance[i, _state_index(j)] * right[j, k]
    for i in range(STATES):
        for k in range(i + 1):
            covariance[i, k] -= 0.5 * (less[i, k] + less[k, i])
            covariance[k, i] = covariance[i, k]
    return True


@kernel
def insert(points: Array, kinds: Kinds, state: Array, is_upright: bool, maps: Submaps) -> None:
    """Inserts classified returns into the maps; uprights only if `is_upright`."""
    turn = np.empty((3, 3))
    rotation_matrix(state, turn)
    for n in range(points.shape[0]):
        kind = kinds[n]
        if kind == LEFT_OUT or (kind == UPRIGHT and not is_upright):
            continue
        x, y, z = _placed(state, turn, points[n])
        if kind == UPRIGHT:
            add_upright(maps.upright_keys, maps.cells, x, y, z)
        else:
            add_ground(maps.ground_keys, maps.sums, x, y, z)


@kernel
def broad_plane(
    state: Array, keys: Keys, sums: Array, around: int, slope: Array, plane: Array
) -> int:
    """Calls `plane_at` below the vehicle, for Python."""
    return plane_at(keys, sums, state[P], state[P + 1], around, slope, plane)


@kernel
def seed_ground(keys: Keys, sums: Array, x: float, y: float, z: float) -> None:
    """Calls `add_ground`, for Python."""
    add_ground(keys, sums, x, y, z)


@kernel
def carry_along(states: Array, before: Array, after: Array) -> None:
    """Corrects earlier states (M, 19) rigidly, like the newest one: from `before` to `after`."""
    bx, by, bz, bw = -before[Q], -before[Q + 1], -before[Q + 2], before[Q + 3]
    ax, ay, az, aw = after[Q], after[Q + 1], after[Q + 2], after[Q + 3]
    tx, ty, tz, tw = quaternion_product(ax, ay, az, aw, bx, by, bz, bw)
    for m in range(states.shape[0]):
        s = states[m]
        px, py, pz = s[P] - before[P], s[P + 1] - before[P + 1], s[P + 2] - before[P + 2]
        px, py, pz = rotate_vector(tx, ty, tz, tw, px, py, pz)
        s[P], s[P + 1], s[P + 2] = after[P] + px, after[P + 1] + py, after[P + 2] + pz
        qx, qy, qz, qw = s[Q], s[Q + 1], s[Q + 2], s[Q + 3]
        s[Q], s[Q + 1], s[Q + 2], s[Q + 3] = quaternion_product(tx, ty, tz, tw, qx, qy, qz, qw)
