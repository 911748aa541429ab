"""Contact with the ground: impulses at feet, rotor tips and roof on the triangles of the terrain.

Each step, points that would pass the ground receive impulses along its normal, never pulling, and
across it within Coulomb's cone, by sequential (Gauss-Seidel) sweeps as in game physics (E. Catto,
"Iterative Dynamics with Temporal Coherence", 2005). A point above the ground may close its gap
within the step and no more, so that nothing tunnels at any speed; a point below the ground is
lifted gently. Impulses need no stiffness to be tuned: 27 g and 20 kg rest alike.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np

from volery.core.arrays import Array
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.plant import MAX_CONTACTS
from volery.vehicle.rotation_math import matrix_of, three
from volery.world.terrain import TerrainGrid, terrain_height, terrain_normal

Three: TypeAlias = tuple[float, float, float]
Six: TypeAlias = tuple[float, float, float, float, float, float]
"""Velocity (m/s) and rates (rad/s) in the body frame."""
Nine: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""Rotation matrix, map from body, row by row."""

# A row of the scratch memory is one contact, in the body frame: the point (m), the ground's normal,
# the effective mass along it (kg), the desired speed along it (m/s), the impulses so far along it
# and across it (N s).
_POINT, _NORMAL, _MASS, _WANTED, _PUSH, _GRIP, _ROW = 0, 3, 6, 7, 8, 9, 12
SCRATCH_SHAPE = (MAX_CONTACTS, _ROW)
SWEEPS = 24
"""Maximum number; sweeps end when no velocity changes by more than `_SETTLED`."""
_SETTLED = 1e-7
_SLOP = 5e-4
"""Penetration that is not corrected, m."""
_LIFT_FRACTION = 0.1
_LIFT_SPEED = 1.0
"""Maximum speed at which a point below the ground is lifted, m/s."""
_TOUCHING = 2e-3
"""Distance within which a point counts as touching, m."""
_NO_SLIDE = 1e-12
"""Speed below which a point does not slide, m/s."""
_REBOUND_SPEED = 0.5
"""Speed of approach below which nothing rebounds, m/s."""
_COS_UPRIGHT = 0.5
"""Cosine of 60 degrees: contact with a larger tilt of the vehicle's axis is an impact."""
FRESH_S = 0.2
"""Time without contact after which a touch is a new one, s."""

NO_TOUCH, TOUCH_DOWN, IMPACT = 0, 1, 2


def steepest_cosine(grid: TerrainGrid) -> float:
    """Returns the cosine of a terrain's steepest slope: distance >= height above it * cosine."""
    h, spacing = np.asarray(grid.heights), float(grid.spacing)
    across, up = np.diff(h, axis=1) / spacing, np.diff(h, axis=0) / spacing
    below = np.hypot(across[:-1, :], up[:, 1:])
    above = np.hypot(across[1:, :], up[:, :-1])
    return float(1.0 / math.sqrt(1.0 + max(below.max(), above.max()) ** 2))


@inner_kernel
def resolve_contact(
    body: Any, plant: Any, grid: TerrainGrid, bounce: bool, scratch: Array, dt: float
) -> float:
    """Changes velocity and rates so that no contact point passes the ground.

    The pose is that at the step's start, velocity and rates are those at its end without contact.
    scratch: `SCRATCH_SHAPE`. Returns the maximum speed of approach (m/s, along the normal), or -1
    without contact.
    """
    turn = matrix_of(body.attitude[0], body.attitude[1], body.attitude[2], body.attitude[3])
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = turn
    vx, vy, vz = three(body.velocity_map)
    ux = r00 * vx + r10 * vy + r20 * vz
    uy = r01 * vx + r11 * vy + r21 * vz
    uz = r02 * vx + r12 * vy + r22 * vz
    ox, oy, oz = three(body.omega_body)
    motion = ux, uy, uz, ox, oy, oz

    active, approach = _list_contacts(body, plant, grid, turn, motion, bounce, scratch, dt)
    if active == 0:
        return approach
    ux, uy, uz, ox, oy, oz = _settled(plant, scratch, active, motion)

    body.velocity_map[0] = r00 * ux + r01 * uy + r02 * uz
    body.velocity_map[1] = r10 * ux + r11 * uy + r12 * uz
    body.velocity_map[2] = r20 * ux + r21 * uy + r22 * uz
    body.omega_body[0], body.omega_body[1], body.omega_body[2] = ox, oy, oz
    return approach


