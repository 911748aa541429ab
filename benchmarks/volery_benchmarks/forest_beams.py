"""Builds the forest, the LIDARs and their beams for the benches of ray casting."""

from __future__ import annotations

import numpy as np

from volery.core.arrays import Array
from volery.sensors.lidar.lidar import RayBatch, make_batch, scan_rays, stack_mounts
from volery.sensors.lidar.lidar_model import load_lidar
from volery.sensors.mount import make_mount
from volery.vehicle.pose_history import PoseHistory, new_history
from volery.world.forest import Forest, procedural_forest
from volery.world.mesh import Mesh
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.trees import DetailLevel

MAX_RANGE_M = 30.0
EXTENT_M, TREES = 500.0, 5000
PIECE_M = 150.0
"""Side of the piece that is flattened to triangles for peers, m; it holds 450 of the trees."""
_UAVS = 100


def forest_of(extent: float, terrain: Terrain) -> Forest:
    """Returns a square forest of the main job's species, as dense as `TREES` on `EXTENT_M`."""
    return procedural_forest(
        (0.0, 0.0, extent, extent),
        species="beilschmiedia_pendula",
        terrain=terrain,
        trees=round(TREES * (extent / EXTENT_M) ** 2),
        minimum_spacing_m=1.0,
        seed=1,
    )


def scans_of(scene: Scene, extent: float) -> tuple[RayBatch, PoseHistory]:
    """Returns two scans of each UAV from positions at least half a metre from any surface."""
    rng = np.random.default_rng(1)
    positions = rng.uniform((0, 0, 2), (extent, extent, 5), (50 * _UAVS, 3))
    inner = (positions[:, :2] > 0.06 * extent) & (positions[:, :2] < 0.94 * extent)
    positions = positions[inner.all(axis=1)]
    free = scene.clearance(positions, 0.5).instance < 0
    positions = positions[free][:_UAVS]
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
    return batch, new_history(positions, attitude, 1_000_000)


def rays_of(batch: RayBatch, history: PoseHistory) -> tuple[Array, Array]:
    """Returns origins and directions (R, 3) of the scans' beams, scan after scan."""
    model = load_lidar()
    scans = [scan_rays(model, batch, scan, history)[:2] for scan in range(len(batch.uav))]
    return np.concatenate([o for o, _ in scans]), np.concatenate([d for _, d in scans])


def flattened(terrain: Terrain, forest: Forest) -> list[Mesh]:
    """Returns the ground, then wood and leaves of each tree, map frame, at the sensors' detail."""
    meshes = [terrain.mesh()]
    for index, transform in zip(forest.model_index, forest.tree_transforms(), strict=True):
        tree = forest.models[index].levels[DetailLevel.SENSING]
        meshes += [tree.wood.transformed(transform), tree.leaves.transformed(transform)]
    return meshes
