"""Contact with the ground: impulses at feet, rotor tips and roof on the triangles of the terrain.

Each step the points that would pass the ground get impulses along its normal, never pulling, and
across it within Coulomb's cone, by sequential (Gauss-Seidel) sweeps as game physics does it (E.
Catto, "Iterative Dynamics with Temporal Coherence", 2005). A point still above the ground may close
its gap within the step and no more, so that nothing passes through at any speed; a point below it
is lifted gently. Impulses need no stiffness to be tuned: 27 g and 20 kg rest alike.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.vehicle.aerodynamics import MAX_CONTACTS
from volery.vehicle.airframe import Airframe
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rigid import matrix_of, three
from volery.world.terrain import Terrain, TerrainGrid, terrain_height, terrain_normal

Array = NDArray[np.float64]

SCRATCH_SHAPE = (MAX_CONTACTS, 12)
SWEEPS = 24
"""At most; sweeps end when no velocity changes by more than `_SETTLED`."""
_SETTLED = 1e-7
_SLOP = 5e-4
"""m of sinking that is left alone."""
_LIFT_SHARE = 0.1
_LIFT_SPEED = 1.0
"""m/s at which a sunken point is lifted at most."""
_TOUCHING = 2e-3
"""m within which a point counts as touching."""
_REBOUND_SPEED = 0.5
"""m/s of approach below which nothing rebounds."""
_COS_UPRIGHT = 0.5
"""Touching the ground with more than 60 degrees between the vehicle's axis and up is an impact."""
FRESH_S = 0.2
"""s without contact after which a touch is a new one."""

NO_TOUCH, TOUCH_DOWN, IMPACT = 0, 1, 2


def steepest_cosine(grid: TerrainGrid) -> float:
    """Cosine of the steepest slope of a terrain: true distance >= height over it * cosine."""
    h, spacing = np.asarray(grid.heights), float(grid.spacing)
    across, up = np.diff(h, axis=1) / spacing, np.diff(h, axis=0) / spacing
    below = np.hypot(across[:-1, :], up[:, 1:])
    above = np.hypot(across[1:, :], up[:, :-1])
    return float(1.0 / math.sqrt(1.0 + max(below.max(), above.max()) ** 2))


def standing_pose(airframe: Airframe, terrain: Terrain, x: float, y: float, yaw: float) -> Array:
    """Pose (7,) x, y, z m, quaternion x y z w, of a vehicle that stands at map position (x, y).

    It leans with the ground there; no foot is below the terrain.
    """
    normal = terrain.normal(x, y)
    tilt = np.array([-normal[1], normal[0], 0.0, 1.0 + normal[2]])
    attitude = rotations.multiply(rotations.normalize(tilt), rotations.from_rpy(0.0, 0.0, yaw))
    feet = rotations.rotate(attitude, np.array(airframe.ground.feet_m))
    ground = terrain.height(x + feet[:, 0], y + feet[:, 1])
    z = float((ground - feet[:, 2]).max())
    return np.concatenate([[x, y, z], attitude])


