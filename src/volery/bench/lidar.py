"""Ray casting as the LIDARs do it, and peers on the same triangles.

The forest is 500 m x 500 m with 5,000 trees of the main job's species at its level of detail. A
hundred UAVs hover in free places 2..5 m above the ground; each has a level and a nodding scanner,
whose 2 x 1081 beams make the batch (reach 30 m). `rays_per_s_*` are exact scans of the whole batch,
each beam from its own pose, the closest hit without noise; `noisy_*` add the noise of the real
scanner; `cast_*` is the call for any rays (`Scene.cast`: distance, normal, instance, material).

The peers get the triangles of a 150 m x 150 m piece of the forest, flattened, because the whole
does not fit in the memory of a small machine when every tree is stored as often as it stands; ours
gets the same piece. embreex's call is given the reach and asked for distances only, its fastest
form; open3d's call knows no reach. One thread each, taking turns, medians.
"""

from __future__ import annotations

import importlib
import importlib.util
import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.sensors.lidar import (
    LidarBatch,
    make_batch,
    sample_lidars,
    scan_rays,
    stack_mounts,
)
from volery.sensors.lidar_model import load_lidar
from volery.sensors.mount import make_mount
from volery.vehicle.pose_history import PoseHistory, new_history
from volery.world.forest import Forest, procedural_forest
from volery.world.mesh import Mesh, concatenate
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.trees import DetailLevel

_REACH_M = 30.0
_EXTENT_M, _TREES = 500.0, 5000
_PIECE_M = 150.0
_UAVS = 100
_FEWEST_ROUNDS, _MOST_ROUNDS = 5, 40

Array = NDArray[np.float64]


def measure(seconds_budget: float = 40.0) -> dict[str, float]:
    """Figures of the bench `lidar`, with about `seconds_budget` of repeated casting."""
    figures = _whole_forest(0.55 * seconds_budget)
    figures.update(_peers(0.45 * seconds_budget))
    return figures


def _forest(extent: float, terrain: Terrain) -> Forest:
    return procedural_forest(
        (0.0, 0.0, extent, extent),
        species="beilschmiedia_pendula",
        terrain=terrain,
        trees=round(_TREES * (extent / _EXTENT_M) ** 2),
        minimum_spacing_m=1.0,
        seed=1,
    )


def _scans(scene: Scene, extent: float) -> tuple[LidarBatch, PoseHistory]:
    """Two scans of each UAV from places at least half a metre from anything."""
    rng = np.random.default_rng(1)
    places = rng.uniform((0, 0, 2), (extent, extent, 5), (50 * _UAVS, 3))
    inner = (places[:, :2] > 0.06 * extent) & (places[:, :2] < 0.94 * extent)
    places = places[inner.all(axis=1)]
    free = scene.clearance(places, 0.5).instance < 0
    places = places[free][:_UAVS]
    yaw = rng.uniform(-np.pi, np.pi, _UAVS)
    attitude = np.column_stack([np.zeros((_UAVS, 2)), np.sin(yaw / 2), np.cos(yaw / 2)])
    mounts = stack_mounts([make_mount(), make_mount(amplitude_rad=np.pi / 4, period_s=2.0)])
    batch = make_batch(
        np.repeat(np.arange(_UAVS), 2),
        np.tile([0, 1], _UAVS),
        np.repeat(rng.integers(0, 2_000_000_000, _UAVS), 2),
        np.arange(2 * _UAVS),
        0,
        mounts,
    )
    return batch, new_history(places, attitude, 1_000_000)


def _rays(batch: LidarBatch, history: PoseHistory) -> tuple[Array, Array]:
    """The scans' beams as rays (R, 3), (R, 3)."""
    model = load_lidar()
    scans = [scan_rays(model, batch, scan, history)[:2] for scan in range(len(batch.uav))]
    return np.concatenate([o for o, _ in scans]), np.concatenate([d for _, d in scans])


