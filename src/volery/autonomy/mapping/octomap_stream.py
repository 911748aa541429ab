"""Decodes OctoMap's byte streams to arrays of cubes, and encodes them.

After `octomap::OcTree::writeBinaryData` and `OcTreeDataNode::writeData` (A. Hornung et al.,
"OctoMap: an efficient probabilistic 3D mapping framework based on octrees", Autonomous Robots
2013). The tree has 16 levels; a node's children are in the order x + 2 y + 4 z of their halves. In
a binary stream a node with children is 16 bits, two a child, the first child's lowest: 0 unknown, 1
free, 2 occupied, 3 has children of its own, which follow depth first. In a full stream each node is
a log-odds (float32) and a byte that flags the children that follow, depth first too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import kernel
from volery.core.errors import DataFileError

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int32]

DEPTH = 16
"""Levels of an OcTree; a cube of level 0 is one cell wide, the root 2^16 cells."""
_HALF = 1 << (DEPTH - 1)
_STACK = 8 * DEPTH
_UNKNOWN, _FREE, _OCCUPIED, _INNER = 0, 1, 2, 3


class Voxels(NamedTuple):
    """Known cubes of a map, in cells of its resolution."""

    corner: Integers
    """(K, 3): the corner with the lowest coordinates."""
    side: Integers
    """(K,): width."""
    occupied: NDArray[np.bool_]
    """(K,)."""

    @property
    def size(self) -> int:
        """Number of cubes."""
        return len(self.side)


def decode_binary(data: Bytes) -> Voxels:
    """Returns the cubes of a binary stream. Raises DataFileError if it is invalid."""
    max_cubes = 4 * len(data)  # two bits a cube
    corner = np.empty((max_cubes, 3), np.int32)
    side, occupied = np.empty(max_cubes, np.int32), np.empty(max_cubes, np.bool_)
    count = _decode_binary(data, corner, side, occupied)
    if count < 0:
        raise DataFileError(
            f"not a binary OctoMap: the stream of {len(data)} bytes ends too early, goes on after "
            "its end, or is deeper than 16 levels"
        )
    return Voxels(corner[:count].copy(), side[:count].copy(), occupied[:count].copy())


def decode_full(data: Bytes) -> Voxels:
    """Returns the cubes of a full stream, occupied if the log-odds is above 0.

    Raises DataFileError if it is invalid.
    """
    max_cubes = len(data) // 5
    corner = np.empty((max_cubes, 3), np.int32)
    side, occupied = np.empty(max_cubes, np.int32), np.empty(max_cubes, np.bool_)
    values = np.frombuffer(data.tobytes() + b"\0" * 4, np.uint8)
    count = _decode_full(values, len(data), corner, side, occupied)
    if count < 0:
        raise DataFileError(f"not a full OctoMap: the stream of {len(data)} bytes is broken")
    return Voxels(corner[:count].copy(), side[:count].copy(), occupied[:count].copy())


def binary_from_full(data: Bytes) -> Bytes:
    """Returns the binary stream of a full one, equal cubes joined.

    Raises DataFileError if it is invalid.
    """
    nodes = len(data) // 5
    label, size = np.empty(nodes, np.uint8), np.empty(nodes, np.int32)
    out = np.empty(2 * nodes + 2, np.uint8)
    if 5 * nodes != len(data) or not _label(data, label, size):
        raise DataFileError(f"not a full OctoMap: the stream of {len(data)} bytes is broken")
    return out[: _write_binary(data, label, size, out)].copy()


@kernel
def _decode_binary(
    data: Bytes, corner: Integers, side: Integers, occupied: NDArray[np.bool_]
) -> int:
    if len(data) == 0:
        return 0
    stack = np.empty((_STACK, 4), np.int64)  # corner and width of unread nodes
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = -_HALF, -_HALF, -_HALF, 2 * _HALF
    top, at, count = 1, 0, 0
    while top > 0:
        top -= 1
        x, y, z = stack[top, 0], stack[top, 1], stack[top, 2]
        half = stack[top, 3] // 2
        if at + 2 > len(data) or half < 1:
            return -1
        bits = data[at] | (data[at + 1] << 8)
        at += 2
        for child in range(7, -1, -1):  # so that the first child is on top
            kind = (bits >> (2 * child)) & 3
            if kind == _UNKNOWN:
                continue
            cx, cy, cz = (
                x + half * (child & 1),
                y + half * ((child >> 1) & 1),
                z + half * (child >> 2),
            )
            if kind == _INNER:
                stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = cx, cy, cz, half
                top += 1
            else:
                corner[count, 0], corner[count, 1], corner[count, 2] = cx, cy, cz
                side[count] = half
                occupied[count] = kind == _OCCUPIED
                count += 1
    return count if at == len(data) else -1


@kernel
def _decode_full(
    data: Bytes, length: int, corner: Integers, side: Integers, occupied: NDArray[np.bool_]
) -> int:
    if length == 0:
        return 0
    stack = np.empty((_STACK, 4), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = -_HALF, -_HALF, -_HALF, 2 * _HALF
    top, at, count = 1, 0, 0
    while top > 0:
        top -= 1
        x, y, z, width = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        if at + 5 > length or width < 1:
            return -1
        # A float32 is above 0 if its sign bit is clear and another bit is set.
        positive = data[at + 3] < 128 and (data[at] | data[at + 1] | data[at + 2] | data[at + 3])
        children = data[at + 4]
        at += 5
        if children == 0:
            corner[count, 0], corner[count, 1], corner[count, 2] = x, y, z
            side[count] = width
            occupied[count] = positive != 0
            count += 1
            continue
        half = width // 2
        for child in range(7, -1, -1):
            if (children >> child) & 1:
                stack[top, 0] = x + half * (child & 1)
                stack[top, 1] = y + half * ((child >> 1) & 1)
                stack[top, 2] = z + half * (child >> 2)
                stack[top, 3] = half
                top += 1
    return count if at == length else -1


@kernel
def _label(data: Bytes, label: Bytes, size: Integers) -> bool:
    """Computes, from the last node to the first, subtree sizes and whether all cells are equal."""
    nodes = len(label)
    for node in range(nodes - 1, -1, -1):
        at = 5 * node
        children = data[at + 4]
        if children == 0:
            positive = data[at + 3] < 128 and (
                data[at] | data[at + 1] | data[at + 2] | data[at + 3]
            )
            label[node] = _OCCUPIED if positive != 0 else _FREE
            size[node] = 1
            continue
        child, common = node + 1, -1
        for k in range(8):
            if not (children >> k) & 1:
                common = _INNER
                continue
            if child >= nodes:
                return False
            if common < 0:
                common = int(label[child])
            elif common != label[child]:
                common = _INNER
            child += size[child]
        label[node] = common
        size[node] = child - node
    return nodes == 0 or size[0] == nodes


@kernel
def _write_binary(data: Bytes, label: Bytes, size: Integers, out: Bytes) -> int:
    """Writes the nodes in order, skipping subtrees of equal cells; the root is always written."""
    nodes = len(label)
    length, node = 0, 0
    while node < nodes:
        children = data[5 * node + 4]
        if node > 0 and (children == 0 or label[node] != _INNER):
            node += size[node]
            continue
        bits = 0
        if children == 0:
            bits = 0x5555 * int(label[node])  # the root alone: eight children like it
        else:
            child = node + 1
            for k in range(8):
                if (children >> k) & 1:
                    bits |= int(label[child]) << (2 * k)
                    child += size[child]
        out[length], out[length + 1] = bits & 255, bits >> 8
        length += 2
        node += 1
    return length