@inner_kernel
def _list_contacts(
    body: Any,
    plant: Any,
    grid: TerrainGrid,
    turn: Nine,
    motion: Six,
    bounce: bool,
    scratch: Array,
    dt: float,
) -> tuple[int, float]:
    """Writes the points that touch, or would within the step, to `scratch`.

    Returns their number and the maximum speed of approach, m/s, -1 without any.
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = turn
    ux, uy, uz, ox, oy, oz = motion
    active = 0
    approach = -1.0
    for k in range(plant.contacts):
        px, py, pz = three(plant.contact_point[k])
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
        row = scratch[active]
        row[_POINT], row[_POINT + 1], row[_POINT + 2] = px, py, pz
        row[_NORMAL], row[_NORMAL + 1], row[_NORMAL + 2] = bx, by, bz
        row[_MASS] = 1.0 / _ease(plant, wx, wy, wz)
        row[_WANTED] = _wanted_speed(plant, gap, closing, bounce or body.crashed, dt)
        row[_PUSH] = 0.0
        row[_GRIP] = row[_GRIP + 1] = row[_GRIP + 2] = 0.0
        active += 1
    return active, approach


@inner_kernel
def _wanted_speed(plant: Any, gap: float, closing: float, rebounds: bool, dt: float) -> float:
    """Returns the minimum speed along the normal of a point after the step, m/s."""
    wanted = -gap / dt
    if gap < 0.0:
        wanted = min(max(-gap - _SLOP, 0.0) * _LIFT_FRACTION / dt, _LIFT_SPEED)
    if closing > _REBOUND_SPEED and rebounds:
        wanted = max(wanted, plant.restitution * closing)
    return wanted


@inner_kernel
def _settled(plant: Any, scratch: Array, active: int, motion: Six) -> Six:
    """Returns the motion after sweeps over the contacts until the impulses converge."""
    ux, uy, uz, ox, oy, oz = motion
    for _ in range(SWEEPS):
        change = 0.0
        for k in range(active):
            row = scratch[k]
            px, py, pz = three(row)
            bx, by, bz = row[_NORMAL], row[_NORMAL + 1], row[_NORMAL + 2]
            # along the normal: never pulling
            sx, sy, sz = ux + oy * pz - oz * py, uy + oz * px - ox * pz, uz + ox * py - oy * px
            push = row[_PUSH] + row[_MASS] * (row[_WANTED] - (sx * bx + sy * by + sz * bz))
            push = max(push, 0.0)
            step = push - row[_PUSH]
            row[_PUSH] = push
            ux, uy, uz, ox, oy, oz = _after_impulse(
                plant, px, py, pz, ux, uy, uz, ox, oy, oz, step * bx, step * by, step * bz
            )
            change = max(change, abs(step) * plant.inverse_mass)
            # across it: against sliding
            sx, sy, sz = ux + oy * pz - oz * py, uy + oz * px - ox * pz, uz + ox * py - oy * px
            along = sx * bx + sy * by + sz * bz
            sx -= along * bx
            sy -= along * by
            sz -= along * bz
            slide = math.sqrt(sx * sx + sy * sy + sz * sz)
            if slide < _NO_SLIDE:
                continue
            fx, fy, fz = _grip(plant, row, sx / slide, sy / slide, sz / slide, slide)
            ux, uy, uz, ox, oy, oz = _after_impulse(
                plant, px, py, pz, ux, uy, uz, ox, oy, oz, fx, fy, fz
            )
            change = max(change, math.sqrt(fx * fx + fy * fy + fz * fz) * plant.inverse_mass)
        if change < _SETTLED:
            break
    return ux, uy, uz, ox, oy, oz


@inner_kernel
def _grip(plant: Any, row: Array, dx: float, dy: float, dz: float, slide: float) -> Three:
    """Returns the friction impulse, N s, at `slide` m/s along d in Coulomb's cone; records it."""
    px, py, pz = three(row)
    wx, wy, wz = py * dz - pz * dy, pz * dx - px * dz, px * dy - py * dx
    hold = slide / _ease(plant, wx, wy, wz)
    gx, gy, gz = row[_GRIP] - hold * dx, row[_GRIP + 1] - hold * dy, row[_GRIP + 2] - hold * dz
    size = math.sqrt(gx * gx + gy * gy + gz * gz)
    limit = plant.friction * row[_PUSH]
    if size > limit:
        gx, gy, gz = gx * limit / size, gy * limit / size, gz * limit / size
    fx, fy, fz = gx - row[_GRIP], gy - row[_GRIP + 1], gz - row[_GRIP + 2]
    row[_GRIP], row[_GRIP + 1], row[_GRIP + 2] = gx, gy, gz
    return fx, fy, fz


@inner_kernel
def _ease(plant: Any, wx: float, wy: float, wz: float) -> Any:
    """Returns the inverse effective mass of an impulse, 1/kg; w: its lever arm, m."""
    jx, jy, jz = three(plant.inverse_inertia)
    return plant.inverse_mass + wx * wx * jx + wy * wy * jy + wz * wz * jz


@inner_kernel
def _after_impulse(
    plant: Any,
    px: float,
    py: float,
    pz: float,
    ux: float,
    uy: float,
    uz: float,
    ox: float,
    oy: float,
    oz: float,
    fx: float,
    fy: float,
    fz: float,
) -> Six:
    """Returns velocity u and rates o after an impulse f, N s, at the point p."""
    light = plant.inverse_mass
    jx, jy, jz = three(plant.inverse_inertia)
    ux += fx * light
    uy += fy * light
    uz += fz * light
    ox += (py * fz - pz * fy) * jx
    oy += (pz * fx - px * fz) * jy
    oz += (px * fy - py * fx) * jz
    return ux, uy, uz, ox, oy, oz


@inner_kernel
def classify_touch(
    body: Any, plant: Any, approach: float, speed: float, step: int, dt: float, bounce: bool
) -> int:
    """Classifies a contact as `TOUCH_DOWN`, `IMPACT` or `NO_TOUCH`; records its time.

    speed: of the centre of mass before the contact, m/s. An impact is a new contact faster than the
    landing limit, or with the vehicle tilted beyond 60 degrees; a crashed vehicle reports none.
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
