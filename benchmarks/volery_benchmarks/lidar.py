"""Measures LIDAR ray casting, and peers on the same triangles.

The forest is 500 m x 500 m with 5,000 trees of the main job's species at its level of detail. A
hundred UAVs hover at free positions 2..5 m above the ground; each has a horizontal and a nodding
LIDAR, whose 2 x 1081 beams make the batch (max range 30 m). `rays_per_s_*` are exact scans of the
whole batch, each beam from its own pose, the closest hit without noise; `noisy_*` add the noise of
the real LIDAR; `cast_*` is the call for any rays (`Scene.cast`: distance, normal, instance,
material).

The peers get the triangles of a 150 m x 150 m piece of the forest, flattened, because the whole
forest does not fit in the memory of a small machine if every tree is stored separately; Volery gets
the same piece. embreex's call gets the max range and returns distances only, its fastest form;
open3d's call has no max range. One thread each, in turns, medians.
"""

from __future__ import annotations

import importlib
import statistics
import time
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from volery.core.arrays import Array
from volery.sensors.lidar.lidar import sample_lidars
from volery.sensors.lidar.lidar_model import load_lidar
from volery.world.mesh import Mesh, concatenate
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.trees import DetailLevel
from volery_benchmarks.forest_beams import (
    EXTENT_M,
    MAX_RANGE_M,
    PIECE_M,
    flattened,
    forest_of,
    rays_of,
    scans_of,
)
from volery_benchmarks.registry import Measured

_FEWEST_ROUNDS, _MAX_ROUNDS = 5, 40
_BUDGET_S = 40.0
"""Duration of repeated casting; `quick` takes the fewest rounds."""


def measure(*, quick: bool = False) -> Measured:
    """Returns the figures of the bench `lidar`; without open3d, why it cannot be measured."""
    seconds_budget = 0.0 if quick else _BUDGET_S
    figures, failures = _whole_forest(0.55 * seconds_budget), {}
    try:
        importlib.import_module("open3d")
    except (ImportError, OSError) as error:  # installed, but a library of the system is missing
        failures["ratio_to_open3d"] = str(error)
    figures.update(_peers(0.45 * seconds_budget, with_open3d=not failures))
    return Measured(figures, failures)


def _take_turns(
    calls: Mapping[str, Callable[[], object]], seconds_budget: float
) -> dict[str, float]:
    """Returns the median time of each call, s, in turns, after a warm-up round."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    end = time.perf_counter() + seconds_budget
    for round_ in range(_MAX_ROUNDS):
        if round_ >= _FEWEST_ROUNDS and time.perf_counter() > end:
            break
        for name, call in calls.items():
            before = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - before)
    return {name: statistics.median(values) for name, values in seconds.items()}


def _whole_forest(seconds_budget: float) -> dict[str, float]:
    terrain = Terrain.flat(extent_m=EXTENT_M)
    forest = forest_of(EXTENT_M, terrain)
    one, two = Scene(terrain, forest), Scene(terrain, forest, threads=2)
    visual = Scene(terrain, forest, detail=DetailLevel.VISUAL)
    model = load_lidar()
    batch, history = scans_of(one, EXTENT_M)
    origins, directions = rays_of(batch, history)
    hits = one.cast(origins, directions, MAX_RANGE_M)
    exact = model.without_noise()
    calls = {
        "rays_per_s_1_thread": lambda: sample_lidars(one, exact, batch, history),
        "rays_per_s_2_threads": lambda: sample_lidars(two, exact, batch, history),
        "visual_rays_per_s_1_thread": lambda: sample_lidars(visual, exact, batch, history),
        "noisy_rays_per_s_1_thread": lambda: sample_lidars(one, model, batch, history),
        "noisy_rays_per_s_2_threads": lambda: sample_lidars(two, model, batch, history),
        "cast_rays_per_s_1_thread": lambda: one.cast(origins, directions, MAX_RANGE_M, out=hits),
    }
    seconds = _take_turns(calls, seconds_budget)
    points = history.position[0]
    clearance = _take_turns({"clearance": lambda: one.clearance(points, 5.0, False)}, 0.5)
    fraction = float((one.cast(origins, directions, MAX_RANGE_M).instance >= 0).mean())
    for scene in (one, two, visual):
        scene.close()
    figures = {name: len(origins) / value for name, value in seconds.items()}
    figures["share_of_rays_that_hit"] = fraction
    figures["clearance_us"] = clearance["clearance"] / len(points) * 1e6
    return figures


def _peers(seconds_budget: float, *, with_open3d: bool) -> dict[str, float]:
    """Returns Volery's speed over that of the peers on the same piece of forest."""
    terrain = Terrain.flat(extent_m=PIECE_M)
    forest = forest_of(PIECE_M, terrain)
    scene = Scene(terrain, forest)
    origins, directions = rays_of(*scans_of(scene, PIECE_M))
    whole = concatenate(flattened(terrain, forest))
    calls: dict[str, Callable[[], object]] = {
        "ours": lambda: scene.cast(origins, directions, MAX_RANGE_M),
        "ratio_to_embreex_run": _embreex_call(whole, origins, directions),
    }
    if with_open3d:
        calls["ratio_to_open3d"] = _open3d_call(whole, origins, directions)
    seconds = _take_turns(calls, seconds_budget)
    scene.close()
    ours = seconds.pop("ours")
    return {name: value / ours for name, value in seconds.items()}


@cache
def _embreex_device() -> Any:
    """Returns the device of embreex's call, which lives as long as the process.

    It allows TBB more threads than Volery's devices do. Once it is gone, a TBB worker that exceeds
    the limit spins on one core and disturbs all measurements that follow.
    """
    from embreex.rtcore import EmbreeDevice

    return EmbreeDevice()


def _embreex_call(whole: Mesh, origins: Array, directions: Array) -> Callable[[], object]:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene: Any = EmbreeScene(_embreex_device())
    mesh = TriangleMesh(scene, whole.vertices.copy(), whole.triangles.astype(np.int32))
    o, d = origins.astype(np.float32), directions.astype(np.float32)
    max_range = np.full(len(o), MAX_RANGE_M, dtype=np.float32)

    def call() -> object:
        assert mesh is not None
        return scene.run(o, d, dists=max_range, query="DISTANCE")

    return call


def _open3d_call(whole: Mesh, origins: Array, directions: Array) -> Callable[[], object]:
    open3d: Any = importlib.import_module("open3d")
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        open3d.core.Tensor(whole.vertices.copy()), open3d.core.Tensor(whole.triangles.copy())
    )
    rays = open3d.core.Tensor(np.hstack([origins, directions]).astype(np.float32))
    return lambda: scene.cast_rays(rays, nthreads=1)
