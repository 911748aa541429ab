"""A bounded set of occupied voxels: past its limit the voxels grow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_BITS = 21
_OFFSET = 1 << (_BITS - 1)
_MASK = (1 << _BITS) - 1
_PENDING = 150_000


class VoxelSet:
    """Voxels of side `voxel_m` that hold at least one of the points added."""

    def __init__(self, voxel_m: float, limit: int = 1_500_000) -> None:
        self.voxel_m = voxel_m
        self._limit = limit
        self._keys = np.empty(0, np.int64)
        self._pending: list[NDArray[np.int64]] = []
        self._count = 0

    def add(self, points: NDArray[np.floating]) -> None:
        """Adds points (n, 3) within a million voxels of the origin."""
        self._pending.append(_keys(points, self.voxel_m))
        self._count += len(points)
        if self._count > max(_PENDING, len(self._keys) // 2):
            self._merge()

    def centers(self) -> NDArray[np.float32]:
        """Returns the centres (M, 3) of the voxels, m."""
        self._merge()
        return _centers(self._keys, self.voxel_m).astype(np.float32)

    def _merge(self) -> None:
        self._keys = np.unique(np.concatenate([self._keys, *self._pending]))
        self._pending.clear()
        self._count = 0
        while len(self._keys) > self._limit:
            centers = _centers(self._keys, self.voxel_m)
            self.voxel_m *= 2.0
            self._keys = np.unique(_keys(centers, self.voxel_m))


def _keys(points: NDArray[np.floating], voxel_m: float) -> NDArray[np.int64]:
    index = np.floor(points / voxel_m).astype(np.int64) + _OFFSET
    keys: NDArray[np.int64] = (index[:, 0] << (2 * _BITS)) | (index[:, 1] << _BITS) | index[:, 2]
    return keys


def _centers(keys: NDArray[np.int64], voxel_m: float) -> NDArray[np.float64]:
    index = np.stack([keys >> (2 * _BITS), (keys >> _BITS) & _MASK, keys & _MASK], axis=1)
    return (index - _OFFSET + 0.5) * voxel_m
