"""Compiled choice of the world that the rays of a UAV see, in scenes of several worlds."""

from __future__ import annotations

from volery.core.compiled import inner_kernel
from volery.world.scene_memory import SceneHandle


@inner_kernel
def own_world(scene: SceneHandle, uav: int) -> SceneHandle:
    """Returns the handle of the world of the UAV in row `uav`; `scene` itself if it has one world.

    Numbers of instances, which the handle's tables and results share, are those of that world. The
    tables are views whose references are not counted: only inner kernels may call this.
    """
    worlds = scene.worlds
    if worlds.world.shape[0] == 0:
        return scene
    w = worlds.world[uav // scene.bodies.uavs_per_env]
    first, last = worlds.first[w], worlds.first[w + 1]
    return SceneHandle(
        worlds.static[w],
        worlds.obstacles[w],
        worlds.steepest[w],
        last - first,
        worlds.trees[w],
        scene.normal_matrix[first:last],
        scene.material[first:last],
        scene.look[first:last],
        scene.cover,
        scene.bodies,
        worlds,
    )
