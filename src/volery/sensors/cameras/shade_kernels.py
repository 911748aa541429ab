"""Compiled shading of a packet of hits: sun and its shadows, sky, texture, haze."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.sensors.cameras.facade_kernels import pane_light, pane_share
from volery.sensors.cameras.light import CLEAR, GRAIN, Light
from volery.world.body_kernels import body_sphere, hide_behind_body
from volery.world.embree import DIRECTION, FAR, LANES, NORMAL, ORIGIN, occluded_packet
from volery.world.materials import Material
from volery.world.scene_kernels import RayBlock, SceneHandle, run_together

SHADOW_REACH_M = 80.0
"""Farther away nothing throws a shadow: trees and houses are lower."""
_SUN_ABOVE = 0.01
"""The sun counts as above a slope when its sine is by this much larger (modelling choice)."""
_MASK = GRAIN - 1
_FACADE, _PAINTED = int(Material.FACADE), int(Material.PAINTED)
# Rows of a packet's scratch memory.
_HIT, _PLACE_X, _LIT, _NORMAL_X, SCRATCH_ROWS = 0, 1, 4, 5, 8

f4 = np.float32
_FAR_OFF = np.float32(65536.0)
"""Makes coordinates positive, so that cutting off is rounding down."""


class Scratch(NamedTuple):
    """What shading keeps of P packets; see `new_scratch`."""

    hit: NDArray[np.float32]
    """(P, SCRATCH_ROWS, LANES): whether anything was hit, where, how the sun falls, the normal."""
    distance: NDArray[np.float32]
    """(P, LANES) m."""
    direction: NDArray[np.float32]
    """(P, 3, LANES) of the ray."""
    colour: NDArray[np.float32]
    """(P, 3, LANES) linear."""


@inner_kernel
def note_hits(block: RayBlock, count: int, scratch: Scratch) -> None:
    """Take the hits of the block's first `count` packets into `scratch`.

    Normals become unit vectors on the side of the camera. Here and below one call handles many
    packets: handing over so many arrays costs as much as the rays of one.
    """
    for p in range(count):
        rays, hit, instance = block.rays[p], scratch.hit[p], block.instance[p]
        distance, direction = scratch.distance[p], scratch.direction[p]
        for k in range(LANES):
            nx, ny, nz = rays[NORMAL, k], rays[NORMAL + 1, k], rays[NORMAL + 2, k]
            dx, dy, dz = rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k]
            along = nx * dx + ny * dy + nz * dz
            size = np.sqrt(max(nx * nx + ny * ny + nz * nz, f4(1e-30)))
            scale = (f4(-1.0) if along > f4(0.0) else f4(1.0)) / size
            far = rays[FAR, k]
            hit[_HIT, k] = f4(1.0) if instance[k] >= 0 else f4(0.0)
            hit[_PLACE_X, k] = rays[ORIGIN, k] + far * dx
            hit[_PLACE_X + 1, k] = rays[ORIGIN + 1, k] + far * dy
            hit[_PLACE_X + 2, k] = rays[ORIGIN + 2, k] + far * dz
            hit[_NORMAL_X, k] = nx * scale
            hit[_NORMAL_X + 1, k] = ny * scale
            hit[_NORMAL_X + 2, k] = nz * scale
            distance[k] = far
            direction[0, k], direction[1, k], direction[2, k] = dx, dy, dz


@inner_kernel
def shading_bodies(
    scene: SceneHandle,
    uav: int,
    light: Light,
    scratch: Scratch,
    count: int,
    near: NDArray[np.int32],
) -> int:
    """List the other bodies whose shadows may fall on the hits; their number.

    Each is a sphere that moves away from the sun, the hits are a ball.
    """
    bodies = scene.bodies
    low, high = _box(scratch, count)
    if bodies.scene.shape[0] == 0 or low[0] > high[0]:
        return 0
    cx, cy, cz = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
    ball = np.sqrt((high[0] - cx) ** 2 + (high[1] - cy) ** 2 + (high[2] - cz) ** 2)
    first, uavs = uav - uav % bodies.crew, bodies.scene.shape[0] - bodies.things
    found = 0
    for n in range(bodies.crew + bodies.things):
        row = first + n if n < bodies.crew else uavs + n - bodies.crew
        x, y, z, radius = body_sphere(bodies, row)
        dx, dy, dz = x - cx, y - cy, z - cz
        along = dx * light.sun[0] + dy * light.sun[1] + dz * light.sun[2]
        reach = ball + radius
        aside = dx * dx + dy * dy + dz * dz - along * along
        if row != uav and -reach < along < SHADOW_REACH_M + reach and aside < reach * reach:
            near[found] = row
            found += 1
    return found


@inner_kernel
def _box(
    scratch: Scratch, count: int
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Lowest and highest corner of the box around all hits; the other way round without any."""
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    for p in range(count):
        hit = scratch.hit[p]
        for k in range(LANES):
            if hit[_HIT, k] > f4(0.0):
                x, y, z = hit[_PLACE_X, k], hit[_PLACE_X + 1, k], hit[_PLACE_X + 2, k]
                x0, x1 = min(x0, x), max(x1, x)
                y0, y1 = min(y0, y), max(y1, y)
                z0, z1 = min(z0, z), max(z1, z)
    return (x0, y0, z0), (x1, y1, z1)


