"""Matches a set of uprights with others: by search, then by least squares."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.ground_kernels import add_ground, plane_at
from volery.autonomy.slam.inertial_kernels import STATE_NUMBERS, P, Q
from volery.autonomy.slam.linear import eliminate
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.matching_kernels import GROUND, UPRIGHT, gather
from volery.autonomy.slam.upright_kernels import add_upright
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel

OccupancyImage = NDArray[np.uint8]

_FOUR = (0, 1, 2, 5)
"""Components of position and rotation that gravity does not determine."""


@kernel
def draw(points: Array, cell: float, image: OccupancyImage) -> None:
    """Marks the cells of points (K, 2), and their neighbours, in `image` (n, n) at the origin."""
    n = image.shape[0]
    image[:] = 0
    for k in range(points.shape[0]):
        i = math.floor(points[k, 0] / cell) + n // 2
        j = math.floor(points[k, 1] / cell) + n // 2
        if not (1 <= i < n - 1 and 1 <= j < n - 1):
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                worth = 4 if di == 0 and dj == 0 else (2 if di * dj == 0 else 1)
                image[i + di, j + dj] = max(image[i + di, j + dj], worth)


@inner_kernel
def _count_at(points: Array, x: float, y: float, cell: float, image: OccupancyImage) -> int:
    n, count = image.shape[0], 0
    for k in range(points.shape[0]):
        i = math.floor((points[k, 0] + x) / cell) + n // 2
        j = math.floor((points[k, 1] + y) / cell) + n // 2
        if 0 <= i < n and 0 <= j < n and image[i, j] > 0:
            count += 1
    return count


@kernel
def count_drawn(points: Array, cell: float, image: OccupancyImage) -> int:
    """Returns how many of points (K, 2) lie in marked cells of a `image` around the origin."""
    return _count_at(points, 0.0, 0.0, cell, image)


@kernel
def fractions_around(
    one: Array,
    image: OccupancyImage,
    other: Array,
    other_image: OccupancyImage,
    cell: float,
    steps: Array,
    fractions: Array,
) -> None:
    """Fills `fractions` (K,): matched fraction after `one` (M, 2) moved by each of `steps` (K, 2).

    It is the mean of two: of points `one` in `image`, and of points `other` (N, 2), moved the
    opposite direction, in `other_image`, which shows `one`.
    """
    for k in range(steps.shape[0]):
        x, y = steps[k, 0], steps[k, 1]
        onwards = _count_at(one, x, y, cell, image) / one.shape[0]
        back = _count_at(other, -x, -y, cell, other_image) / other.shape[0]
        fractions[k] = 0.5 * (onwards + back)


@kernel
def search(
    points: Array,
    image: OccupancyImage,
    cell: float,
    middle: Array,
    window: Array,
    step_rad: float,
    best: Array,
    fractions: Array,
) -> float:
    """Finds the pose (3,) x, y, yaw of points (K, 2) in `image` with the best score.

    It tries `middle` (3,) +- `window` (3,), in steps of a cell and of `step_rad`; `fractions` gets
    the scores of all positions, each at its best heading. Returns the best score, 0 to 1.
    """
    n, count = image.shape[0], points.shape[0]
    wide, high = math.ceil(window[0] / cell), math.ceil(window[1] / cell)
    turns = math.ceil(window[2] / step_rad)
    fractions[:] = 0.0
    best_total = -1
    for t in range(-turns, turns + 1):
        yaw = middle[2] + t * step_rad
        c, s = math.cos(yaw), math.sin(yaw)
        for i in range(-wide, wide + 1):
            x = middle[0] + i * cell
            for j in range(-high, high + 1):
                y = middle[1] + j * cell
                total = 0
                for k in range(count):
                    a = math.floor((x + c * points[k, 0] - s * points[k, 1]) / cell) + n // 2
                    b = math.floor((y + s * points[k, 0] + c * points[k, 1]) / cell) + n // 2
                    if 0 <= a < n and 0 <= b < n:
                        total += image[a, b]
                fraction = total / (4.0 * max(count, 1))
                fractions[i + wide, j + high] = max(fractions[i + wide, j + high], fraction)
                if total > best_total:
                    best_total = total
                    best[0], best[1], best[2] = x, y, yaw
    return float(best_total / (4.0 * max(count, 1)))


@kernel
def draw_maps(points: Array, kinds: NDArray[np.int8], maps: Submaps) -> None:
    """Replaces the maps by points (K, 3)."""
    maps.upright_keys[:] = -1
    maps.ground_keys[:] = -1
    for k in range(points.shape[0]):
        if kinds[k] == UPRIGHT:
            add_upright(maps.upright_keys, maps.cells, points[k, 0], points[k, 1], points[k, 2])
        elif kinds[k] == GROUND:
            add_ground(maps.ground_keys, maps.sums, points[k, 0], points[k, 1], points[k, 2])


@kernel
def refine(
    pose: Array,
    points: Array,
    kinds: NDArray[np.int8],
    maps: Submaps,
    upright_variance: float,
    ground_variance: float,
    rounds: int,
    information: Array,
    fit: Array,
) -> bool:
    """Moves the pose (4,) x, y, z, yaw of points (K, 3) to the best fit with the maps.

    `information` (4, 4) and `fit` (4,) are those of the last round. Returns False if the fit is
    singular.
    """
    state, planes = np.zeros(STATE_NUMBERS), np.zeros((points.shape[0], 3))
    now = kinds.copy()
    all_six, gradient = np.empty((6, 6)), np.empty(6)
    left, right = np.empty((4, 4)), np.empty((4, 1))
    plane, flat = np.zeros(6), np.zeros(2)
    for turn in range(rounds):
        c, s = math.cos(pose[3]), math.sin(pose[3])
        state[P], state[P + 1], state[P + 2] = pose[0], pose[1], pose[2]
        state[Q + 2], state[Q + 3] = math.sin(0.5 * pose[3]), math.cos(0.5 * pose[3])
        for k in range(points.shape[0]):
            if kinds[k] != GROUND:
                continue
            x = pose[0] + c * points[k, 0] - s * points[k, 1]
            y = pose[1] + s * points[k, 0] + c * points[k, 1]
            known = plane_at(maps.ground_keys, maps.sums, x, y, 1, flat, plane)
            now[k] = GROUND if known >= 4 else 0
            planes[k, 0] = plane[0] - plane[1] * x - plane[2] * y
            planes[k, 1], planes[k, 2] = plane[1], plane[2]
        gather(
            state,
            points,
            now,
            planes,
            maps,
            upright_variance,
            ground_variance,
            all_six,
            gradient,
            fit,
        )
        for i in range(4):
            right[i, 0] = -gradient[_FOUR[i]]
            for k in range(4):
                left[i, k] = information[i, k] = all_six[_FOUR[i], _FOUR[k]]
            left[i, i] += 1e-6
        if turn == rounds - 1:
            return True
        if not eliminate(left, right):
            return False
        for i in range(4):
            pose[i] += right[i, 0]
    return True
