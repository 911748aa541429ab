"""Compiled shadows: rays towards the sun find the hits that it reaches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.sensors.cameras.hit_kernels import HIT, LIT, NORMAL_X, POSITION_X, Scratch
from volery.sensors.cameras.light import Light
from volery.world.body_kernels import body_sphere, hide_behind_body
from volery.world.embree import DIRECTION, FAR, LANES, ORIGIN, occluded_packet
from volery.world.scene_kernels import RayBlock, SceneHandle, run_together

f4 = np.float32

MAX_SHADOW_M = 80.0
"""Length of shadow rays, m: trees and houses are lower."""
_SUN_ABOVE = 0.01
"""Margin by which the sine of the sun's elevation must exceed a slope (modelling choice)."""


@inner_kernel
def shading_bodies(
    scene: SceneHandle,
    uav: int,
    light: Light,
    scratch: Scratch,
    count: int,
    near: NDArray[np.int32],
) -> int:
    """Lists in `near` the other bodies whose shadows may fall on the hits; returns their number.

    Each body is a sphere swept away from the sun, the hits are a ball.
    """
    bodies = scene.bodies
    if bodies.uavs_per_env + bodies.actors <= 1:  # only the camera's own UAV
        return 0
    low, high = _box(scratch, count)
    if low[0] > high[0]:
        return 0
    cx, cy, cz = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
    ball = np.sqrt((high[0] - cx) ** 2 + (high[1] - cy) ** 2 + (high[2] - cz) ** 2)
    first, uavs = uav - uav % bodies.uavs_per_env, bodies.scene.shape[0] - bodies.actors
    found = 0
    for n in range(bodies.uavs_per_env + bodies.actors):
        row = first + n if n < bodies.uavs_per_env else uavs + n - bodies.uavs_per_env
        x, y, z, radius = body_sphere(bodies, row)
        dx, dy, dz = x - cx, y - cy, z - cz
        along = dx * light.sun[0] + dy * light.sun[1] + dz * light.sun[2]
        radii = ball + radius
        aside = dx * dx + dy * dy + dz * dz - along * along
        if row != uav and -radii < along < MAX_SHADOW_M + radii and aside < radii * radii:
            near[found] = row
            found += 1
    return found


@inner_kernel
def _box(
    scratch: Scratch, count: int
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Returns the corners of the box around all hits; lowest above highest without hits.

    Each lane has its own box at first, so that the compiler vectorizes over the lanes.
    """
    low, high = scratch.low, scratch.high
    for j in range(3):
        for k in range(LANES):
            low[j, k], high[j, k] = f4(np.inf), f4(-np.inf)
    for p in range(count):
        hit = scratch.hit[p]
        for j in range(3):
            for k in range(LANES):
                met, coordinate = hit[HIT, k] > f4(0.0), hit[POSITION_X + j, k]
                low[j, k] = min(low[j, k], coordinate if met else f4(np.inf))
                high[j, k] = max(high[j, k], coordinate if met else f4(-np.inf))
    for j in range(3):
        for k in range(1, LANES):
            low[j, 0], high[j, 0] = min(low[j, 0], low[j, k]), max(high[j, 0], high[j, k])
    return (low[0, 0], low[1, 0], low[2, 0]), (high[0, 0], high[1, 0], high[2, 0])


@inner_kernel
def _casters(scene: SceneHandle, light: Light) -> int:
    """Returns the Embree scene of objects that may lie between a hit and the sun.

    While the sun is higher than the terrain's steepest slope, no ray from above the terrain to the
    sun meets it, and the terrain is left out.
    """
    sx, sy, sz = float(light.sun[0]), float(light.sun[1]), float(light.sun[2])
    level = np.sqrt(sx * sx + sy * sy)
    return scene.obstacles if sz > scene.steepest * level + _SUN_ABOVE else scene.static


@inner_kernel
def _aim_at_sun(block: RayBlock, count: int, may_mix: bool, light: Light, scratch: Scratch) -> int:
    """Fills packets with rays to the sun from the hits that face it; returns the number of packets.

    They replace the block's rays, packets and `fraction`. The light of hits that face away is set
    here. may_mix: whether rays of several packets may share one.
    """
    surface, rays, source, taken = light.surface, block.rays, scratch.source, scratch.taken
    sx, sy, sz = light.sun[0], light.sun[1], light.sun[2]
    is_day = sz > f4(0.0)
    q, lane = 0, 0
    for p in range(count):
        hit, material, distance = scratch.hit[p], block.material[p], scratch.distance[p]
        if not may_mix:
            block.fraction[q] = block.fraction[p]
        for k in range(LANES):
            nx, ny, nz = hit[NORMAL_X, k], hit[NORMAL_X + 1, k], hit[NORMAL_X + 2, k]
            cosine = nx * sx + ny * sy + nz * sz
            met = is_day and hit[HIT, k] > f4(0.0)
            if not met or cosine <= f4(0.0):
                # Light through the surface from behind counts as half shaded, without a ray.
                behind = f4(0.5) * surface[material[k], 7] if met else f4(0.0)
                hit[LIT, k] = -cosine * behind
                continue
            hit[LIT, k] = cosine
            # A step off the surface, on the side of the camera and the sun.
            off = f4(2e-3) + f4(1e-4) * distance[k]
            rays[q, ORIGIN, lane] = hit[POSITION_X, k] + off * nx
            rays[q, ORIGIN + 1, lane] = hit[POSITION_X + 1, k] + off * ny
            rays[q, ORIGIN + 2, lane] = hit[POSITION_X + 2, k] + off * nz
            source[q, lane] = p * LANES + k
            lane += 1
            taken[q] = lane
            if lane == LANES:
                q, lane = q + 1, 0
        if lane > 0 and not may_mix:
            q, lane = q + 1, 0
    return q + 1 if lane > 0 else q


@inner_kernel
def find_shadows(
    scene: SceneHandle,
    block: RayBlock,
    count: int,
    near_count: int,
    light: Light,
    scratch: Scratch,
) -> None:
    """Writes the light of the sun on each hit, the cosine of incidence: 0 in the shade.

    The block's rays are replaced by packed rays towards the sun: in a forest that makes a quarter
    fewer packets. Where bodies may throw shadows, each packet has its own time and is not mixed.
    """
    valid, casters = block.valid, _casters(scene, light)
    sx, sy, sz = light.sun[0], light.sun[1], light.sun[2]
    for q in range(_aim_at_sun(block, count, near_count == 0, light, scratch)):
        rays, source, lanes = block.rays[q], scratch.source[q], scratch.taken[q]
        for k in range(LANES):
            valid[k] = -1 if k < lanes else 0
            rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k] = sx, sy, sz
            rays[FAR, k] = f4(MAX_SHADOW_M)
        arguments = block.coherent.ctypes.data if run_together(block.rays, q, lanes) else 0
        occluded_packet(valid.ctypes.data, casters, rays.ctypes.data, arguments)
        for n in range(near_count):
            hide_behind_body(scene, block, q, lanes, block.near[n])
        for k in range(lanes):
            if rays[FAR, k] < f4(0.0):
                scratch.hit[source[k] // LANES, LIT, source[k] % LANES] = f4(0.0)
