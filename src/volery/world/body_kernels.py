"""Compiled ray casting at bodies that move during a batch: UAVs, then actors.

Bodies are few and move at every step, so they have no search tree: a packet is tested against each
body's bounding sphere and, where it may hit, transformed to the body's frame and cast at the Embree
scene of its shape. Nothing is rebuilt when a UAV moves, a ray sees a body at its pose of the ray's
own time, and a UAV's own body is left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.core.rotation_kernels import matrix_rows
from volery.world.embree import (
    DIRECTION,
    FAR,
    GEOMETRY,
    INVALID,
    LANES,
    NEAR,
    NORMAL,
    ORIGIN,
    PRIMITIVE,
    intersect_packet,
    occluded_packet,
)
from volery.world.materials import Material
from volery.world.rotor_kernels import meets_blade
from volery.world.scene_memory import BodyTable, RayBlock, SceneHandle

_INVALID = np.uint32(INVALID)
_ROTOR = int(Material.ROTOR)
_PAST_M = np.float32(1e-4)
"""Distance behind the disc at which a ray through a gap restarts, m."""


@inner_kernel
def body_pose(
    bodies: BodyTable, row: int, fraction: float
) -> tuple[float, float, float, float, float, float, float]:
    """Returns the pose of a body at `fraction` of the interval: linear, quaternion normalized."""
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
def body_sphere(bodies: BodyTable, row: int) -> tuple[float, float, float, float]:
    """Returns centre (x, y, z) and radius, m, of a sphere around a body in the interval."""
    a, b = bodies.start, bodies.end
    x, y = 0.5 * (a[row, 0] + b[row, 0]), 0.5 * (a[row, 1] + b[row, 1])
    z = 0.5 * (a[row, 2] + b[row, 2])
    dx, dy, dz = a[row, 0] - x, a[row, 1] - y, a[row, 2] - z
    return x, y, z, bodies.radius[row] + np.sqrt(dx * dx + dy * dy + dz * dz)


@inner_kernel
def near_bodies(
    bodies: BodyTable,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    max_range: float,
    uav: int,
    near: NDArray[np.int32],
) -> int:
    """Lists in `near` the bodies that rays from a box may hit; returns their number.

    low, high: corners of the box, m, map. uav: the row of the rays' UAV; -1 for rays of no UAV.
    """
    return near_bodies_of_several(bodies, low, high, max_range, uav, uav, near)


@inner_kernel
def near_bodies_of_several(
    bodies: BodyTable,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    max_range: float,
    first_uav: int,
    last_uav: int,
    near: NDArray[np.int32],
) -> int:
    """Lists bodies as `near_bodies`, for rays of the UAVs from `first_uav` to `last_uav`.

    Both are rows; -1 if rays of no UAV are among them.
    """
    count = 0
    uavs = bodies.scene.shape[0] - bodies.actors
    first, seen = 0, uavs
    if first_uav >= 0:
        first = first_uav - first_uav % bodies.uavs_per_env
        seen = last_uav - last_uav % bodies.uavs_per_env + bodies.uavs_per_env - first
        if bodies.uavs_per_env == 1:  # rays do not see their own UAV, nor other environments
            seen = 0
    for n in range(seen + bodies.actors):
        i = first + n if n < seen else uavs + n - seen
        if i == first_uav == last_uav and i >= 0:
            continue
        squared = 0.0
        for j in range(3):
            a, b = bodies.start[i, j], bodies.end[i, j]
            gap = max(low[j] - max(a, b), min(a, b) - high[j], 0.0)
            squared += gap * gap
        limit = max_range + bodies.radius[i]
        if squared <= limit * limit:
            near[count] = i
            count += 1
    return count


@inner_kernel
def _may_touch(
    rays: NDArray[np.float32], lanes: int, x: float, y: float, z: float, radius: float
) -> bool:
    """Returns whether a packet's lanes may hit the sphere; false is always exact."""
    m = lanes // 2
    shift, spread, max_range = 0.0, 0.0, 0.0
    for k in range(lanes):
        s, d = 0.0, 0.0
        for row in range(3):
            s += abs(rays[ORIGIN + row, k] - rays[ORIGIN + row, m])
            d += abs(rays[DIRECTION + row, k] - rays[DIRECTION + row, m])
        shift, spread = max(shift, s), max(spread, d)
        max_range = max(max_range, rays[FAR, k])
    cx = x - rays[ORIGIN, m]
    cy = y - rays[ORIGIN + 1, m]
    cz = z - rays[ORIGIN + 2, m]
    along = cx * rays[DIRECTION, m] + cy * rays[DIRECTION + 1, m] + cz * rays[DIRECTION + 2, m]
    away = cx * cx + cy * cy + cz * cz
    slack = radius + shift + spread * (np.sqrt(away) + radius + shift)
    if along < -slack or along > max_range + slack:
        return False
    return bool(away - along * along <= slack * slack)


