"""Compiled ray casting over a scene: static Embree scene first, then the UAVs' bodies.

Bodies are few and move at every step, so they have no search tree over them: a packet is tested
against each body's bounding sphere and, where it may touch, turned into the body's frame and cast
at the Embree scene of its shape. Nothing has to be rebuilt when a UAV moves, a ray sees a body
where it was at the ray's own time, and a UAV's own body is simply left out.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.workers import fetch_add
from volery.world.embree import (
    DIRECTION,
    FAR,
    GEOMETRY,
    INSTANCE,
    INVALID,
    LANES,
    MASK,
    NORMAL,
    ORIGIN,
    PACKET_ROWS,
    aligned,
    coherent_arguments,
    intersect_packet,
    occluded_packet,
)

_INVALID = np.uint32(INVALID)
CHUNK = 512
"""Rays of one piece of work; a multiple of LANES, so that packets do not depend on the threads."""
_KEPT_BLOCKS = 8
_TOGETHER_M, _TOGETHER_COSINE = 1.0, 0.9
"""Rays of a packet count as running close together up to this distance and angle."""
_LEAST_COMPONENT = np.float32(1e-12)
"""Smaller components of a direction are made zero.

Embree's coherent traversal sorts rays by the signs of their directions, but takes the reciprocal of
a component below 1e-18 as positive: one beam at -90 degrees, whose cosine is a rounding error, then
makes its neighbours miss.
"""
_SHORT_OF_TARGET_M = 1e-4
"""`occluded` looks this much less far than the target, so that the target's surface is no cover."""


class BodyTable(NamedTuple):
    """The moving bodies, one row a UAV."""

    scene: NDArray[np.int64]
    """(N,) Embree scene of the shape, in the body frame."""
    radius: NDArray[np.float64]
    """(N,) m, of the sphere about the body's origin that holds the shape."""
    material: NDArray[np.uint8]
    """(N, parts)."""
    start: NDArray[np.float64]
    """(N, 7) x y z qx qy qz qw at fraction 0 of the interval that rays may look into."""
    end: NDArray[np.float64]
    """(N, 7) the same at fraction 1: the newest pose."""


class SceneHandle(NamedTuple):
    """What kernels need of a scene; valid until the scene is closed."""

    static: int
    """Embree scene of terrain, trees and solids."""
    moving_offset: int
    """Instance number of the first body."""
    normal_matrix: NDArray[np.float32]
    """(instances, 9) rows of the matrix that takes normals to the map (not unit length)."""
    material: NDArray[np.uint8]
    """(instances, 2) of the instance's parts (trees: wood, leaves)."""
    bodies: BodyTable


class RayBlock(NamedTuple):
    """Rays and results of one piece of work, P packets of LANES rays; used by one thread at a time.

    Kernels fill `rays` (and `skip`, `fraction`), call `cast_block` and read the rest.
    """

    rays: NDArray[np.float32]
    """(P, PACKET_ROWS, LANES) Embree's packets. Set ORIGIN and unit DIRECTION, map; read FAR, m,
    and, where something was hit, NORMAL, map, of any length, facing any side."""
    words: NDArray[np.uint32]
    """The same memory as whole numbers."""
    skip: NDArray[np.int32]
    """(P, LANES) row of the body that a ray does not see, -1 for none."""
    fraction: NDArray[np.float64]
    """(P,) where in their interval of motion a packet sees the bodies."""
    instance: NDArray[np.int32]
    """(P, LANES) result: instance number, -1 for none."""
    material: NDArray[np.uint8]
    """(P, LANES) result."""
    near: NDArray[np.int32]
    """(N,) body rows that these rays may touch; the count is an argument."""
    valid: NDArray[np.int32]
    """(LANES,) -1 for the lanes that are cast."""
    body_rays: NDArray[np.float32]
    """(PACKET_ROWS, LANES) a packet in a body's frame."""
    body_words: NDArray[np.uint32]
    """The same memory as whole numbers."""
    body_valid: NDArray[np.int32]
    """(LANES,)."""
    coherent: NDArray[np.int32]
    """Embree's arguments for rays that run close together."""