@inner_kernel
def _casters(scene: SceneHandle, light: Light) -> int:
    """Embree scene of what may stand between a hit and the sun.

    Nothing that stands on the ground has it there while the sun is higher than its steepest slope.
    """
    sx, sy, sz = float(light.sun[0]), float(light.sun[1]), float(light.sun[2])
    level = np.sqrt(sx * sx + sy * sy)
    return scene.obstacles if sz > scene.steepest * level + _SUN_ABOVE else scene.static


@inner_kernel
def find_shadows(
    scene: SceneHandle,
    block: RayBlock,
    count: int,
    near_count: int,
    light: Light,
    scratch: Scratch,
) -> None:
    """Note how much of the sun falls on each hit, the cosine with it: 0 in the shade.

    The block's rays are replaced by those towards the sun.
    """
    valid, surface, casters = block.valid, light.surface, _casters(scene, light)
    sx, sy, sz = light.sun[0], light.sun[1], light.sun[2]
    is_day = sz > f4(0.0)
    for p in range(count):
        rays, hit, material = block.rays[p], scratch.hit[p], block.material[p]
        wanted = False
        for k in range(LANES):
            nx, ny, nz = hit[_NORMAL_X, k], hit[_NORMAL_X + 1, k], hit[_NORMAL_X + 2, k]
            cosine = nx * sx + ny * sy + nz * sz
            met = is_day and hit[_HIT, k] > f4(0.0)
            lit = met and cosine > f4(0.0)
            # What comes through from behind is taken as half shaded, without looking.
            behind = f4(0.5) * surface[material[k], 7] if met else f4(0.0)
            hit[_LIT, k] = cosine if lit else -cosine * behind
            valid[k] = -1 if lit else 0
            wanted = wanted or lit
            # A step off the surface, on the side of the camera and the sun.
            off = f4(2e-3) + f4(1e-4) * scratch.distance[p, k]
            rays[ORIGIN, k] = hit[_PLACE_X, k] + off * nx
            rays[ORIGIN + 1, k] = hit[_PLACE_X + 1, k] + off * ny
            rays[ORIGIN + 2, k] = hit[_PLACE_X + 2, k] + off * nz
            rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k] = sx, sy, sz
            rays[FAR, k] = f4(SHADOW_REACH_M)
        if not wanted:
            continue
        arguments = block.coherent.ctypes.data if run_together(block.rays, p, LANES) else 0
        occluded_packet(valid.ctypes.data, casters, rays.ctypes.data, arguments)
        for n in range(near_count):
            hide_behind_body(scene, block, p, LANES, block.near[n])
        for k in range(LANES):
            if valid[k] != 0 and rays[FAR, k] < f4(0.0):
                hit[_LIT, k] = f4(0.0)


