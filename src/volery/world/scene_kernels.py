"""Compiled ray casting over a scene: static Embree scene first, then the moving bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.workers import fetch_add
from volery.world.body_kernels import (
    cast_at_body,
    hide_behind_body,
    near_bodies,
    near_bodies_of_several,
)
from volery.world.embree import (
    DIRECTION,
    FAR,
    GEOMETRY,
    INSTANCE,
    INVALID,
    LANES,
    NORMAL,
    ORIGIN,
    PACKET_ROWS,
    intersect_packet,
    occluded_packet,
)
from volery.world.ground_cover import ground_material
from volery.world.point_query import instance_of
from volery.world.scene_memory import RayBlock, SceneHandle, new_block, thread_block

__all__ = [
    "CHUNK",
    "RayBlock",
    "SceneHandle",
    "cast_block",
    "cast_rays",
    "find_enclosing",
    "find_occluded",
    "near_bodies",
    "new_block",
    "run_together",
    "thread_block",
]

_INVALID = np.uint32(INVALID)
_SECOND = np.uint32(1)
"""Odd parts of trees are leaves, the second of a tree's materials."""
CHUNK = 512
"""Rays of one piece of work; a multiple of LANES, so that packets do not depend on threads."""
_TOGETHER_M, _TOGETHER_COSINE = 1.0, 0.9
"""Maximum distance (m) and angle of coherent rays in a packet."""
_MIN_COMPONENT = np.float32(1e-12)
"""Minimum component of a direction; smaller ones become zero.

Embree's coherent traversal sorts rays by the signs of their directions, but takes the reciprocal of
a component below 1e-18 as positive: one beam at -90 degrees, whose cosine is a rounding error,
would make its neighbours miss.
"""
_MAX_PASSED = 64
"""Maximum number of tree surfaces that an upward ray passes."""
_SHORT_OF_TARGET_M = 1e-4
"""Distance before the target at which `occluded` ends, so that the target's surface hides nothing.
"""


@inner_kernel
def _settled(component: Any) -> Any:
    """Returns a component of a direction, zero if negligible."""
    return component if abs(component) >= _MIN_COMPONENT else np.float32(0.0)


@inner_kernel
def _make_ready(
    rays: NDArray[np.float32], words: NDArray[np.uint32], p: int, max_range: float
) -> None:
    """Initialises the rows of packet `p` that a cast changes."""
    for k in range(LANES):
        rays[p, FAR, k] = max_range
        words[p, GEOMETRY, k] = _INVALID
        words[p, INSTANCE, k] = _INVALID
    for j in range(DIRECTION, DIRECTION + 3):
        for k in range(LANES):
            rays[p, j, k] = _settled(rays[p, j, k])


@inner_kernel
def run_together(rays: NDArray[np.float32], p: int, lanes: int) -> bool:
    """Returns whether first and last ray of packet `p` are close in position and direction."""
    last = lanes - 1
    apart, along = 0.0, 0.0
    for row in range(3):
        apart += abs(rays[p, ORIGIN + row, 0] - rays[p, ORIGIN + row, last])
        along += rays[p, DIRECTION + row, 0] * rays[p, DIRECTION + row, last]
    return bool(apart < _TOGETHER_M and along > _TOGETHER_COSINE)


@inner_kernel
def cast_block(
    scene: SceneHandle, block: RayBlock, count: int, max_range: float, near_count: int
) -> None:
    """Finds the closest hits of the block's first `count` rays, on static and moving geometry.

    One call handles many packets, because passing so many arrays costs as much as a ray.
    """
    rays, words, valid = block.rays, block.words, block.valid
    instance, material = block.instance, block.material
    rays_address, valid_address = rays.ctypes.data, valid.ctypes.data
    coherent_address = block.coherent.ctypes.data
    static, material_of, matrix_of = scene.static, scene.material, scene.normal_matrix
    trees = np.uint32(scene.trees)
    cover = scene.cover
    is_covered = cover.material.shape[0] > 0
    packets = (count + LANES - 1) // LANES
    limit: Any = np.float32(max_range)
    for k in range(LANES):
        valid[k] = -1
    for p in range(packets):
        lanes = min(LANES, count - p * LANES)
        for k in range(lanes, LANES):
            valid[k] = 0
        _make_ready(rays, words, p, limit)
        if static != 0:
            arguments = coherent_address if run_together(rays, p, lanes) else 0
            intersect_packet(
                valid_address, static, rays_address + p * (PACKET_ROWS * LANES * 4), arguments
            )
        for k in range(LANES):
            part = words[p, GEOMETRY, k]
            number = words[p, INSTANCE, k]
            if part == _INVALID:
                instance[p, k] = -1
                material[p, k] = 0
            elif number == _INVALID:  # terrain and solids are geometry of the top level
                row = instance_of(part, trees)
                instance[p, k] = row
                x, y, z = rays[p, NORMAL, k], rays[p, NORMAL + 1, k], rays[p, NORMAL + 2, k]
                looks_up = z > np.float32(0.0) and z * z > x * x + y * y
                material[p, k] = material_of[row, 1 if looks_up else 0]
                if row == 0 and is_covered:
                    far = rays[p, FAR, k]
                    x = rays[p, ORIGIN, k] + far * rays[p, DIRECTION, k]
                    y = rays[p, ORIGIN + 1, k] + far * rays[p, DIRECTION + 1, k]
                    material[p, k] = ground_material(cover, x, y)
            else:
                row = instance_of(number, trees)
                instance[p, k] = row
                material[p, k] = material_of[row, part & _SECOND]
                x, y, z = rays[p, NORMAL, k], rays[p, NORMAL + 1, k], rays[p, NORMAL + 2, k]
                for j in range(3):
                    rays[p, NORMAL + j, k] = (
                        matrix_of[row, 3 * j] * x
                        + matrix_of[row, 3 * j + 1] * y
                        + matrix_of[row, 3 * j + 2] * z
                    )
        for n in range(near_count):
            cast_at_body(scene, block, p, lanes, block.near[n])