def new_block(rays: int, bodies: int) -> RayBlock:
    """Memory for `rays` rays in a scene with that many bodies."""
    packets = (rays + LANES - 1) // LANES
    memory = aligned((packets, PACKET_ROWS, LANES))
    body_memory = aligned((PACKET_ROWS, LANES))
    words, body_words = memory.view(np.uint32), body_memory.view(np.uint32)
    words[:, MASK] = INVALID
    body_words[MASK] = INVALID
    return RayBlock(
        rays=memory,
        words=words,
        skip=np.full((packets, LANES), -1, dtype=np.int32),
        fraction=np.ones(packets),
        instance=np.zeros((packets, LANES), dtype=np.int32),
        material=np.zeros((packets, LANES), dtype=np.uint8),
        near=np.zeros(max(bodies, 1), dtype=np.int32),
        valid=aligned((LANES,), np.int32),
        body_rays=body_memory,
        body_words=body_words,
        body_valid=aligned((LANES,), np.int32),
        coherent=coherent_arguments(),
    )


_own = threading.local()


def thread_block(rays: int, bodies: int) -> RayBlock:
    """The calling thread's block of that size, kept between calls."""
    blocks: dict[tuple[int, int], RayBlock] = _own.__dict__.setdefault("blocks", {})
    block = blocks.get((rays, bodies))
    if block is None:
        if len(blocks) >= _KEPT_BLOCKS:
            blocks.clear()
        block = blocks[rays, bodies] = new_block(rays, bodies)
    return block


@inner_kernel
def body_pose(
    bodies: BodyTable, row: int, fraction: float
) -> tuple[float, float, float, float, float, float, float]:
    """Pose of a body at `fraction` of the interval: linear, the quaternion normalized."""
    a, b = bodies.start, bodies.end
    g = 1.0 - fraction
    dot = 0.0
    for j in range(3, 7):
        dot += a[row, j] * b[row, j]
    h = -fraction if dot < 0.0 else fraction
    qx = g * a[row, 3] + h * b[row, 3]
    qy = g * a[row, 4] + h * b[row, 4]
    qz = g * a[row, 5] + h * b[row, 5]
    qw = g * a[row, 6] + h * b[row, 6]
    n = 1.0 / np.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    return (
        g * a[row, 0] + fraction * b[row, 0],
        g * a[row, 1] + fraction * b[row, 1],
        g * a[row, 2] + fraction * b[row, 2],
        qx * n,
        qy * n,
        qz * n,
        qw * n,
    )


@inner_kernel
def near_bodies(
    bodies: BodyTable,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    reach: float,
    near: NDArray[np.int32],
) -> int:
    """List the bodies that rays from the box `low`..`high` may touch; their number."""
    count = 0
    for i in range(bodies.scene.shape[0]):
        squared = 0.0
        for j in range(3):
            a, b = bodies.start[i, j], bodies.end[i, j]
            gap = max(low[j] - max(a, b), min(a, b) - high[j], 0.0)
            squared += gap * gap
        limit = reach + bodies.radius[i]
        if squared <= limit * limit:
            near[count] = i
            count += 1
    return count


@inner_kernel
def _may_touch(
    rays: NDArray[np.float32], lanes: int, x: float, y: float, z: float, radius: float
) -> bool:
    """Whether any of a packet's lanes may meet the sphere; never wrong when it says no."""
    m = lanes // 2
    shift, spread, reach = 0.0, 0.0, 0.0
    for k in range(lanes):
        s, d = 0.0, 0.0
        for row in range(3):
            s += abs(rays[ORIGIN + row, k] - rays[ORIGIN + row, m])
            d += abs(rays[DIRECTION + row, k] - rays[DIRECTION + row, m])
        shift, spread = max(shift, s), max(spread, d)
        reach = max(reach, rays[FAR, k])
    cx = x - rays[ORIGIN, m]
    cy = y - rays[ORIGIN + 1, m]
    cz = z - rays[ORIGIN + 2, m]
    along = cx * rays[DIRECTION, m] + cy * rays[DIRECTION + 1, m] + cz * rays[DIRECTION + 2, m]
    away = cx * cx + cy * cy + cz * cz
    slack = radius + shift + spread * (np.sqrt(away) + radius + shift)
    if along < -slack or along > reach + slack:
        return False
    return bool(away - along * along <= slack * slack)


@inner_kernel
def _rotation(
    qx: float, qy: float, qz: float, qw: float
) -> tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]:
    """Rows of the rotation matrix."""
    return (
        (1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)),
        (2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)),
        (2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)),
    )


