"""Compiled ray casting over a scene: static Embree scene first, then the UAVs' bodies.

Bodies are few and move at every step, so they have no search tree over them: a packet is tested
against each body's bounding sphere and, where it may touch, turned into the body's frame and cast
at the Embree scene of its shape. Nothing has to be rebuilt when a UAV moves, a ray sees a body
where it was at the ray's own time, and a UAV's own body is simply left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inline_kernel, kernel
from volery.core.workers import fetch_add
from volery.world.embree import (
    DIRECTION,
    FAR,
    GEOMETRY,
    INSTANCE,
    INVALID,
    LANES,
    MASK,
    NEAR,
    NORMAL,
    ORIGIN,
    PACKET_ROWS,
    aligned_floats,
    intersect_packet,
    occluded_packet,
)

_INVALID = np.uint32(INVALID)
_CHUNK = 512
"""Rays of one piece of work; a multiple of LANES, so that packets do not depend on the threads."""
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


class Packet(NamedTuple):
    """Memory of one packet of LANES rays, and of its image in a body's frame."""

    rays: NDArray[np.float32]
    words: NDArray[np.uint32]
    valid: NDArray[np.int32]
    body_rays: NDArray[np.float32]
    body_words: NDArray[np.uint32]
    body_valid: NDArray[np.int32]
    skip: NDArray[np.int32]
    """(LANES,) body row that a lane does not see, -1 for none."""
    instance: NDArray[np.int32]
    """(LANES,) result: instance number, -1 for none."""
    material: NDArray[np.uint8]
    """(LANES,) result."""
    near: NDArray[np.int32]
    """(N,) body rows that the next packets may touch; the count is an argument."""


@inline_kernel
def new_packet(bodies: int) -> Packet:
    """Memory for casting in a scene with that many bodies."""
    rays = aligned_floats(PACKET_ROWS * LANES)
    body_rays = aligned_floats(PACKET_ROWS * LANES)
    valid = aligned_floats(LANES).view(np.int32)
    body_valid = aligned_floats(LANES).view(np.int32)
    return Packet(
        rays,
        rays.view(np.uint32),
        valid,
        body_rays,
        body_rays.view(np.uint32),
        body_valid,
        np.full(LANES, -1, dtype=np.int32),
        np.full(LANES, -1, dtype=np.int32),
        np.zeros(LANES, dtype=np.uint8),
        np.zeros(max(bodies, 1), dtype=np.int32),
    )


@inline_kernel
def reset_packet(packet: Packet, lanes: int, reach: float) -> None:
    """Make the first `lanes` lanes ready for a cast of that reach; origins and directions stay."""
    for k in range(LANES):
        packet.valid[k] = -1 if k < lanes else 0
        packet.rays[FAR * LANES + k] = reach
        packet.rays[NEAR * LANES + k] = 0.0
        packet.words[MASK * LANES + k] = _INVALID
        packet.words[GEOMETRY * LANES + k] = _INVALID
        packet.words[INSTANCE * LANES + k] = _INVALID


@inline_kernel
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


@inline_kernel
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


@inline_kernel
def _may_touch(packet: Packet, lanes: int, x: float, y: float, z: float, radius: float) -> bool:
    """Whether any of the lanes may meet the sphere; never wrong when it says no."""
    rays = packet.rays
    m = lanes // 2
    shift, spread, reach = 0.0, 0.0, 0.0
    for k in range(lanes):
        s, d = 0.0, 0.0
        for row in range(3):
            s += abs(rays[(ORIGIN + row) * LANES + k] - rays[(ORIGIN + row) * LANES + m])
            d += abs(rays[(DIRECTION + row) * LANES + k] - rays[(DIRECTION + row) * LANES + m])
        shift, spread = max(shift, s), max(spread, d)
        reach = max(reach, rays[FAR * LANES + k])
    cx = x - rays[ORIGIN * LANES + m]
    cy = y - rays[(ORIGIN + 1) * LANES + m]
    cz = z - rays[(ORIGIN + 2) * LANES + m]
    along = (
        cx * rays[DIRECTION * LANES + m]
        + cy * rays[(DIRECTION + 1) * LANES + m]
        + cz * rays[(DIRECTION + 2) * LANES + m]
    )
    away = cx * cx + cy * cy + cz * cz
    slack = radius + shift + spread * (np.sqrt(away) + radius + shift)
    if along < -slack or along > reach + slack:
        return False
    return bool(away - along * along <= slack * slack)


@inline_kernel
def _rotation(
    qx: float, qy: float, qz: float, qw: float
) -> tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]:
    """Rows of the rotation matrix."""
    return (
        (1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)),
        (2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)),
        (2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)),
    )


