"""The growing map: an OctoMap tree of bounded size."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.octomap_stream import Voxels, binary_from_full, decode_full
from volery.autonomy.mapping.octomap_trimming import trimmed
from volery.autonomy.perception.scan_rays import Rays
from volery.core.arrays import Array
from volery.core.compiled import brief_kernel
from volery.core.errors import NodeError
from volery.core.extras import import_extra

Bytes = NDArray[np.uint8]

_KEPT_FRACTION = 0.7
"""Fraction of the cells that is retained when the map is too large (modelling choice)."""
_FREE_ABOVE_M = 1.5
_DATA = b"\ndata\n"


class Octree:
    """Log-odds of occupied space by octomap's own sensor model (hit 0.7, miss 0.4).

    `max_nodes` bounds its memory, some 30 bytes a node: beyond it, the cells farthest from the
    vehicle are dropped.
    """

    def __init__(self, resolution_m: float, max_nodes: int = 4_000_000) -> None:
        self.resolution_m = resolution_m
        self._max_nodes = max_nodes
        self._tree = new_tree(resolution_m)
        self.forgotten = 0
        """Number of times that the farthest part was dropped."""

    @property
    def nodes(self) -> int:
        """Number of nodes of the tree."""
        return int(self._tree.size())

    def insert(self, rays: Rays, max_range_m: float, above_m: float = 6.0) -> None:
        """Adds the rays of one scan, all as cast from the middle one's start.

        It ignores rays that end more than `above_m` over or below it, and rays without a hit that
        are not level: they fill the map with space outside of the flight height. The tree marks
        free space only along the ray to a point. So rays without a hit end beyond the max range,
        where octomap cuts them off without a hit; shorter ones are ignored.
        """
        if len(rays.hits) == 0:
            return
        origin = rays.starts[len(rays.starts) // 2].copy()
        ends = np.empty_like(rays.ends)
        count = _choose(rays.ends, rays.hits, origin, max_range_m, above_m, ends)
        if count:
            self._tree.insertPointCloud(ends[:count], origin, max_range_m, True, False)
        if self.nodes > self._max_nodes:
            self._forget(origin)

    def voxels(self) -> Voxels:
        """Returns all known cells."""
        return decode_full(self._full())

    def binary(self) -> Bytes:
        """Returns the binary stream of the present map, equal cubes joined."""
        return binary_from_full(self._full())

    def take(self, path: Path) -> None:
        """Loads a `.bt` file that `map_files.read_map` has accepted."""
        tree = new_tree(self.resolution_m)
        if not tree.readBinary(str(path)):
            raise NodeError(f"{path}: octomap cannot read the map")
        self._tree = tree

    def get_state(self) -> dict[str, Any]:
        """Returns the state: the tree as octomap writes it."""
        return {"tree": bytes(self._tree.write()), "forgotten": self.forgotten}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        self._tree, self.forgotten = self._tree_of(state["tree"]), state["forgotten"]

    def _full(self) -> Bytes:
        written = self._tree.write()
        return np.frombuffer(written, np.uint8)[written.index(_DATA) + len(_DATA) :]

    def _forget(self, near: Array) -> None:
        """Drops the cells farthest, horizontally, from a position (m)."""
        full = self._full()
        voxels = decode_full(full)
        middle = near / self.resolution_m
        away = voxels.corner[:, :2] + 0.5 * voxels.side[:, None] - middle[:2]
        radius = float(np.quantile(np.hypot(away[:, 0], away[:, 1]), _KEPT_FRACTION))
        self._tree = self._tree_of(_with_head(trimmed(full, middle, radius), self.resolution_m))
        self.forgotten += 1

    def _tree_of(self, written: bytes) -> Any:
        """Returns the tree of a full stream with its head; octomap reads files only."""
        with tempfile.NamedTemporaryFile(suffix=".ot") as file:
            file.write(written)
            file.flush()
            tree = new_tree(self.resolution_m).read(file.name)
        if tree is None:
            raise NodeError("octomap cannot read a map that it has written")
        return tree


def _with_head(full: Bytes, resolution_m: float) -> bytes:
    head = f"# Octomap OcTree file\nid OcTree\nsize {len(full) // 5}\nres {resolution_m:g}"
    return head.encode() + _DATA + full.tobytes()


def new_tree(resolution_m: float) -> Any:
    """Returns an empty tree of pyoctomap. Raises `NodeError` if it cannot be imported."""
    pyoctomap = import_extra("mapping", "pyoctomap", "pyoctomap", "autonomy", NodeError)
    return pyoctomap.OcTree(resolution_m)


@brief_kernel
def _choose(
    ends: Array,
    hits: NDArray[np.bool_],
    origin: Array,
    max_range: float,
    above: float,
    chosen: Array,
) -> int:
    """Fills `chosen` with the ends that `Octree.insert` uses; returns their number."""
    count = 0
    for k in range(len(ends)):
        x, y, z = ends[k, 0] - origin[0], ends[k, 1] - origin[1], ends[k, 2] - origin[2]
        length = math.sqrt(x * x + y * y + z * z)
        if hits[k]:
            if not abs(z) <= above:
                continue
            for i in range(3):
                chosen[count, i] = ends[k, i]
        elif abs(z) <= _FREE_ABOVE_M and length > max_range - 0.5:
            chosen[count, 0] = origin[0] + (x / length) * (max_range + 0.5)
            chosen[count, 1] = origin[1] + (y / length) * (max_range + 0.5)
            chosen[count, 2] = origin[2] + (z / length) * (max_range + 0.5)
        else:
            continue
        count += 1
    return count