@inner_kernel
def _into_body(block: RayBlock, p: int, lanes: int, row: int, pose: tuple[float, ...]) -> None:
    """Fill the body-frame packet; lanes that do not see this body stay masked."""
    x, y, z, qx, qy, qz, qw = pose
    a, b, c = _rotation(qx, qy, qz, qw)
    rays, out = block.rays[p], block.body_rays
    for k in range(LANES):
        ox, oy, oz = rays[ORIGIN, k] - x, rays[ORIGIN + 1, k] - y, rays[ORIGIN + 2, k] - z
        dx, dy, dz = rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k]
        for j in range(3):
            out[ORIGIN + j, k] = a[j] * ox + b[j] * oy + c[j] * oz
            out[DIRECTION + j, k] = a[j] * dx + b[j] * dy + c[j] * dz
        out[FAR, k] = rays[FAR, k]
        block.body_words[GEOMETRY, k] = _INVALID
        block.body_valid[k] = -1 if k < lanes and block.skip[p, k] != row else 0


@inner_kernel
def _cast_at_body(scene: SceneHandle, block: RayBlock, p: int, lanes: int, row: int) -> None:
    """Let one body shorten the rays of packet `p`."""
    bodies = scene.bodies
    pose = body_pose(bodies, row, block.fraction[p])
    rays = block.rays[p]
    if not _may_touch(rays, lanes, pose[0], pose[1], pose[2], bodies.radius[row]):
        return
    _into_body(block, p, lanes, row, pose)
    found = block.body_rays
    intersect_packet(block.body_valid.ctypes.data, bodies.scene[row], found.ctypes.data, 0)
    a, b, c = _rotation(pose[3], pose[4], pose[5], pose[6])
    for k in range(lanes):
        part = block.body_words[GEOMETRY, k]
        if part == _INVALID or block.body_valid[k] == 0:
            continue
        x, y, z = found[NORMAL, k], found[NORMAL + 1, k], found[NORMAL + 2, k]
        rays[FAR, k] = found[FAR, k]
        rays[NORMAL, k] = a[0] * x + a[1] * y + a[2] * z
        rays[NORMAL + 1, k] = b[0] * x + b[1] * y + b[2] * z
        rays[NORMAL + 2, k] = c[0] * x + c[1] * y + c[2] * z
        block.instance[p, k] = scene.moving_offset + row
        block.material[p, k] = bodies.material[row, part]


@inner_kernel
def _settled(component: Any) -> Any:
    """A component of a direction, zero where it is next to nothing."""
    return component if abs(component) >= _LEAST_COMPONENT else np.float32(0.0)


@inner_kernel
def _make_ready(rays: NDArray[np.float32], words: NDArray[np.uint32], reach: float) -> None:
    """Set the rows of a packet that a cast changes."""
    for k in range(LANES):
        rays[FAR, k] = reach
        words[GEOMETRY, k] = _INVALID
        words[INSTANCE, k] = _INVALID
    for j in range(DIRECTION, DIRECTION + 3):
        for k in range(LANES):
            rays[j, k] = _settled(rays[j, k])


@inner_kernel
def _together(rays: NDArray[np.float32], lanes: int) -> bool:
    """Whether first and last ray of a packet run close together."""
    last = lanes - 1
    apart, along = 0.0, 0.0
    for row in range(3):
        apart += abs(rays[ORIGIN + row, 0] - rays[ORIGIN + row, last])
        along += rays[DIRECTION + row, 0] * rays[DIRECTION + row, last]
    return bool(apart < _TOGETHER_M and along > _TOGETHER_COSINE)


