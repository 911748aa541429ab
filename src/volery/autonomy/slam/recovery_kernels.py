"""Searches attitude and position after a gap in the IMU data."""

from __future__ import annotations

import math

import numpy as np

from volery.autonomy.slam.ground_kernels import GROUND_CELL_M, GROUND_CELLS, key_of
from volery.autonomy.slam.inertial_kernels import P, rotation_matrix, turn_left
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.upright_kernels import CELL_M, CELLS, LAYER_M, LAYERS, MIN_RETURNS
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel, owning_kernel

_ON_GROUND_M = 0.35
_OVER_GROUND_M = 0.6
_FEWEST_GROUND, _FEWEST_UPRIGHTS = 60, 40
"""Min number of returns for a result."""
_PER_RAD2 = 0.3
"""Penalty of a rotation, per rad^2."""
_STEP_M, _STEP_RAD = 0.25, 0.05
_APART_M, _APART_RAD = 0.8, 0.2
"""Distances from the best pose beyond which a pose is another one."""


@kernel
def find_attitude(state: Array, points: Array, maps: Submaps, window_rad: float) -> float:
    """Rotates the attitude in `state` (19,) so that returns (K, 3) of the body fit the map.

    It tries rotations of up to `window_rad` rad about each axis, in steps of a sixth of it, then of
    a third of that. Returns the fraction of returns above known ground that lie on it or at an
    upright; 0: too few returns.
    """
    step, best, fraction = window_rad / 6.0, np.zeros(3), 0.0
    for level in range(2):
        best_worth, middle, count = -1.0, best.copy(), 6 if level == 0 else 3
        for i in range(-count, count + 1):
            for j in range(-count, count + 1):
                for k in range(-count, count + 1):
                    tried = state.copy()
                    x, y, z = middle[0] + i * step, middle[1] + j * step, middle[2] + k * step
                    turn_left(tried, x, y, z)
                    fits = _matched_fraction(tried, points, maps)
                    worth = fits - _PER_RAD2 * (x * x + y * y + z * z)
                    if fits > 0.0 and worth > best_worth:
                        best_worth, fraction = worth, fits
                        best[0], best[1], best[2] = x, y, z
        step /= 3.0
    turn_left(state, best[0], best[1], best[2])
    return fraction


@owning_kernel
def _matched_fraction(state: Array, points: Array, maps: Submaps) -> float:
    turn, fits, num_checked = np.empty((3, 3)), 0, 0
    rotation_matrix(state, turn)
    for n in range(points.shape[0]):
        bx, by, bz = points[n, 0], points[n, 1], points[n, 2]
        x = state[P] + turn[0, 0] * bx + turn[0, 1] * by + turn[0, 2] * bz
        y = state[P + 1] + turn[1, 0] * bx + turn[1, 1] * by + turn[1, 2] * bz
        z = state[P + 2] + turn[2, 0] * bx + turn[2, 1] * by + turn[2, 2] * bz
        over = _over_ground(maps, x, y, z)
        if math.isnan(over):
            continue
        num_checked += 1
        on_ground = abs(over) < _ON_GROUND_M
        if on_ground or (over > _OVER_GROUND_M and _stands(maps, x, y, z)):
            fits += 1
    return fits / num_checked if num_checked >= _FEWEST_GROUND else 0.0


@inner_kernel
def _over_ground(maps: Submaps, x: float, y: float, z: float) -> float:
    """Returns the height over the mean ground of a cell; nan if unknown."""
    i, j = math.floor(x / GROUND_CELL_M), math.floor(y / GROUND_CELL_M)
    a, b = i % GROUND_CELLS, j % GROUND_CELLS
    if maps.ground_keys[a, b] != key_of(i, j, 0):
        return math.nan
    return float(z - maps.sums[a, b, 3] / maps.sums[a, b, 0])


@inner_kernel
def _stands(maps: Submaps, x: float, y: float, z: float) -> bool:
    i, j, k = math.floor(x / CELL_M), math.floor(y / CELL_M), math.floor(z / LAYER_M)
    a, b, c = i % CELLS, j % CELLS, k % LAYERS
    is_known = maps.upright_keys[a, b, c] == key_of(i, j, k)
    return bool(is_known and maps.cells[a, b, c, 0] >= MIN_RETURNS)


@kernel
def find_position(
    points: Array,
    middle: Array,
    maps: Submaps,
    window_m: float,
    window_rad: float,
    found: Array,
) -> None:
    """Finds the rotation and shift that move uprights among returns (K, 3) m onto known ones.

    The returns are in the map frame; they rotate about the vertical through `middle` (3,) and shift
    horizontally. `found` (5,) gets x, y (m), the rotation (rad), the fraction of uprights that
    match, and the highest such fraction elsewhere; all zero if there are too few.
    """
    found[:] = 0.0
    uprights, count = np.empty_like(points), 0
    for n in range(points.shape[0]):
        over = _over_ground(maps, points[n, 0], points[n, 1], points[n, 2])
        if over > _OVER_GROUND_M:  # leaves out nan
            for axis in range(3):
                uprights[count, axis] = points[n, axis] - middle[axis]
            count += 1
    if count < _FEWEST_UPRIGHTS:
        return
    steps, turns = math.ceil(window_m / _STEP_M), math.ceil(window_rad / _STEP_RAD)
    wide, fractions = 2 * steps + 1, np.zeros((2 * turns + 1, 2 * steps + 1, 2 * steps + 1))
    for k in range(2 * turns + 1):
        c, s = math.cos((k - turns) * _STEP_RAD), math.sin((k - turns) * _STEP_RAD)
        for n in range(count):
            x = middle[0] + c * uprights[n, 0] - s * uprights[n, 1]
            y = middle[1] + s * uprights[n, 0] + c * uprights[n, 1]
            z = middle[2] + uprights[n, 2]
            for i in range(wide):
                for j in range(wide):
                    dx, dy = (i - steps) * _STEP_M, (j - steps) * _STEP_M
                    if _stands(maps, x + dx, y + dy, z):
                        fractions[k, i, j] += 1.0 / count
    _take_best(fractions, steps, turns, found)


@inner_kernel
def _take_best(fractions: Array, steps: int, turns: int, found: Array) -> None:
    bk = bi = bj = 0
    for k in range(fractions.shape[0]):
        for i in range(fractions.shape[1]):
            for j in range(fractions.shape[2]):
                if fractions[k, i, j] > fractions[bk, bi, bj]:
                    bk, bi, bj = k, i, j
    found[0], found[1] = (bi - steps) * _STEP_M, (bj - steps) * _STEP_M
    found[2], found[3] = (bk - turns) * _STEP_RAD, fractions[bk, bi, bj]
    for k in range(fractions.shape[0]):
        for i in range(fractions.shape[1]):
            for j in range(fractions.shape[2]):
                near = math.hypot(i - bi, j - bj) * _STEP_M < _APART_M
                if near and abs(k - bk) * _STEP_RAD < _APART_RAD:
                    continue
                found[4] = max(found[4], fractions[k, i, j])
