"""Joins two forests."""

from __future__ import annotations

import numpy as np

from volery.world.forest import Forest


def joined(first: Forest | None, second: Forest | None) -> Forest | None:
    """Returns all trees of both, those of the first before the others; None without trees."""
    forests = [forest for forest in (first, second) if forest]
    if not forests:
        return first or second
    if len(forests) == 1:
        return forests[0]
    a, b = forests
    return Forest(
        models=a.models + b.models,
        model_index=np.concatenate([a.model_index, b.model_index + np.int32(len(a.models))]),
        position_map=np.concatenate([a.position_map, b.position_map]),
        yaw=np.concatenate([a.yaw, b.yaw]),
        scale=np.concatenate([a.scale, b.scale]),
        dbh_m=np.concatenate([a.dbh_m, b.dbh_m]),
        height_m=np.concatenate([a.height_m, b.height_m]),
        species=a.species + b.species,
    )