def _take_turns(
    calls: Mapping[str, Callable[[], object]], seconds_budget: float
) -> dict[str, float]:
    """Median seconds of each call; one of each a round, after a round to warm up."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    end = time.perf_counter() + seconds_budget
    for round_ in range(_MOST_ROUNDS):
        if round_ >= _FEWEST_ROUNDS and time.perf_counter() > end:
            break
        for name, call in calls.items():
            before = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - before)
    return {name: statistics.median(values) for name, values in seconds.items()}


def _whole_forest(seconds_budget: float) -> dict[str, float]:
    terrain = Terrain.flat(extent_m=_EXTENT_M)
    forest = _forest(_EXTENT_M, terrain)
    one, two = Scene(terrain, forest), Scene(terrain, forest, threads=2)
    visual = Scene(terrain, forest, detail=DetailLevel.VISUAL)
    model = load_lidar()
    batch, history = _scans(one, _EXTENT_M)
    origins, directions = _rays(batch, history)
    hits = one.cast(origins, directions, _REACH_M)
    exact = model.without_noise()
    calls = {
        "rays_per_s_1_thread": lambda: sample_lidars(one, exact, batch, history),
        "rays_per_s_2_threads": lambda: sample_lidars(two, exact, batch, history),
        "visual_rays_per_s_1_thread": lambda: sample_lidars(visual, exact, batch, history),
        "noisy_rays_per_s_1_thread": lambda: sample_lidars(one, model, batch, history),
        "noisy_rays_per_s_2_threads": lambda: sample_lidars(two, model, batch, history),
        "cast_rays_per_s_1_thread": lambda: one.cast(origins, directions, _REACH_M, out=hits),
    }
    seconds = _take_turns(calls, seconds_budget)
    points = history.position[0]
    clearance = _take_turns({"clearance": lambda: one.clearance(points, 5.0, False)}, 0.5)
    share = float((one.cast(origins, directions, _REACH_M).instance >= 0).mean())
    for scene in (one, two, visual):
        scene.close()
    figures = {name: len(origins) / value for name, value in seconds.items()}
    figures["share_of_rays_that_hit"] = share
    figures["clearance_us"] = clearance["clearance"] / len(points) * 1e6
    return figures


def _peers(seconds_budget: float) -> dict[str, float]:
    """How many times faster ours is than the peers on the same piece of forest."""
    terrain = Terrain.flat(extent_m=_PIECE_M)
    forest = _forest(_PIECE_M, terrain)
    scene = Scene(terrain, forest)
    origins, directions = _rays(*_scans(scene, _PIECE_M))
    whole = _flattened(terrain, forest)
    calls: dict[str, Callable[[], object]] = {
        "ours": lambda: scene.cast(origins, directions, _REACH_M),
        "ratio_to_embreex_run": _embreex_call(whole, origins, directions),
    }
    if importlib.util.find_spec("open3d") is not None:
        calls["ratio_to_open3d"] = _open3d_call(whole, origins, directions)
    seconds = _take_turns(calls, seconds_budget)
    scene.close()
    ours = seconds.pop("ours")
    return {name: value / ours for name, value in seconds.items()}


def _flattened(terrain: Terrain, forest: Forest) -> Mesh:
    meshes = [terrain.mesh()]
    for index, transform in zip(forest.model_index, forest.tree_transforms(), strict=True):
        tree = forest.models[index].levels[DetailLevel.SENSING]
        meshes.extend((tree.wood.transformed(transform), tree.leaves.transformed(transform)))
    return concatenate(meshes)


def _embreex_call(whole: Mesh, origins: Array, directions: Array) -> Callable[[], object]:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene: Any = EmbreeScene()
    mesh = TriangleMesh(scene, whole.vertices.copy(), whole.triangles.astype(np.int32))
    o, d = origins.astype(np.float32), directions.astype(np.float32)
    reach = np.full(len(o), _REACH_M, dtype=np.float32)

    def call() -> object:
        assert mesh is not None
        return scene.run(o, d, dists=reach, query="DISTANCE")

    return call


def _open3d_call(whole: Mesh, origins: Array, directions: Array) -> Callable[[], object]:
    open3d: Any = importlib.import_module("open3d")
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        open3d.core.Tensor(whole.vertices.copy()), open3d.core.Tensor(whole.triangles.copy())
    )
    rays = open3d.core.Tensor(np.hstack([origins, directions]).astype(np.float32))
    return lambda: scene.cast_rays(rays, nthreads=1)
