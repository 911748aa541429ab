"""Measures ray casting beside a peer: the same beams into the same piece of forest.

The piece has 150 m x 150 m and 450 trees at the sensors' detail (375,000 triangles; the 5,000 trees
of the bench `lidar` would be 4 million, too many for peers that store every tree separately).
Volery instances its trees; the peer gets their triangles. Two LIDARs of a UAV make a batch of 2162
rays, cast by one call on one thread: distance, normal and object of each closest hit.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from volery.core.arrays import Array
from volery.world.mesh import Mesh
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery_benchmarks.forest_beams import (
    MAX_RANGE_M,
    PIECE_M,
    flattened,
    forest_of,
    rays_of,
    scans_of,
)
from volery_benchmarks.peers.catalogue import RayContest
from volery_benchmarks.peers.failure import PeerError
from volery_benchmarks.peers.task import Task

TOLERANCE_M = 0.01
MIN_AGREEMENT = 0.99
"""Min fraction of rays that must agree before speeds are compared; the rest graze edges of
leaves. Modelling choice."""


def ray_task(contest: RayContest, folder: Path) -> Task:
    """Prepares the contest; writes the peer's arrays into `folder`."""
    terrain = Terrain.flat(extent_m=PIECE_M)
    forest = forest_of(PIECE_M, terrain)
    scene = Scene(terrain, forest)
    scans, history = scans_of(scene, PIECE_M)
    origins, directions = rays_of(scans, history)
    batch = 2 * len(origins) // len(scans.uav)
    count = contest.uavs * batch
    origins, directions = origins[:count], directions[:count]
    parts = [slice(i, i + batch) for i in range(0, count, batch)]
    hits = scene.cast(origins[:batch], directions[:batch], MAX_RANGE_M)
    expected = np.concatenate(
        [scene.cast(origins[part], directions[part], MAX_RANGE_M).distance for part in parts]
    )
    arrays, distances = folder / "rays.npz", folder / "distances.npy"
    write_rays(arrays, flattened(terrain, forest), origins, directions)

    def cast() -> None:
        for part in parts:
            scene.cast(origins[part], directions[part], MAX_RANGE_M, out=hits)

    def check(facts: Mapping[str, Any] | None) -> dict[str, float]:
        if facts is None:
            return {}
        fraction = agreement(expected, read_distances(distances, count))
        if fraction < MIN_AGREEMENT:
            raise PeerError(
                f"only {fraction:.1%} of its distances are within {100 * TOLERANCE_M:g} cm of "
                f"ours; {MIN_AGREEMENT:.0%} are needed for a comparison"
            )
        return {"agreement": fraction}

    request = {
        "arrays": str(arrays),
        "distances": str(distances),
        "batch": batch,
        "reach_m": MAX_RANGE_M,
    }
    return Task(cast, count, count, request, check, scene.close)


def write_rays(path: Path, meshes: list[Mesh], origins: Array, directions: Array) -> None:
    """Writes meshes and rays as an .npz file.

    vertices (V, 3) float32, triangles (T, 3) uint32 rows of all vertices, first_vertex and
    first_triangle (M + 1,) where each mesh begins, origins and directions (R, 3), m, map.
    """
    first_vertex = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    first_triangle = np.cumsum([0, *(len(mesh.triangles) for mesh in meshes)])
    triangles = [m.triangles + np.uint32(v) for m, v in zip(meshes, first_vertex, strict=False)]
    np.savez(
        path,
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        triangles=np.concatenate(triangles),
        first_vertex=first_vertex,
        first_triangle=first_triangle,
        origins=origins,
        directions=directions,
    )


def read_distances(path: Path, count: int) -> Array:
    """Returns a peer's distances (R,), m; infinity for a miss. Raises `PeerError`."""
    try:
        found = np.asarray(np.load(path), dtype=np.float64)
    except (OSError, ValueError) as error:
        raise PeerError(f"left no distances: {error}") from None
    if found.shape != (count,):
        raise PeerError(f"left distances of shape {found.shape}, not ({count},)")
    return found


def agreement(ours: Array, theirs: Array) -> float:
    """Returns the fraction of rays that both miss, or hit within `TOLERANCE_M`."""
    hit = np.isfinite(ours) & np.isfinite(theirs)
    near = np.abs(np.subtract(ours, theirs, out=np.full(len(ours), np.inf), where=hit))
    return float(((near <= TOLERANCE_M) | (np.isposinf(ours) & np.isposinf(theirs))).mean())
