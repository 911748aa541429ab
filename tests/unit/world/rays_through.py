"""Fractions of parallel rays that pass a tree: the yardstick for levels of detail."""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from plain_scene import DEVICE

from volery.world.trees import DetailLevel, TreeModel

ELEVATIONS = (0.0, 0.6, np.pi / 2)
AZIMUTHS = (0.0, 1.2, 2.4)


def gap_fractions(model: TreeModel, level: DetailLevel, rays: int = 60) -> np.ndarray:
    """Gap fraction of the crown seen level, from 34 degrees above, and from straight above.

    The region is the same for all levels: a box (level, slanted) or disc (from above) around the
    middle of the visual level's crown.
    """
    leaves = model.levels[DetailLevel.VISUAL].leaves.vertices
    centre = np.median(leaves[:, :2], axis=0)
    radius = np.percentile(np.linalg.norm(leaves[:, :2] - centre, axis=1), 90)
    low, high = np.percentile(leaves[:, 2], [3, 97])
    middle = np.array([*centre, (low + high) / 2])
    scene = EmbreeScene(DEVICE)
    for mesh in (model.levels[level].wood, model.levels[level].leaves):
        TriangleMesh(scene, np.array(mesh.vertices), np.array(mesh.triangles, np.int32))
    across, along = (a.ravel() for a in np.meshgrid(*2 * [(np.arange(rays) + 0.5) / rays * 2 - 1]))
    gaps = []
    for elevation in ELEVATIONS:
        from_above = elevation > 1.5
        kept = across**2 + along**2 < 1 if from_above else np.full(len(across), True)
        half_length = radius if from_above else (high - low) / 2 * np.cos(elevation)
        passed = []
        for azimuth in AZIMUTHS[:1] if from_above else AZIMUTHS:
            level_part = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            direction = np.cos(elevation) * level_part - [0.0, 0.0, np.sin(elevation)]
            right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
            up = np.cross(direction, right)
            origins = middle + np.outer(radius * across[kept], right) - 100.0 * direction
            origins += np.outer(half_length * along[kept], up)
            directions = np.tile(direction, (len(origins), 1)).astype(np.float32)
            passed.append((scene.run(origins.astype(np.float32), directions) < 0).mean())
        gaps.append(np.mean(passed))
    return np.array(gaps)
