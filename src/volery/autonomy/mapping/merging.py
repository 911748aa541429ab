"""Merges the maps of several UAVs into one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.octomap_stream import DEPTH, Voxels
from volery.autonomy.perception.motion_history import Pose
from volery.core import rotations
from volery.core.compiled import kernel
from volery.core.errors import PlanError
from volery.core.vectors import norm

Bytes = NDArray[np.uint8]
Codes = NDArray[np.int64]

_HALF = 1 << (DEPTH - 1)
_STACK = 8 * DEPTH
_SUB = 2
"""Votes of a rotated cell along each axis: points half a cell apart leave no gap."""
_HALVES = (
    (16, 0x0000FF0000FF),
    (8, 0x00F00F00F00F),
    (4, 0x0C30C30C30C3),
    (2, 0x249249249249),
)
_LEVEL_RAD, _LEVEL_CELLS = 1e-4, 1e-3
"""Rotation and translation below which a pose counts as identity."""


class PlacedMap(NamedTuple):
    """A map and its frame's pose in the merged map; None: identity."""

    voxels: Voxels
    placement: Pose | None = None


def merged(maps: Sequence[PlacedMap], resolution_m: float, max_cells: int) -> Bytes:
    """Returns the binary stream of one map in which each cell has the majority's value.

    A tie is an occupied cell. Raises PlanError if the maps have more than `max_cells` cells, or a
    map exceeds the range of an OctoMap.
    """
    cells = sum(int((m.voxels.side.astype(np.int64) ** 3).sum()) for m in maps)
    if cells > max_cells:
        raise PlanError(f"the maps have {cells} cells together; at most {max_cells} are merged")
    codes, votes = [], []
    for placed in maps:
        cell, occupied = _cells(placed.voxels)
        code, weight = _placed(cell, placed.placement, resolution_m)
        codes.append(code)
        votes.append(np.repeat(np.where(occupied, weight, -weight), len(code) // max(len(cell), 1)))
    if not codes or not sum(len(code) for code in codes):
        return np.zeros(0, np.uint8)
    unique, row = np.unique(np.concatenate(codes), return_inverse=True)
    balance = np.bincount(row, np.concatenate(votes), len(unique))
    return encode_cells(unique, balance >= 0.0)


def encode_cells(codes: Codes, occupied: NDArray[np.bool_]) -> Bytes:
    """Returns the binary stream of cells in Morton order (x lowest), equal ones joined."""
    if len(codes) == 0:
        return np.zeros(0, np.uint8)
    before = np.concatenate([[0], np.cumsum(occupied, dtype=np.int64)])
    out = np.empty(2 * DEPTH * (len(codes) + 1), np.uint8)
    return out[: _encode(codes, before, out)].copy()


def morton_codes(cells: NDArray[np.int64]) -> Codes:
    """Returns codes (K,) of cells (K, 3) counted from the tree's centre.

    Raises PlanError beyond the range of an OctoMap.
    """
    key = cells + _HALF
    if ((key < 0) | (key >= 2 * _HALF)).any():
        raise PlanError("a map lies beyond the 65,536 cells that an OctoMap can hold")
    return _spread(key[:, 0]) | _spread(key[:, 1]) << 1 | _spread(key[:, 2]) << 2


def _spread(value: Codes) -> Codes:
    """Inserts two zero bits after each of 16 (S. E. Anderson, "Bit Twiddling Hacks")."""
    v = value.astype(np.int64)
    for shift, mask in _HALVES:
        v = (v | v << shift) & mask
    return v


def _cells(voxels: Voxels) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Returns all finest cells (K, 3) of cubes, and whether they are occupied."""
    parts, labels = [], []
    for side in np.unique(voxels.side).tolist():
        rows = voxels.side == side
        steps = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
        corner = voxels.corner[rows].astype(np.int64)
        parts.append((corner[:, None] + steps).reshape(-1, 3))
        labels.append(np.repeat(voxels.occupied[rows], len(steps)))
    if not parts:
        return np.zeros((0, 3), np.int64), np.zeros(0, np.bool_)
    return np.concatenate(parts), np.concatenate(labels)


def _placed(
    cells: NDArray[np.int64], placement: Pose | None, resolution_m: float
) -> tuple[Codes, float]:
    """Returns codes of cells in the merged frame, one or `_SUB`^3 of each, and their weight."""
    if placement is None or _is_none(placement, resolution_m):
        return morton_codes(cells), float(_SUB**3)
    inside = (np.arange(_SUB) + 0.5) / _SUB
    steps = np.stack(np.meshgrid(inside, inside, inside, indexing="ij"), -1).reshape(-1, 3)
    points = (cells[:, None] + steps).reshape(-1, 3)
    turned = points @ rotations.matrix(placement.attitude).T + placement.position / resolution_m
    return morton_codes(np.floor(turned).astype(np.int64)), 1.0


def _is_none(placement: Pose, resolution_m: float) -> bool:
    turn = norm(rotations.logarithm(placement.attitude))
    distance = norm(placement.position) / resolution_m
    return turn < _LEVEL_RAD and distance < _LEVEL_CELLS


@kernel
def _encode(codes: Codes, before: Codes, out: Bytes) -> int:
    """Encodes depth first; `before`: number of occupied cells before each."""
    stack = np.empty((_STACK, 3), np.int64)  # first and last cell of a node, bits below its own
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, len(codes), 3 * DEPTH
    top, length = 1, 0
    while top > 0:
        top -= 1
        first, last, shift = stack[top, 0], stack[top, 1], stack[top, 2] - 3
        base = (codes[first] >> (shift + 3)) << (shift + 3)
        bits = 0
        ends = np.empty(9, np.int64)
        ends[0] = first
        for child in range(8):
            until = base + ((child + 1) << shift)
            ends[child + 1] = ends[child] + np.searchsorted(codes[ends[child] : last], until)
        for child in range(7, -1, -1):
            a, b = ends[child], ends[child + 1]
            if a == b:
                continue
            taken = before[b] - before[a]
            if b - a == 1 << shift and (taken == 0 or taken == b - a):
                bits |= (2 if taken > 0 else 1) << (2 * child)
            else:
                bits |= 3 << (2 * child)
                stack[top, 0], stack[top, 1], stack[top, 2] = a, b, shift
                top += 1
        out[length], out[length + 1] = bits & 255, bits >> 8
        length += 2
    return length
