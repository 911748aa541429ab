"""Drives Open3D's `RaycastingScene`, with its own interpreter (see `host`).

All meshes of the request are one. Its call has no max range; the check drops farther hits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import open3d


def prepare(request: dict[str, Any]) -> tuple[Callable[[], Any], Callable[[], dict[str, Any]]]:
    """Returns functions: a round on one thread; facts that save the distances to a file."""
    data = np.load(request["arrays"])
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(open3d.core.Tensor(data["vertices"]), open3d.core.Tensor(data["triangles"]))
    rays = np.hstack([data["origins"], data["directions"]]).astype(np.float32)
    batches = [
        open3d.core.Tensor(rays[i : i + request["batch"]])
        for i in range(0, len(rays), request["batch"])
    ]

    def cast() -> list[Any]:
        return [scene.cast_rays(batch, nthreads=1) for batch in batches]

    def facts() -> dict[str, Any]:
        distance = np.concatenate([answer["t_hit"].numpy() for answer in cast()])
        distance = np.where(distance <= request["reach_m"], distance, np.inf)
        np.save(request["distances"], distance.astype(float))
        return {}

    return cast, facts