@inner_kernel
def _grey(grain: NDArray[np.float32], x: Any, y: Any) -> Any:
    """The table of greys at a place, between its four neighbours."""
    fx, fy = np.floor(x), np.floor(y)
    i, j = np.int64(fx), np.int64(fy)
    u, v = x - fx, y - fy
    a, b = grain[i & _MASK, j & _MASK], grain[(i + 1) & _MASK, j & _MASK]
    c, d = grain[i & _MASK, (j + 1) & _MASK], grain[(i + 1) & _MASK, (j + 1) & _MASK]
    low, high = a + u * (b - a), c + u * (d - c)
    return low + v * (high - low)


@inner_kernel
def _texture(light: Light, material: int, x: Any, y: Any, z: Any, steep: bool) -> Any:
    """How much of the second colour a surface has at a place, 0 to 1."""
    size = light.surface[material, 6]
    u, v = ((x + y) * size, z * size) if steep else (x * size, y * size)
    i = np.int64(u * f4(8.0) + _FAR_OFF) & _MASK
    j = np.int64(v * f4(8.0) + _FAR_OFF) & _MASK
    fine = light.grain[i, j]
    return f4(0.7) * _grey(light.grain, u, v) + f4(0.3) * fine


@inner_kernel
def shade(scene: SceneHandle, block: RayBlock, count: int, light: Light, scratch: Scratch) -> None:
    """Linear colours of the block's first `count` packets, after `find_shadows`."""
    for p in range(count):
        hit, colour = scratch.hit[p], scratch.colour[p]
        materials, instances = block.material[p], block.instance[p]
        for k in range(LANES):
            if hit[_HIT, k] == f4(0.0):
                _sky(light, scratch.direction[p], k, colour)
                continue
            material = materials[k]
            nz = hit[_NORMAL_X + 2, k]
            x, y, z = hit[_PLACE_X, k], hit[_PLACE_X + 1, k], hit[_PLACE_X + 2, k]
            share = _texture(light, material, x, y, z, abs(nz) < f4(0.7))
            own_grey = light.grain[instances[k] & _MASK, np.int64(material) & _MASK]
            tint = f4(0.85) + f4(0.3) * own_grey
            sunlit = hit[_LIT, k]
            above = f4(0.5) + f4(0.5) * nz
            step: Any = np.int64(scratch.distance[p, k] * light.clear_per_m)
            clear = light.clear[min(step, CLEAR - 1)]
            glass, window = f4(0.0), np.int64(0)
            if material == _FACADE:
                nx, ny, far = hit[_NORMAL_X, k], hit[_NORMAL_X + 1, k], scratch.distance[p, k]
                glass, window = pane_share(scene.look[instances[k]], x, y, z, nx, ny, far)
            for j in range(3):
                first, second = light.surface[material, j], light.surface[material, 3 + j]
                own = (first + share * (second - first)) * tint
                if material == _FACADE or material == _PAINTED:  # noqa: PLR1714, SIM109 - compiled
                    own *= scene.look[instances[k], j] * (f4(1.0) - glass)
                bounce, horizon = light.bounce[j], light.horizon[j]
                lit = light.sun_colour[j] * sunlit + bounce + above * (light.overhead[j] - bounce)
                seen = own * lit
                if glass > f4(0.0):
                    seen += glass * pane_light(light, j, scratch.direction[p, 2, k], window)
                colour[j, k] = horizon + clear * (seen - horizon)


@inner_kernel
def _sky(light: Light, direction: NDArray[np.float32], k: int, colour: NDArray[np.float32]) -> None:
    """Colour of the sky in a direction; below the horizon that of haze."""
    dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
    height = np.sqrt(max(dz, f4(0.0)))
    glow = max(dx * light.sun[0] + dy * light.sun[1] + dz * light.sun[2], f4(0.0))
    for _ in range(7):  # to the 128th power: a glow of some degrees
        glow = glow * glow
    for j in range(3):
        plain = light.horizon[j] + height * (light.zenith[j] - light.horizon[j])
        colour[j, k] = plain + glow * light.sun_colour[j]