@inner_kernel
def _sees(bodies: BodyTable, uav: int, row: int) -> bool:
    """Returns whether rays of `uav` (-1: of none) may hit body `row`."""
    is_actor = row >= bodies.scene.shape[0] - bodies.actors
    own_copy = uav // bodies.uavs_per_env == row // bodies.uavs_per_env
    return bool(uav < 0 or is_actor or (uav != row and own_copy))


@inner_kernel
def _into_body(
    bodies: BodyTable, block: RayBlock, p: int, lanes: int, row: int, pose: tuple[float, ...]
) -> None:
    """Fills the body-frame packet; lanes that do not see this body remain masked."""
    x, y, z, qx, qy, qz, qw = pose
    a, b, c = matrix_rows(qx, qy, qz, qw)
    rays, out = block.rays[p], block.body_rays
    for k in range(LANES):
        ox, oy, oz = rays[ORIGIN, k] - x, rays[ORIGIN + 1, k] - y, rays[ORIGIN + 2, k] - z
        dx, dy, dz = rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k]
        for j in range(3):
            out[ORIGIN + j, k] = a[j] * ox + b[j] * oy + c[j] * oz
            out[DIRECTION + j, k] = a[j] * dx + b[j] * dy + c[j] * dz
        out[FAR, k] = rays[FAR, k]
        block.body_words[GEOMETRY, k] = _INVALID
        block.body_valid[k] = -1 if k < lanes and _sees(bodies, block.skip[p, k], row) else 0


@inner_kernel
def _leave_gaps(bodies: BodyTable, block: RayBlock, p: int, row: int) -> bool:
    """Restarts rays that passed between a rotor's blades behind it; returns whether any did."""
    found, words, rays = block.body_rays, block.body_words, block.rays[p]
    again = False
    for k in range(LANES):
        part = words[GEOMETRY, k]
        if block.body_valid[k] == 0 or part == _INVALID or bodies.material[row, part] != _ROTOR:
            continue
        far = found[FAR, k]
        x = found[ORIGIN, k] + far * found[DIRECTION, k]
        y = found[ORIGIN + 1, k] + far * found[DIRECTION + 1, k]
        z = found[ORIGIN + 2, k] + far * found[DIRECTION + 2, k]
        triangle = int(words[PRIMITIVE, k])
        if not meets_blade(bodies, row, triangle, block.fraction[p], x, y, z):
            words[GEOMETRY, k] = _INVALID
            found[NEAR, k] = far + _PAST_M
            found[FAR, k] = rays[FAR, k]
            again = True
    return again


@inner_kernel
def _cast_in_body(bodies: BodyTable, block: RayBlock, p: int, row: int) -> None:
    """Finds the closest hits of the body-frame packet, through the gaps of turning rotors."""
    found, valid = block.body_rays, block.body_valid
    intersect_packet(valid.ctypes.data, bodies.scene[row], found.ctypes.data, 0)
    if bodies.rotors.shape[1] == 0:
        return
    for _ in range(bodies.rotors.shape[1]):  # each disc is hit at most once
        if not _leave_gaps(bodies, block, p, row):
            break
        intersect_packet(valid.ctypes.data, bodies.scene[row], found.ctypes.data, 0)
    for k in range(LANES):
        found[NEAR, k] = 0.0


@inner_kernel
def cast_at_body(scene: SceneHandle, block: RayBlock, p: int, lanes: int, row: int) -> None:
    """Shortens the rays of packet `p` that hit a body."""
    bodies = scene.bodies
    pose = body_pose(bodies, row, block.fraction[p])
    rays = block.rays[p]
    if not _may_touch(rays, lanes, pose[0], pose[1], pose[2], bodies.radius[row]):
        return
    _into_body(scene.bodies, block, p, lanes, row, pose)
    found = block.body_rays
    _cast_in_body(bodies, block, p, row)
    a, b, c = matrix_rows(pose[3], pose[4], pose[5], pose[6])
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
def hide_behind_body(scene: SceneHandle, block: RayBlock, p: int, lanes: int, row: int) -> None:
    """Marks, by FAR = -inf, the lanes that hit a body."""
    pose = body_pose(scene.bodies, row, block.fraction[p])
    rays, found, sees = block.rays[p], block.body_rays, block.body_valid
    if not _may_touch(rays, lanes, pose[0], pose[1], pose[2], scene.bodies.radius[row]):
        return
    _into_body(scene.bodies, block, p, lanes, row, pose)
    for k in range(lanes):
        if block.valid[k] == 0 or rays[FAR, k] < 0.0:
            sees[k] = 0
    if scene.bodies.rotors.shape[1] > 0:
        _cast_in_body(scene.bodies, block, p, row)
        for k in range(lanes):
            if sees[k] != 0 and block.body_words[GEOMETRY, k] != _INVALID:
                rays[FAR, k] = -np.inf
        return
    occluded_packet(sees.ctypes.data, scene.bodies.scene[row], found.ctypes.data, 0)
    for k in range(lanes):
        if sees[k] != 0 and found[FAR, k] < 0.0:
            rays[FAR, k] = -np.inf