@inner_kernel
def _near_chunk(
    scene: SceneHandle,
    origins: NDArray[np.float64],
    exclude: NDArray[np.int32],
    first: int,
    last: int,
    max_range: float,
    near: NDArray[np.int32],
) -> int:
    if scene.bodies.scene.shape[0] == 0:
        return 0
    x0, y0, z0 = origins[first, 0], origins[first, 1], origins[first, 2]
    x1, y1, z1 = x0, y0, z0
    for i in range(first + 1, last):
        x0, x1 = min(x0, origins[i, 0]), max(x1, origins[i, 0])
        y0, y1 = min(y0, origins[i, 1]), max(y1, origins[i, 1])
        z0, z1 = min(z0, origins[i, 2]), max(z1, origins[i, 2])
    low_uav = high_uav = exclude[first if exclude.shape[0] > 1 else 0]
    for i in range(first + 1, last if exclude.shape[0] > 1 else 0):
        low_uav, high_uav = min(low_uav, exclude[i]), max(high_uav, exclude[i])
    return near_bodies_of_several(
        scene.bodies, (x0, y0, z0), (x1, y1, z1), max_range, low_uav, high_uav, near
    )


@inner_kernel
def _load_skips(block: RayBlock, exclude: NDArray[np.int32], first: int, last: int) -> None:
    for i in range(first, last):
        row = exclude[i] if exclude.shape[0] > 1 else exclude[0]
        block.skip[(i - first) // LANES, (i - first) % LANES] = row


@kernel
def cast_rays(
    scene: SceneHandle,
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    max_range: float,
    exclude: NDArray[np.int32],
    fraction: float,
    counter: NDArray[np.int64],
    block: RayBlock,
    distance: NDArray[np.float32],
    normal: NDArray[np.float32],
    instance: NDArray[np.int32],
    material: NDArray[np.uint8],
) -> None:
    """Casts rays in chunks of CHUNK, numbered by `counter`; runs in every thread.

    origins, directions: (R, 3), map. exclude: (1,) or (R,) body rows. Fills distance (R,), normal
    (R, 3), instance (R,) and material (R,); see `Hits`.
    """
    count = origins.shape[0]
    for p in range(block.fraction.shape[0]):
        block.fraction[p] = fraction
    rays = block.rays
    while True:
        first = fetch_add(counter.ctypes.data) * CHUNK
        if first >= count:
            return
        last = min(first + CHUNK, count)
        near_count = _near_chunk(scene, origins, exclude, first, last, max_range, block.near)
        if near_count > 0:
            _load_skips(block, exclude, first, last)
        packets = (last - first + LANES - 1) // LANES
        for p in range(packets):
            start = first + p * LANES
            for k in range(min(LANES, last - start)):
                for j in range(3):
                    rays[p, ORIGIN + j, k] = origins[start + k, j]
                    rays[p, DIRECTION + j, k] = directions[start + k, j]
        cast_block(scene, block, last - first, max_range, near_count)
        for p in range(packets):
            start = first + p * LANES
            for k in range(min(LANES, last - start)):
                i = start + k
                hit = block.instance[p, k] >= 0
                x, y, z = rays[p, NORMAL, k], rays[p, NORMAL + 1, k], rays[p, NORMAL + 2, k]
                facing = (
                    x * rays[p, DIRECTION, k]
                    + y * rays[p, DIRECTION + 1, k]
                    + z * rays[p, DIRECTION + 2, k]
                )
                squared = max(x * x + y * y + z * z, np.float32(1e-30))
                scale = np.copysign(np.float32(1.0), -facing) / np.sqrt(squared)
                instance[i] = block.instance[p, k]
                material[i] = block.material[p, k]
                distance[i] = rays[p, FAR, k] if hit else np.float32(np.inf)
                normal[i, 0] = x * scale if hit else np.float32(0.0)
                normal[i, 1] = y * scale if hit else np.float32(0.0)
                normal[i, 2] = z * scale if hit else np.float32(0.0)


@inner_kernel
def _aim(
    block: RayBlock,
    origins: NDArray[np.float64],
    targets: NDArray[np.float64],
    first: int,
    p: int,
    lanes: int,
) -> None:
    """Fills a packet with rays that end just short of their targets."""
    rays, valid = block.rays[p], block.valid
    for k in range(LANES):
        i = first + p * LANES + min(k, lanes - 1)
        length = 0.0
        for j in range(3):
            length += (targets[i, j] - origins[i, j]) ** 2
        length = np.sqrt(length)
        for j in range(3):
            rays[ORIGIN + j, k] = origins[i, j]
            component = (targets[i, j] - origins[i, j]) / max(length, _SHORT_OF_TARGET_M)
            rays[DIRECTION + j, k] = _settled(np.float32(component))
        rays[FAR, k] = max(length - _SHORT_OF_TARGET_M, 0.0)
        valid[k] = -1 if k < lanes and length > _SHORT_OF_TARGET_M else 0


@kernel
def find_occluded(
    scene: SceneHandle,
    origins: NDArray[np.float64],
    targets: NDArray[np.float64],
    exclude: NDArray[np.int32],
    fraction: float,
    counter: NDArray[np.int64],
    block: RayBlock,
    occluded: NDArray[np.bool_],
) -> None:
    """Fills `occluded` (R,): whether anything lies between origins and targets (R, 3), map.

    Works in chunks numbered by `counter`; runs in every thread.
    """
    count = origins.shape[0]
    for p in range(block.fraction.shape[0]):
        block.fraction[p] = fraction
    while True:
        first = fetch_add(counter.ctypes.data) * CHUNK
        if first >= count:
            return
        last = min(first + CHUNK, count)
        longest = 0.0
        for i in range(first, last):
            squared = 0.0
            for j in range(3):
                squared += (targets[i, j] - origins[i, j]) ** 2
            longest = max(longest, squared)
        near_count = _near_chunk(scene, origins, exclude, first, last, np.sqrt(longest), block.near)
        if near_count > 0:
            _load_skips(block, exclude, first, last)
        for p in range((last - first + LANES - 1) // LANES):
            lanes = min(LANES, last - first - p * LANES)
            _aim(block, origins, targets, first, p, lanes)
            rays = block.rays[p]
            if scene.static != 0:
                arguments = block.coherent.ctypes.data if run_together(block.rays, p, lanes) else 0
                occluded_packet(block.valid.ctypes.data, scene.static, rays.ctypes.data, arguments)
            for n in range(near_count):
                hide_behind_body(scene, block, p, lanes, block.near[n])
            for k in range(lanes):
                occluded[first + p * LANES + k] = rays[FAR, k] < 0.0


@kernel
def find_enclosing(
    obstacles: int,
    trees: int,
    points: NDArray[np.float64],
    block: RayBlock,
    enclosing: NDArray[np.int32],
) -> None:
    """Fills `enclosing` (P,) with the closed solid around each point (P, 3) m, map; -1 for none.

    Straight up from inside, the first surface of a solid is hit from its back; trees, which are
    instances in the Embree scene `obstacles`, are passed.
    """
    rays, words, valid = block.rays, block.words, block.valid
    for k in range(LANES):
        valid[k] = -1 if k == 0 else 0
    for i in range(points.shape[0]):
        enclosing[i] = -1
        for j in range(3):
            rays[0, ORIGIN + j, 0] = points[i, j]
            rays[0, DIRECTION + j, 0] = np.float32(1.0) if j == 2 else np.float32(0.0)
        for _ in range(_MAX_PASSED):
            rays[0, FAR, 0] = np.float32(np.inf)
            words[0, GEOMETRY, 0] = _INVALID
            words[0, INSTANCE, 0] = _INVALID
            intersect_packet(valid.ctypes.data, obstacles, rays.ctypes.data, 0)
            if words[0, GEOMETRY, 0] == _INVALID:
                break
            if words[0, INSTANCE, 0] == _INVALID:
                if rays[0, NORMAL + 2, 0] > np.float32(0.0):
                    enclosing[i] = instance_of(np.int64(words[0, GEOMETRY, 0]), trees)
                break
            rays[0, ORIGIN + 2, 0] += rays[0, FAR, 0] + np.float32(_SHORT_OF_TARGET_M)
