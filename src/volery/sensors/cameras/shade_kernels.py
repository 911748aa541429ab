"""Compiled shading of hits: texture, windows, light of the sun and the sky, haze."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.sensors.cameras.facade_kernels import pane_fraction, pane_light
from volery.sensors.cameras.hit_kernels import (
    CLEARNESS,
    HIT,
    LIT,
    MIRRORED,
    NORMAL_X,
    POSITION_X,
    Scratch,
)
from volery.sensors.cameras.light import CLEAR, GRAIN, Light
from volery.world.embree import LANES
from volery.world.materials import Material
from volery.world.scene_kernels import RayBlock, SceneHandle

_MASK = GRAIN - 1
_FACADE, _PAINTED = int(Material.FACADE), int(Material.PAINTED)

f4 = np.float32
_FAR_OFF = np.float32(65536.0)
"""Offset that makes coordinates positive, so that truncation rounds down."""


@inner_kernel
def _grey(grain: NDArray[np.float32], x: Any, y: Any) -> Any:
    """Returns the table of greys at (x, y), interpolated between four entries."""
    fx, fy = np.floor(x), np.floor(y)
    i, j = np.int64(fx), np.int64(fy)
    u, v = x - fx, y - fy
    a, b = grain[i & _MASK, j & _MASK], grain[(i + 1) & _MASK, j & _MASK]
    c, d = grain[i & _MASK, (j + 1) & _MASK], grain[(i + 1) & _MASK, (j + 1) & _MASK]
    low, high = a + u * (b - a), c + u * (d - c)
    return low + v * (high - low)


@inner_kernel
def _texture(light: Light, material: int, x: Any, y: Any, z: Any, steep: bool) -> Any:
    """Returns the fraction of a surface's second colour at a point, 0 to 1."""
    size = light.surface[material, 6]
    u, v = ((x + y) * size, z * size) if steep else (x * size, y * size)
    i = np.int64(u * f4(8.0) + _FAR_OFF) & _MASK
    j = np.int64(v * f4(8.0) + _FAR_OFF) & _MASK
    fine = light.grain[i, j]
    return f4(0.7) * _grey(light.grain, u, v) + f4(0.3) * fine


@inner_kernel
def shade(scene: SceneHandle, block: RayBlock, count: int, light: Light, scratch: Scratch) -> None:
    """Computes linear colours of the block's first `count` packets, after `find_shadows`."""
    _paint(scene, block, count, light, scratch)
    _illuminate(count, light, scratch)


@inner_kernel
def _paint(scene: SceneHandle, block: RayBlock, count: int, light: Light, scratch: Scratch) -> None:
    """Computes surface colours, reflections of panes and clearness of the air, or the sky."""
    for p in range(count):
        hit, colour, direction = scratch.hit[p], scratch.colour[p], scratch.direction[p]
        materials, instances, distance = block.material[p], block.instance[p], scratch.distance[p]
        for k in range(LANES):
            if hit[HIT, k] == f4(0.0):
                _sky(light, direction, k, colour)
                continue
            material, far = materials[k], distance[k]
            x, y, z = hit[POSITION_X, k], hit[POSITION_X + 1, k], hit[POSITION_X + 2, k]
            fraction = _texture(light, material, x, y, z, abs(hit[NORMAL_X + 2, k]) < f4(0.7))
            own_grey = light.grain[instances[k] & _MASK, np.int64(material) & _MASK]
            tint = f4(0.85) + f4(0.3) * own_grey
            for j in range(3):
                first, second = light.surface[material, j], light.surface[material, 3 + j]
                colour[j, k] = (first + fraction * (second - first)) * tint
                hit[MIRRORED + j, k] = f4(0.0)
            step: Any = np.int64(far * light.clear_per_m)
            hit[CLEARNESS, k] = light.clear[min(step, CLEAR - 1)]
            if material == _FACADE:
                look, nx, ny = scene.look[instances[k]], hit[NORMAL_X, k], hit[NORMAL_X + 1, k]
                glass, window = pane_fraction(look, x, y, z, nx, ny, far)
                for j in range(3):
                    colour[j, k] *= look[j] * (f4(1.0) - glass)
                    mirrored = pane_light(light, j, direction[2, k], window)
                    hit[MIRRORED + j, k] = glass * mirrored
            elif material == _PAINTED:
                for j in range(3):
                    colour[j, k] *= scene.look[instances[k], j]


@inner_kernel
def _illuminate(count: int, light: Light, scratch: Scratch) -> None:
    """Applies the light of sun and sky to painted hits, then haze.

    Without branches and table look-ups, so that the compiler vectorizes over the lanes.
    """
    for p in range(count):
        hit, colour = scratch.hit[p], scratch.colour[p]
        for j in range(3):
            sun, horizon, bounce = light.sun_colour[j], light.horizon[j], light.bounce[j]
            from_above = light.overhead[j] - bounce
            for k in range(LANES):
                above = f4(0.5) + f4(0.5) * hit[NORMAL_X + 2, k]
                lit = sun * hit[LIT, k] + bounce + above * from_above
                seen = colour[j, k] * lit + hit[MIRRORED + j, k]
                hazy = horizon + hit[CLEARNESS, k] * (seen - horizon)
                colour[j, k] = hazy if hit[HIT, k] > f4(0.0) else colour[j, k]


@inner_kernel
def _sky(light: Light, direction: NDArray[np.float32], k: int, colour: NDArray[np.float32]) -> None:
    """Computes the colour of the sky in a direction; below the horizon that of haze."""
    dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
    height = np.sqrt(max(dz, f4(0.0)))
    glow = max(dx * light.sun[0] + dy * light.sun[1] + dz * light.sun[2], f4(0.0))
    for _ in range(7):  # to the 128th power: a glow of some degrees
        glow = glow * glow
    for j in range(3):
        plain = light.horizon[j] + height * (light.zenith[j] - light.horizon[j])
        colour[j, k] = plain + glow * light.sun_colour[j]
