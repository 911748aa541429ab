"""Trees as seen from above: feet, crowns, trunks."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.figures.flight_data import Trees


def trees_of(forest: Any) -> Trees | None:
    """Returns the drawn properties of a forest; None without trees."""
    if forest is None or not len(forest.position_map):
        return None
    crowns = np.array([_crown_radius(model) for model in forest.models])
    stretch = np.asarray(forest.scale)[:, :2].mean(axis=1)
    return Trees(
        position_map=np.asarray(forest.position_map, dtype=np.float64),
        crown_radius_m=crowns[np.asarray(forest.model_index)] * stretch,
        dbh_m=np.asarray(forest.dbh_m, dtype=np.float64),
    )


def _crown_radius(model: Any) -> float:
    """Returns the radius of nine tenths of the crown's vertices; of the wood if it is bare."""
    level = min(model.levels.values(), key=lambda tree: len(tree.leaves.vertices))
    vertices = level.leaves.vertices if len(level.leaves.vertices) else level.wood.vertices
    if not len(vertices):
        return 0.0
    return float(np.quantile(np.hypot(vertices[:, 0], vertices[:, 1]), 0.9))
