"""Computes the foliage along a line: crowns are upright ellipsoids around their leaves."""

from __future__ import annotations

import numpy as np

from volery.core.arrays import Array
from volery.core.vectors import norm
from volery.world.forest import Forest
from volery.world.trees.model import TreeModel

_WITHIN = 0.9
"""Fraction of a crown's leaves inside its ellipsoid. Modelling choice."""
_THINNEST_M = 0.05


class Crowns:
    """Holds the crowns of a forest's trees; trees without leaves have none."""

    def __init__(self, forest: Forest) -> None:
        shapes = np.array([_shape(model) for model in forest.models]).reshape(-1, 3)
        of_tree = shapes[np.asarray(forest.model_index)]
        scale = np.asarray(forest.scale, np.float64)
        has_leaves = of_tree[:, 0] > 0.0
        across = of_tree[:, 0] * scale[:, :2].mean(axis=1)
        upward = of_tree[:, 2] * scale[:, 2]
        centre = np.asarray(forest.position_map, np.float64).copy()
        centre[:, 2] += of_tree[:, 1] * scale[:, 2]
        self._centre = centre[has_leaves]
        self._radii = np.stack([across, across, upward], axis=1)[has_leaves]

    def along(self, start: Array, end: Array) -> float:
        """Returns the length, m, of the line from `start` (3,) to `end` (3,) inside crowns."""
        if not len(self._centre):
            return 0.0
        # the unit sphere of each crown: |o + s d| = 1 at entry and exit of the line, s in 0..1
        o = (start - self._centre) / self._radii
        d = (end - start) / self._radii
        a, b = (d * d).sum(axis=1), (o * d).sum(axis=1)
        c = (o * o).sum(axis=1) - 1.0
        root = b * b - a * c
        met = (root > 0.0) & (a > 0.0)
        half = np.sqrt(root[met])
        enter = np.clip((-b[met] - half) / a[met], 0.0, 1.0)
        leave = np.clip((-b[met] + half) / a[met], 0.0, 1.0)
        return norm(end - start) * _length_of_union(enter, leave)


def _shape(model: TreeModel) -> tuple[float, float, float]:
    """Returns radius, middle height and half height of a crown, m; zeros without leaves."""
    level = min(model.levels.values(), key=lambda tree: len(tree.leaves.vertices))
    leaves = np.asarray(level.leaves.vertices, np.float64)
    if not len(leaves):
        return 0.0, 0.0, 0.0
    low, high = np.quantile(leaves[:, 2], [0.5 - 0.5 * _WITHIN, 0.5 + 0.5 * _WITHIN])
    radius = np.quantile(np.hypot(leaves[:, 0], leaves[:, 1]), _WITHIN)
    return float(radius), float(0.5 * (low + high)), max(float(0.5 * (high - low)), _THINNEST_M)


def _length_of_union(enter: Array, leave: Array) -> float:
    """Returns the length of the union of intervals."""
    covered, end = 0.0, 0.0
    for k in np.argsort(enter, kind="stable"):
        covered += max(float(leave[k]) - max(float(enter[k]), end), 0.0)
        end = max(end, float(leave[k]))
    return covered