@inline_kernel
def _into_body(packet: Packet, lanes: int, row: int, pose: tuple[float, ...]) -> None:
    """Fill the body-frame packet; lanes that do not see this body stay masked."""
    x, y, z, qx, qy, qz, qw = pose
    a, b, c = _rotation(qx, qy, qz, qw)
    rays, out = packet.rays, packet.body_rays
    for k in range(LANES):
        ox = rays[ORIGIN * LANES + k] - x
        oy = rays[(ORIGIN + 1) * LANES + k] - y
        oz = rays[(ORIGIN + 2) * LANES + k] - z
        dx = rays[DIRECTION * LANES + k]
        dy = rays[(DIRECTION + 1) * LANES + k]
        dz = rays[(DIRECTION + 2) * LANES + k]
        for j in range(3):
            out[(ORIGIN + j) * LANES + k] = a[j] * ox + b[j] * oy + c[j] * oz
            out[(DIRECTION + j) * LANES + k] = a[j] * dx + b[j] * dy + c[j] * dz
        out[FAR * LANES + k] = rays[FAR * LANES + k]
        out[NEAR * LANES + k] = 0.0
        packet.body_words[MASK * LANES + k] = _INVALID
        packet.body_words[GEOMETRY * LANES + k] = _INVALID
        packet.body_valid[k] = -1 if k < lanes and packet.skip[k] != row else 0


@inline_kernel
def cast_packet(
    scene: SceneHandle, packet: Packet, lanes: int, near_count: int, fraction: float
) -> None:
    """Closest hits of the packet's first `lanes` lanes among static geometry and near bodies.

    Afterwards FAR holds the distance, NORMAL the map normal (any length, any side) and the
    packet's `instance` and `material` tell what was hit, -1 and NONE for nothing.
    """
    rays, words = packet.rays, packet.words
    if scene.static != 0:
        intersect_packet(packet.valid.ctypes.data, scene.static, rays.ctypes.data, 0)
    for k in range(lanes):
        part = words[GEOMETRY * LANES + k]
        if part == _INVALID:
            packet.instance[k] = -1
            packet.material[k] = 0
            continue
        number = words[INSTANCE * LANES + k]
        if number == _INVALID:  # terrain and solids are geometry of the top level
            packet.instance[k] = part
            packet.material[k] = scene.material[part, 0]
            continue
        packet.instance[k] = number
        packet.material[k] = scene.material[number, part]
        x = rays[NORMAL * LANES + k]
        y = rays[(NORMAL + 1) * LANES + k]
        z = rays[(NORMAL + 2) * LANES + k]
        m = scene.normal_matrix[number]
        rays[NORMAL * LANES + k] = m[0] * x + m[1] * y + m[2] * z
        rays[(NORMAL + 1) * LANES + k] = m[3] * x + m[4] * y + m[5] * z
        rays[(NORMAL + 2) * LANES + k] = m[6] * x + m[7] * y + m[8] * z
    for n in range(near_count):
        _cast_at_body(scene, packet, lanes, packet.near[n], fraction)


@inline_kernel
def _cast_at_body(
    scene: SceneHandle, packet: Packet, lanes: int, row: int, fraction: float
) -> None:
    bodies = scene.bodies
    pose = body_pose(bodies, row, fraction)
    if not _may_touch(packet, lanes, pose[0], pose[1], pose[2], bodies.radius[row]):
        return
    _into_body(packet, lanes, row, pose)
    intersect_packet(
        packet.body_valid.ctypes.data, bodies.scene[row], packet.body_rays.ctypes.data, 0
    )
    found = packet.body_rays
    a, b, c = _rotation(pose[3], pose[4], pose[5], pose[6])
    for k in range(lanes):
        part = packet.body_words[GEOMETRY * LANES + k]
        if part == _INVALID or packet.body_valid[k] == 0:
            continue
        x = found[NORMAL * LANES + k]
        y = found[(NORMAL + 1) * LANES + k]
        z = found[(NORMAL + 2) * LANES + k]
        packet.rays[FAR * LANES + k] = found[FAR * LANES + k]
        packet.rays[NORMAL * LANES + k] = a[0] * x + a[1] * y + a[2] * z
        packet.rays[(NORMAL + 1) * LANES + k] = b[0] * x + b[1] * y + b[2] * z
        packet.rays[(NORMAL + 2) * LANES + k] = c[0] * x + c[1] * y + c[2] * z
        packet.instance[k] = scene.moving_offset + row
        packet.material[k] = bodies.material[row, part]


@inline_kernel
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


