"""Traces the line of sight between antennas through surfaces and tree crowns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.comms.radio.path_loss import Paths
from volery.core.arrays import Array
from volery.runtime.construction.radio_crowns import Crowns
from volery.world.forest import Forest
from volery.world.materials import Material
from volery.world.scene import Hits, Scene

_MAX_SURFACES = 192
"""Max number of surfaces; behind more of them no signal is left, and they are not counted."""
_PAST_LEAF_M, _PAST_SURFACE_M = 0.25, 0.02
"""Distances behind a leaf, and another surface, at which a ray continues."""
_TRUNK_M = 2.0
"""Wood of one tree within this distance along the ray is one trunk. Modelling choice."""
_MIN_LENGTH_M = 0.05


class LineOfSight:
    """Traces straight lines through the static world, without UAVs and actors."""

    def __init__(self, scene: Scene, forest: Forest | None) -> None:
        self._scene = scene
        self._crowns = None if forest is None else Crowns(forest)
        self._twin = scene.twin()
        self._solids = scene.solids

    def __call__(self, starts: Array, ends: Array) -> Paths:
        """Returns the obstacles between positions (P, 3) and (P, 3), m, in the map frame."""
        if self._scene.solids is not self._solids:  # a grid map has changed
            self._twin, self._solids = self._scene.twin(), self._scene.solids
        rays = _Rays(starts, ends)
        for _ in range(_MAX_SURFACES):
            if not len(rays.going):
                break
            at, direction = rays.here()
            rays.take(self._twin.cast(at, direction, float(rays.length.max(initial=0.0))))
        if self._crowns is not None:
            for k, (start, end) in enumerate(zip(starts, ends, strict=True)):
                rays.paths.foliage_m[k] = self._crowns.along(start, end)
        return rays.paths


class _Rays:
    """Traces P rays; `going` holds the indices of those that have not reached their end."""

    def __init__(self, starts: Array, ends: Array) -> None:
        count = len(starts)
        self.paths = Paths.clear(count)
        self.length: Array = np.linalg.norm(ends - starts, axis=1)
        self._starts = starts
        self._direction = (ends - starts) / np.maximum(self.length, _MIN_LENGTH_M)[:, None]
        self._at = np.zeros(count)
        """Distance travelled, m."""
        self._wood = np.full(count, -np.inf)
        """Distance of the last wood, m."""
        self._tree = np.full(count, -1)
        """Tree of the last wood."""
        self.going = np.flatnonzero(self.length > _MIN_LENGTH_M)

    def here(self) -> tuple[Array, Array]:
        """Returns the origins and directions, (K, 3) each, from which the active rays continue."""
        g = self.going
        direction = self._direction[g]
        return self._starts[g] + self._at[g, None] * direction, direction

    def take(self, hits: Hits) -> None:
        """Counts the surfaces that were hit and continues behind them."""
        met = self._at[self.going] + hits.distance
        before_end = met < self.length[self.going]
        g, met = self.going[before_end], met[before_end]
        material, instance = hits.material[before_end], hits.instance[before_end]

        leaf = material == Material.LEAF
        wood = material == Material.WOOD
        self._pass_wood(g[wood], met[wood], instance[wood])
        ground = instance == 0
        self.paths.ground[g[ground]] = True
        self.paths.walls[g[~(leaf | wood | ground)]] += 1

        self._at[g] = met + np.where(leaf, _PAST_LEAF_M, _PAST_SURFACE_M)
        self.going = g[~ground]

    def _pass_wood(self, g: NDArray[np.int64], met: Array, tree: NDArray[np.int32]) -> None:
        same = (tree == self._tree[g]) & (met - self._wood[g] <= _TRUNK_M)
        self.paths.trunks[g[~same]] += 1
        self._wood[g], self._tree[g] = met, tree