@inner_kernel
def resolve_contact(  # noqa: PLR0915
    body: Any, plant: Any, grid: TerrainGrid, bounce: bool, scratch: Array, dt: float
) -> float:
    """Change the body's velocity and rates so that nothing goes below the ground.

    The pose is that at the step's start, velocity and rates are those at its end without contact.
    scratch: `SCRATCH_SHAPE`. Returns the greatest speed of approach (m/s, along the normal), or -1
    where nothing touches.
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix_of(
        body.attitude[0], body.attitude[1], body.attitude[2], body.attitude[3]
    )
    vx, vy, vz = three(body.velocity_map)
    ux = r00 * vx + r10 * vy + r20 * vz
    uy = r01 * vx + r11 * vy + r21 * vz
    uz = r02 * vx + r12 * vy + r22 * vz
    ox, oy, oz = three(body.omega_body)
    light = plant.inverse_mass
    jx, jy, jz = three(plant.inverse_inertia)

    active = 0
    approach = -1.0
    for k in range(plant.contacts):
        px, py, pz = (
            plant.contact_point[k, 0],
            plant.contact_point[k, 1],
            plant.contact_point[k, 2],
        )
        x = body.position_map[0] + r00 * px + r01 * py + r02 * pz
        y = body.position_map[1] + r10 * px + r11 * py + r12 * pz
        z = body.position_map[2] + r20 * px + r21 * py + r22 * pz
        nx, ny, nz = terrain_normal(grid, x, y)
        gap = (z - terrain_height(grid, x, y)) * nz
        bx = r00 * nx + r10 * ny + r20 * nz
        by = r01 * nx + r11 * ny + r21 * nz
        bz = r02 * nx + r12 * ny + r22 * nz
        wx, wy, wz = py * bz - pz * by, pz * bx - px * bz, px * by - py * bx
        closing = -(ux * bx + uy * by + uz * bz + ox * wx + oy * wy + oz * wz)
        if gap > _TOUCHING and gap > closing * dt:
            continue
        approach = max(approach, closing, 0.0)
        wanted = -gap / dt
        if gap < 0.0:
            wanted = min(max(-gap - _SLOP, 0.0) * _LIFT_SHARE / dt, _LIFT_SPEED)
        if closing > _REBOUND_SPEED and (bounce or body.crashed):
            wanted = max(wanted, plant.restitution * closing)
        row = scratch[active]
        row[0], row[1], row[2] = px, py, pz
        row[3], row[4], row[5] = bx, by, bz
        row[6] = 1.0 / (light + wx * wx * jx + wy * wy * jy + wz * wz * jz)
        row[7] = wanted
        row[8] = 0.0
        row[9] = row[10] = row[11] = 0.0
        active += 1
    if active == 0:
        return -1.0

    for _ in range(SWEEPS):
        change = 0.0
        for k in range(active):
            row = scratch[k]
            px, py, pz = three(row)
            bx, by, bz = row[3], row[4], row[5]
            # along the normal: never pulling
            sx, sy, sz = ux + oy * pz - oz * py, uy + oz * px - ox * pz, uz + ox * py - oy * px
            push = max(row[8] + row[6] * (row[7] - (sx * bx + sy * by + sz * bz)), 0.0)
            step = push - row[8]
            row[8] = push
            fx, fy, fz = step * bx, step * by, step * bz
            ux += fx * light
            uy += fy * light
            uz += fz * light
            ox += (py * fz - pz * fy) * jx
            oy += (pz * fx - px * fz) * jy
            oz += (px * fy - py * fx) * jz
            change = max(change, abs(step) * light)
            # across it: against sliding, within the cone
            sx, sy, sz = ux + oy * pz - oz * py, uy + oz * px - ox * pz, uz + ox * py - oy * px
            along = sx * bx + sy * by + sz * bz
            sx -= along * bx
            sy -= along * by
            sz -= along * bz
            slide = math.sqrt(sx * sx + sy * sy + sz * sz)
            if slide < 1e-12:
                continue
            dx, dy, dz = sx / slide, sy / slide, sz / slide
            wx, wy, wz = py * dz - pz * dy, pz * dx - px * dz, px * dy - py * dx
            hold = slide / (light + wx * wx * jx + wy * wy * jy + wz * wz * jz)
            gx, gy, gz = row[9] - hold * dx, row[10] - hold * dy, row[11] - hold * dz
            size = math.sqrt(gx * gx + gy * gy + gz * gz)
            most = plant.friction * push
            if size > most:
                gx, gy, gz = gx * most / size, gy * most / size, gz * most / size
            fx, fy, fz = gx - row[9], gy - row[10], gz - row[11]
            row[9], row[10], row[11] = gx, gy, gz
            ux += fx * light
            uy += fy * light
            uz += fz * light
            ox += (py * fz - pz * fy) * jx
            oy += (pz * fx - px * fz) * jy
            oz += (px * fy - py * fx) * jz
            change = max(change, math.sqrt(fx * fx + fy * fy + fz * fz) * light)
        if change < _SETTLED:
            break

    body.velocity_map[0] = r00 * ux + r01 * uy + r02 * uz
    body.velocity_map[1] = r10 * ux + r11 * uy + r12 * uz
    body.velocity_map[2] = r20 * ux + r21 * uy + r22 * uz
    body.omega_body[0], body.omega_body[1], body.omega_body[2] = ox, oy, oz
    return approach


@inner_kernel
def classify_touch(
    body: Any, plant: Any, approach: float, speed: float, step: int, dt: float, bounce: bool
) -> int:
    """Whether a contact is news: `TOUCH_DOWN`, `IMPACT` or `NO_TOUCH`; remembers its time.

    speed: of the centre of mass before the contact, m/s. An impact is a touch faster than the
    landing limit, or with the vehicle tilted beyond 60 degrees; a crashed vehicle reports no more.
    """
    fresh = (step - body.last_contact_step) * dt > FRESH_S
    body.last_contact_step = step
    if body.crashed:
        return NO_TOUCH
    up = 1.0 - 2.0 * (body.attitude[0] ** 2 + body.attitude[1] ** 2)
    hard = approach > plant.landing_limit or (fresh and speed > plant.landing_limit)
    if hard or (up < _COS_UPRIGHT and (fresh or not bounce)):
        body.touch_speed = speed
        return IMPACT
    if fresh:
        body.touch_speed = speed
        return TOUCH_DOWN
    return NO_TOUCH