@kernel
def cast_rays(
    scene: SceneHandle,
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    reach: float,
    exclude: NDArray[np.int32],
    fraction: float,
    counter: NDArray[np.int64],
    distance: NDArray[np.float32],
    normal: NDArray[np.float32],
    instance: NDArray[np.int32],
    material: NDArray[np.uint8],
) -> None:
    """Cast rays in chunks taken from `counter`; `exclude` has one row, or one a ray."""
    count = origins.shape[0]
    packet = new_packet(scene.bodies.scene.shape[0])
    rays = packet.rays
    while True:
        first = fetch_add(counter.ctypes.data) * _CHUNK
        if first >= count:
            return
        last = min(first + _CHUNK, count)
        near_count = _near_chunk(scene, origins, first, last, reach, packet.near)
        for start in range(first, last, LANES):
            lanes = min(LANES, last - start)
            for k in range(lanes):
                i = start + k
                for j in range(3):
                    rays[(ORIGIN + j) * LANES + k] = origins[i, j]
                    rays[(DIRECTION + j) * LANES + k] = directions[i, j]
                packet.skip[k] = exclude[i] if exclude.shape[0] > 1 else exclude[0]
            reset_packet(packet, lanes, reach)
            cast_packet(scene, packet, lanes, near_count, fraction)
            for k in range(lanes):
                i = start + k
                instance[i] = packet.instance[k]
                material[i] = packet.material[k]
                if packet.instance[k] < 0:
                    distance[i] = np.inf
                    normal[i, 0], normal[i, 1], normal[i, 2] = 0.0, 0.0, 0.0
                    continue
                distance[i] = rays[FAR * LANES + k]
                x = rays[NORMAL * LANES + k]
                y = rays[(NORMAL + 1) * LANES + k]
                z = rays[(NORMAL + 2) * LANES + k]
                facing = x * directions[i, 0] + y * directions[i, 1] + z * directions[i, 2]
                length = np.sqrt(x * x + y * y + z * z)
                scale = (-1.0 if facing > 0.0 else 1.0) / max(length, 1e-30)
                normal[i, 0], normal[i, 1], normal[i, 2] = x * scale, y * scale, z * scale


@inline_kernel
def _aim(
    packet: Packet,
    origins: NDArray[np.float64],
    targets: NDArray[np.float64],
    start: int,
    lanes: int,
) -> None:
    """Fill a packet with rays that end just short of their targets."""
    rays = packet.rays
    reset_packet(packet, lanes, 0.0)
    for k in range(lanes):
        i = start + k
        length = 0.0
        for j in range(3):
            length += (targets[i, j] - origins[i, j]) ** 2
        length = np.sqrt(length)
        for j in range(3):
            rays[(ORIGIN + j) * LANES + k] = origins[i, j]
            rays[(DIRECTION + j) * LANES + k] = (targets[i, j] - origins[i, j]) / max(
                length, _SHORT_OF_TARGET_M
            )
        rays[FAR * LANES + k] = max(length - _SHORT_OF_TARGET_M, 0.0)
        if length <= _SHORT_OF_TARGET_M:
            packet.valid[k] = 0


@inline_kernel
def _hide_behind_body(
    scene: SceneHandle, packet: Packet, lanes: int, row: int, fraction: float
) -> None:
    """Mark, by FAR = -inf, the lanes that meet a body."""
    pose = body_pose(scene.bodies, row, fraction)
    if not _may_touch(packet, lanes, pose[0], pose[1], pose[2], scene.bodies.radius[row]):
        return
    _into_body(packet, lanes, row, pose)
    far = packet.rays[FAR * LANES : (FAR + 1) * LANES]
    body_far = packet.body_rays[FAR * LANES : (FAR + 1) * LANES]
    for k in range(lanes):
        if packet.valid[k] == 0 or far[k] < 0.0:
            packet.body_valid[k] = 0
    occluded_packet(
        packet.body_valid.ctypes.data, scene.bodies.scene[row], packet.body_rays.ctypes.data, 0
    )
    for k in range(lanes):
        if packet.body_valid[k] != 0 and body_far[k] < 0.0:
            far[k] = -np.inf


@kernel
def find_occluded(
    scene: SceneHandle,
    origins: NDArray[np.float64],
    targets: NDArray[np.float64],
    exclude: NDArray[np.int32],
    fraction: float,
    counter: NDArray[np.int64],
    occluded: NDArray[np.bool_],
) -> None:
    """Whether anything lies between origins and targets, in chunks taken from `counter`."""
    count = origins.shape[0]
    packet = new_packet(scene.bodies.scene.shape[0])
    rays = packet.rays
    while True:
        first = fetch_add(counter.ctypes.data) * _CHUNK
        if first >= count:
            return
        last = min(first + _CHUNK, count)
        longest = 0.0
        for i in range(first, last):
            squared = 0.0
            for j in range(3):
                squared += (targets[i, j] - origins[i, j]) ** 2
            longest = max(longest, squared)
        near_count = _near_chunk(scene, origins, first, last, np.sqrt(longest), packet.near)
        for start in range(first, last, LANES):
            lanes = min(LANES, last - start)
            _aim(packet, origins, targets, start, lanes)
            for k in range(lanes):
                packet.skip[k] = exclude[start + k] if exclude.shape[0] > 1 else exclude[0]
            if scene.static != 0:
                occluded_packet(packet.valid.ctypes.data, scene.static, rays.ctypes.data, 0)
            for n in range(near_count):
                _hide_behind_body(scene, packet, lanes, packet.near[n], fraction)
            for k in range(lanes):
                occluded[start + k] = rays[FAR * LANES + k] < 0.0
