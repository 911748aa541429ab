"""Compiled shading of a packet of hits: sun and its shadows, sky, texture, haze."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.sensors.cameras.light import GRAIN, Light
from volery.world.body_kernels import hide_behind_body
from volery.world.embree import DIRECTION, FAR, LANES, NORMAL, ORIGIN, occluded_packet
from volery.world.scene_kernels import RayBlock, SceneHandle

SHADOW_REACH_M = 80.0
"""Farther away nothing throws a shadow: trees and houses are lower."""
_MASK = GRAIN - 1
# Rows of a packet's scratch memory.
_HIT, _PLACE_X, _LIT, SCRATCH_ROWS = 0, 1, 4, 8
_NORMAL_X = 5

f4 = np.float32


@inner_kernel
def note_hits(block: RayBlock, p: int, scratch: NDArray[np.float32]) -> None:
    """Take a packet's hits into `scratch` (SCRATCH_ROWS, LANES): where, and the normal there.

    Normals become unit vectors on the side of the camera; the first row says whether anything was
    hit.
    """
    rays = block.rays[p]
    for k in range(LANES):
        nx, ny, nz = rays[NORMAL, k], rays[NORMAL + 1, k], rays[NORMAL + 2, k]
        dx, dy, dz = rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k]
        scale = f4(1.0) / np.sqrt(max(nx * nx + ny * ny + nz * nz, f4(1e-30)))
        if nx * dx + ny * dy + nz * dz > f4(0.0):
            scale = -scale
        far = rays[FAR, k]
        scratch[_HIT, k] = f4(1.0) if block.instance[p, k] >= 0 else f4(0.0)
        scratch[_PLACE_X, k] = rays[ORIGIN, k] + far * dx
        scratch[_PLACE_X + 1, k] = rays[ORIGIN + 1, k] + far * dy
        scratch[_PLACE_X + 2, k] = rays[ORIGIN + 2, k] + far * dz
        scratch[_NORMAL_X, k] = nx * scale
        scratch[_NORMAL_X + 1, k] = ny * scale
        scratch[_NORMAL_X + 2, k] = nz * scale


@inner_kernel
def find_shadows(
    scene: SceneHandle,
    block: RayBlock,
    p: int,
    near_count: int,
    light: Light,
    scratch: NDArray[np.float32],
    distance: NDArray[np.float32],
    direction: NDArray[np.float32],
) -> None:
    """Say in `scratch` how the sun falls on each hit: the cosine, negative from behind, 0 in shade.

    distance (LANES,), direction (3, LANES): the packet's rays, replaced by those of the shadows.
    """
    rays, valid, sun = block.rays[p], block.valid, light.sun
    wanted = False
    for k in range(LANES):
        nx, ny, nz = scratch[_NORMAL_X, k], scratch[_NORMAL_X + 1, k], scratch[_NORMAL_X + 2, k]
        cosine = nx * sun[0] + ny * sun[1] + nz * sun[2]
        distance[k] = rays[FAR, k]
        through = light.surface[block.material[p, k], 7] > f4(0.0)
        lit = scratch[_HIT, k] > f4(0.0) and (cosine > f4(0.0) or through)
        scratch[_LIT, k] = cosine if lit else f4(0.0)
        valid[k] = -1 if lit else 0
        wanted = wanted or lit
        # A step off the surface, on the side where the sun is.
        off = (f4(2e-3) + f4(1e-4) * distance[k]) * (f4(1.0) if cosine > f4(0.0) else f4(-1.0))
        for j in range(3):
            direction[j, k] = rays[DIRECTION + j, k]
        rays[ORIGIN, k] = scratch[_PLACE_X, k] + off * nx
        rays[ORIGIN + 1, k] = scratch[_PLACE_X + 1, k] + off * ny
        rays[ORIGIN + 2, k] = scratch[_PLACE_X + 2, k] + off * nz
        for j in range(3):
            rays[DIRECTION + j, k] = sun[j]
        rays[FAR, k] = f4(SHADOW_REACH_M)
    if not wanted or sun[2] <= f4(0.0):
        if sun[2] <= f4(0.0):
            for k in range(LANES):
                scratch[_LIT, k] = f4(0.0)
        return
    occluded_packet(valid.ctypes.data, scene.static, rays.ctypes.data, block.coherent.ctypes.data)
    for n in range(near_count):
        hide_behind_body(scene, block, p, LANES, block.near[n])
    for k in range(LANES):
        if rays[FAR, k] < f4(0.0):
            scratch[_LIT, k] = f4(0.0)


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
    u, v = (x + y, z) if steep else (x, y)
    coarse = _grey(light.grain, u * size, v * size)
    fine = _grey(light.grain, u * size * f4(7.0) + f4(13.0), v * size * f4(7.0) + f4(5.0))
    return f4(0.6) * coarse + f4(0.4) * fine


@inner_kernel
def shade(
    block: RayBlock,
    p: int,
    light: Light,
    scratch: NDArray[np.float32],
    distance: NDArray[np.float32],
    direction: NDArray[np.float32],
    colour: NDArray[np.float32],
) -> None:
    """Linear colours (3, LANES) of a packet, after `find_shadows`."""
    for k in range(LANES):
        if scratch[_HIT, k] == f4(0.0):
            _sky(light, direction, k, colour)
            continue
        material = block.material[p, k]
        nz = scratch[_NORMAL_X + 2, k]
        x, y, z = scratch[_PLACE_X, k], scratch[_PLACE_X + 1, k], scratch[_PLACE_X + 2, k]
        share = _texture(light, material, x, y, z, abs(nz) < f4(0.7))
        tint = f4(0.85) + f4(0.3) * light.grain[block.instance[p, k] & _MASK, material & _MASK]
        cosine = scratch[_LIT, k]
        # From behind a leaf lets a part through.
        sunlit = cosine if cosine > f4(0.0) else -cosine * light.surface[material, 7]
        above = f4(0.5) + f4(0.5) * nz
        clear = np.exp(f4(-light.extinction_per_m) * distance[k])
        for j in range(3):
            first, second = light.surface[material, j], light.surface[material, 3 + j]
            own = (first + share * (second - first)) * tint
            sky = above * (light.zenith[j] + f4(0.35) * light.horizon[j])
            lit = light.sun_colour[j] * sunlit + sky + (f4(1.0) - above) * light.bounce[j]
            colour[j, k] = own * lit * f4(1.6) * clear + light.horizon[j] * (f4(1.0) - clear)


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
