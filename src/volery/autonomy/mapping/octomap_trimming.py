"""Trims an OctoMap to the surroundings of a position.

octomap's own `deleteNode` frees only the topmost node of a branch, so the stream is trimmed
instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.octomap_stream import DEPTH
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.errors import DataFileError

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int32]

BLOCK_CELLS = 32
"""Size of the cubes in which branches are retained or dropped: 6.4 m at 0.2 m."""
_HALF = 1 << (DEPTH - 1)
_STACK = 8 * DEPTH


def trimmed(data: Bytes, middle_cells: Array, radius_cells: float) -> Bytes:
    """Returns a full stream without the blocks whose centre is farther than a horizontal radius.

    middle_cells: (3,), in cells. Raises DataFileError if the stream is invalid.
    """
    nodes = len(data) // 5
    keep, size = np.zeros(nodes, np.bool_), np.empty(nodes, np.int32)
    out = np.empty(len(data), np.uint8)
    if not _choose(data, middle_cells, radius_cells, keep):
        raise DataFileError(f"not a full OctoMap: the stream of {len(data)} bytes is broken")
    _spread_up(data, keep, size)
    return out[: _cut(data, keep, size, out)].copy()


@kernel
def _choose(data: Bytes, middle: Array, radius: float, keep: NDArray[np.bool_]) -> bool:
    """Marks, forwards, blocks and leaves above their level that are near enough."""
    nodes = len(keep)
    if nodes == 0:
        return True
    stack = np.empty((_STACK, 4), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = -_HALF, -_HALF, -_HALF, 2 * _HALF
    top, node = 1, 0
    while top > 0:
        top -= 1
        x, y, z, width = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        if node >= nodes or width < 1:
            return False
        children = data[5 * node + 4]
        if width <= BLOCK_CELLS or children == 0:
            block = width // 2 if width > BLOCK_CELLS else BLOCK_CELLS // 2
            dx = (x // (2 * block)) * 2 * block + block - middle[0]
            dy = (y // (2 * block)) * 2 * block + block - middle[1]
            keep[node] = dx * dx + dy * dy <= radius * radius
        half = width // 2
        for child in range(7, -1, -1):
            if (children >> child) & 1:
                stack[top, 0] = x + half * (child & 1)
                stack[top, 1] = y + half * ((child >> 1) & 1)
                stack[top, 2] = z + half * (child >> 2)
                stack[top, 3] = half
                top += 1
        node += 1
    return node == nodes


@kernel
def _spread_up(data: Bytes, keep: NDArray[np.bool_], size: Integers) -> None:
    """Marks, backwards, a branch if one of its children is marked."""
    for node in range(len(keep) - 1, -1, -1):
        children = data[5 * node + 4]
        child = node + 1
        for k in range(8):
            if (children >> k) & 1:
                keep[node] |= keep[child]
                child += size[child]
        size[node] = child - node


@kernel
def _cut(data: Bytes, keep: NDArray[np.bool_], size: Integers, out: Bytes) -> int:
    """Writes the marked nodes; returns the length."""
    length, node = 0, 0
    while node < len(keep):
        if not keep[node]:
            node += size[node]
            continue
        at, mask, child = 5 * node, 0, node + 1
        for k in range(8):
            if (data[at + 4] >> k) & 1:
                if keep[child]:
                    mask |= 1 << k
                child += size[child]
        for k in range(4):
            out[length + k] = data[at + k]
        out[length + 4] = mask
        length += 5
        node += 1
    return length
