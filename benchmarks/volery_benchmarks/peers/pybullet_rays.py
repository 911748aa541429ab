"""Drives PyBullet's `rayTestBatch`, with its own interpreter (see `host`).

Each mesh of the request is an immovable body with its triangles unchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet


def prepare(request: dict[str, Any]) -> tuple[Callable[[], Any], Callable[[], dict[str, Any]]]:
    """Returns functions: a round on one thread; facts that save the distances to a file."""
    data = np.load(request["arrays"])
    max_range = request["reach_m"]
    pybullet.connect(pybullet.DIRECT)
    vertices, triangles = data["vertices"], data["triangles"]
    for i in range(len(data["first_triangle"]) - 1):
        v = slice(*data["first_vertex"][i : i + 2])
        t = slice(*data["first_triangle"][i : i + 2])
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=vertices[v].tolist(),
            indices=(triangles[t] - v.start).ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        )
        pybullet.createMultiBody(0, shape)
    origins, ends = data["origins"], data["origins"] + max_range * data["directions"]
    # lists, which PyBullet processes faster than arrays; their conversion is not measured
    batches = [
        (origins[i : i + request["batch"]].tolist(), ends[i : i + request["batch"]].tolist())
        for i in range(0, len(origins), request["batch"])
    ]

    def cast() -> list[Any]:
        return [pybullet.rayTestBatch(start, end, numThreads=1) for start, end in batches]

    def facts() -> dict[str, Any]:
        hits = [hit for batch in cast() for hit in batch]
        distance = [max_range * hit[2] if hit[0] >= 0 else np.inf for hit in hits]
        np.save(request["distances"], np.array(distance))
        return {}

    return cast, facts