@inner_kernel
def cast_block(
    scene: SceneHandle, block: RayBlock, count: int, reach: float, near_count: int
) -> None:
    """Closest hits of the block's first `count` rays among static geometry and near bodies.

    One call handles many packets: handing so many arrays to a function costs as much as a ray.
    """
    rays, words, valid = block.rays, block.words, block.valid
    instance, material = block.instance, block.material
    rays_address, valid_address = rays.ctypes.data, valid.ctypes.data
    coherent_address = block.coherent.ctypes.data
    static, material_of, matrix_of = scene.static, scene.material, scene.normal_matrix
    packets = (count + LANES - 1) // LANES
    limit: Any = np.float32(reach)
    for k in range(LANES):
        valid[k] = -1
    for p in range(packets):
        lanes = min(LANES, count - p * LANES)
        for k in range(lanes, LANES):
            valid[k] = 0
        _make_ready(rays[p], words[p], limit)
        if static != 0:
            arguments = coherent_address if _together(rays[p], lanes) else 0
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
                instance[p, k] = part
                material[p, k] = material_of[part, 0]
            else:
                instance[p, k] = number
                material[p, k] = material_of[number, part]
                x, y, z = rays[p, NORMAL, k], rays[p, NORMAL + 1, k], rays[p, NORMAL + 2, k]
                for j in range(3):
                    rays[p, NORMAL + j, k] = (
                        matrix_of[number, 3 * j] * x
                        + matrix_of[number, 3 * j + 1] * y
                        + matrix_of[number, 3 * j + 2] * z
                    )
        for n in range(near_count):
            _cast_at_body(scene, block, p, lanes, block.near[n])


@inner_kernel
def _near_chunk(
    scene: SceneHandle,
    origins: NDArray[np.float64],
    first: int,
    last: int,
    reach: float,
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
    return near_bodies(scene.bodies, (x0, y0, z0), (x1, y1, z1), reach, near)


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
    reach: float,
    exclude: NDArray[np.int32],
    fraction: float,
    counter: NDArray[np.int64],
    block: RayBlock,
    distance: NDArray[np.float32],
    normal: NDArray[np.float32],
    instance: NDArray[np.int32],
    material: NDArray[np.uint8],
) -> None:
    """Cast rays in chunks of CHUNK taken from `counter`; `exclude` has one row, or one a ray."""
    count = origins.shape[0]
    for p in range(block.fraction.shape[0]):
        block.fraction[p] = fraction
    rays = block.rays
    while True:
        first = fetch_add(counter.ctypes.data) * CHUNK
        if first >= count:
            return
        last = min(first + CHUNK, count)
        near_count = _near_chunk(scene, origins, first, last, reach, block.near)
        if near_count > 0:
            _load_skips(block, exclude, first, last)
        packets = (last - first + LANES - 1) // LANES
        for p in range(packets):
            start = first + p * LANES
            for k in range(min(LANES, last - start)):
                for j in range(3):
                    rays[p, ORIGIN + j, k] = origins[start + k, j]
                    rays[p, DIRECTION + j, k] = directions[start + k, j]
        cast_block(scene, block, last - first, reach, near_count)
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
    """Fill a packet with rays that end just short of their targets."""
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


@inner_kernel
def _hide_behind_body(scene: SceneHandle, block: RayBlock, p: int, lanes: int, row: int) -> None:
    """Mark, by FAR = -inf, the lanes that meet a body."""
    pose = body_pose(scene.bodies, row, block.fraction[p])
    rays, found, sees = block.rays[p], block.body_rays, block.body_valid
    if not _may_touch(rays, lanes, pose[0], pose[1], pose[2], scene.bodies.radius[row]):
        return
    _into_body(block, p, lanes, row, pose)
    for k in range(lanes):
        if block.valid[k] == 0 or rays[FAR, k] < 0.0:
            sees[k] = 0
    occluded_packet(sees.ctypes.data, scene.bodies.scene[row], found.ctypes.data, 0)
    for k in range(lanes):
        if sees[k] != 0 and found[FAR, k] < 0.0:
            rays[FAR, k] = -np.inf


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
    """Whether anything lies between origins and targets, in chunks taken from `counter`."""
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
        near_count = _near_chunk(scene, origins, first, last, np.sqrt(longest), block.near)
        if near_count > 0:
            _load_skips(block, exclude, first, last)
        for p in range((last - first + LANES - 1) // LANES):
            lanes = min(LANES, last - first - p * LANES)
            _aim(block, origins, targets, first, p, lanes)
            rays = block.rays[p]
            if scene.static != 0:
                arguments = block.coherent.ctypes.data if _together(rays, lanes) else 0
                occluded_packet(block.valid.ctypes.data, scene.static, rays.ctypes.data, arguments)
            for n in range(near_count):
                _hide_behind_body(scene, block, p, lanes, block.near[n])
            for k in range(lanes):
                occluded[first + p * LANES + k] = rays[FAR, k] < 0.0
