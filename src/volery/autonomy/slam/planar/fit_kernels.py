"""Matches a scan to a map by least squares, with the motion estimate as a prior."""

from __future__ import annotations

import math

import numpy as np

from volery.autonomy.slam.linear import eliminate
from volery.autonomy.slam.planar.map_kernels import (
    CELL_M,
    FEW,
    KIND,
    LINE,
    MX,
    MY,
    NX,
    NY,
    RX,
    RY,
    THICK,
    Grid,
)
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel

_TIGHT_M = 0.12
"""Final width of the gate."""
_SMALL_M, _SMALL_RAD = 1e-4, 2e-5


@inner_kernel
def _nearest(grid: Grid, sums: Array, corner: Array, x: float, y: float, gate: float) -> int:
    """Returns the cell whose returns lie nearest, searched by rings; -1: none within `gate`."""
    n = grid.shape[0]
    ci, cj = math.floor((x - corner[0]) / CELL_M), math.floor((y - corner[1]) / CELL_M)
    best, found = gate * gate, -1
    for ring in range(math.ceil(gate / CELL_M) + 1):
        inside = (ring - 1) * CELL_M
        if ring > 0 and inside > 0.0 and inside * inside > best:
            break
        for i in range(max(ci - ring, 0), min(ci + ring + 1, n)):
            edge = abs(i - ci) == ring
            j = cj - ring
            while j <= cj + ring:
                if 0 <= j < n and grid[i, j] >= 0:
                    k = grid[i, j]
                    dx, dy = sums[k, MX] - x, sums[k, MY] - y
                    if dx * dx + dy * dy < best:
                        best, found = dx * dx + dy * dy, k
                j += 1 if edge or ring == 0 else 2 * ring
    return found


@inner_kernel
def _add(
    row_x: float, row_y: float, row_yaw: float, error: float, weight: float, h: Array, g: Array
) -> None:
    g[0] += weight * row_x * error
    g[1] += weight * row_y * error
    g[2] += weight * row_yaw * error
    h[0, 0] += weight * row_x * row_x
    h[0, 1] += weight * row_x * row_y
    h[0, 2] += weight * row_x * row_yaw
    h[1, 1] += weight * row_y * row_y
    h[1, 2] += weight * row_y * row_yaw
    h[2, 2] += weight * row_yaw * row_yaw


@inner_kernel
def _gather(
    pose: Array,
    points: Array,
    grid: Grid,
    sums: Array,
    shapes: Array,
    corner: Array,
    gate: float,
    variance: float,
    h: Array,
    g: Array,
) -> float:
    """Fills the normal equations at a pose; returns the weighted number of matched points."""
    h[:], g[:] = 0.0, 0.0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    scale, met = 0.5 * gate, 0.0
    for k in range(points.shape[0]):
        lx, ly = c * points[k, 0] - s * points[k, 1], s * points[k, 0] + c * points[k, 1]
        x, y = pose[0] + lx, pose[1] + ly
        cell = _nearest(grid, sums, corner, x, y, gate)
        if cell < 0:
            continue
        shape = shapes[cell]
        dx, dy = x - shape[RX], y - shape[RY]
        spread = variance + shape[THICK]
        if shape[KIND] == LINE:
            nx, ny = shape[NX], shape[NY]
            error = nx * dx + ny * dy
            fits = 1.0 / (1.0 + (error / scale) ** 2) ** 2
            _add(nx, ny, ny * lx - nx * ly, error, fits / spread, h, g)
        elif shape[KIND] == FEW:
            fits = 0.5
        else:
            fits = 1.0 / (1.0 + (dx * dx + dy * dy) / (scale * scale)) ** 2
            _add(1.0, 0.0, -ly, dx, fits / spread, h, g)
            _add(0.0, 1.0, lx, dy, fits / spread, h, g)
        met += fits
    h[1, 0], h[2, 0], h[2, 1] = h[0, 1], h[0, 2], h[1, 2]
    return met


@inner_kernel
def _uncertainty(h: Array, g: Array, unclear: float) -> None:
    """Removes the information along the weaker axis that comes from rough walls alone."""
    a, b, d = h[0, 0], h[0, 1], h[1, 1]
    middle, half = 0.5 * (a + d), math.hypot(0.5 * (a - d), b)
    low, high = middle - half, middle + half
    if not high > 0.0:
        return
    keep = 0.0
    if low > 0.0:
        keep = math.sqrt(max(low - unclear * high, 0.0) / low)
    angle = 0.5 * math.atan2(2.0 * b, a - d) + 0.5 * math.pi
    vx, vy = math.cos(angle), math.sin(angle)
    loss = 1.0 - keep
    for i in range(3):  # from the right, then from the left: S h S
        part = h[i, 0] * vx + h[i, 1] * vy
        h[i, 0] -= loss * part * vx
        h[i, 1] -= loss * part * vy
    for j in range(3):
        part = h[0, j] * vx + h[1, j] * vy
        h[0, j] -= loss * part * vx
        h[1, j] -= loss * part * vy
    part = g[0] * vx + g[1] * vy
    g[0] -= loss * part * vx
    g[1] -= loss * part * vy


@kernel
def fit(
    pose: Array,
    expected: Array,
    certainty: Array,
    points: Array,
    grid: Grid,
    sums: Array,
    shapes: Array,
    corner: Array,
    gate: float,
    sigma: float,
    trust: float,
    pull: float,
    unclear: float,
    rounds: int,
    information: Array,
) -> float:
    """Moves `pose` (3,) of points (K, 2) to the best fit; returns the weighted matched points.

    expected, certainty: pose (3,) and information (3, 3) of the prior. pull: factor of the points'
    information relative to it. information: (3, 3), filled with the information of the points
    alone, scaled by `trust`.
    """
    h, g = np.zeros((3, 3)), np.zeros(3)
    left, right = np.empty((3, 3)), np.empty((3, 1))
    met, wide = 0.0, gate
    for turn in range(rounds):
        met = _gather(pose, points, grid, sums, shapes, corner, wide, sigma * sigma, h, g)
        _uncertainty(h, g, unclear)
        for i in range(3):
            g[i] *= pull
            for j in range(3):
                information[i, j] = trust * h[i, j]
                h[i, j] *= pull
        if turn == rounds - 1:
            break
        for i in range(3):
            right[i, 0] = -g[i]
            for j in range(3):
                right[i, 0] -= certainty[i, j] * (pose[j] - expected[j])
                left[i, j] = h[i, j] + certainty[i, j]
        if not eliminate(left, right):
            break
        for i in range(3):
            pose[i] += right[i, 0]
        moved = math.hypot(right[0, 0], right[1, 0])
        if wide <= _TIGHT_M and moved < _SMALL_M and abs(right[2, 0]) < _SMALL_RAD:
            break
        wide = max(0.7 * wide, _TIGHT_M)
    return met
