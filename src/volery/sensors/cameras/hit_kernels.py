"""Memory for shading, and ray hits in the form that shading reads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, owning_kernel
from volery.world.embree import DIRECTION, FAR, LANES, NORMAL, ORIGIN
from volery.world.scene_kernels import RayBlock

# Rows of `Scratch.hit`.
HIT, POSITION_X, LIT, NORMAL_X, CLEARNESS, MIRRORED, _ROWS = 0, 1, 4, 5, 8, 9, 12

f4 = np.float32


class Scratch(NamedTuple):
    """Shading data of P packets; see `new_scratch`."""

    hit: NDArray[np.float32]
    """(P, rows, LANES): hit flag, hit point, light of the sun, normal, fraction of contrast left by
    haze, reflection of a pane (3 channels)."""
    distance: NDArray[np.float32]
    """(P, LANES) m."""
    direction: NDArray[np.float32]
    """(P, 3, LANES) direction of the ray, map frame."""
    colour: NDArray[np.float32]
    """(P, 3, LANES) linear colour."""
    source: NDArray[np.int32]
    """(P, LANES) number of the hit, packet by packet, at which a ray to the sun starts."""
    taken: NDArray[np.int32]
    """(P,) number of such rays in each packet; they fill its first lanes."""
    low: NDArray[np.float32]
    """(3, LANES) lowest coordinates of each lane's hits, m, map frame."""
    high: NDArray[np.float32]
    """(3, LANES) highest coordinates of each lane's hits, m, map frame."""


@owning_kernel
def new_scratch(packets: int) -> Scratch:
    """Allocates memory for shading `packets` packets."""
    return Scratch(
        np.empty((packets, _ROWS, LANES), f4),
        np.empty((packets, LANES), f4),
        np.empty((packets, 3, LANES), f4),
        np.empty((packets, 3, LANES), f4),
        np.empty((packets, LANES), np.int32),
        np.empty(packets, np.int32),
        np.empty((3, LANES), f4),
        np.empty((3, LANES), f4),
    )


@inner_kernel
def note_hits(block: RayBlock, count: int, scratch: Scratch) -> None:
    """Copies the hits of the block's first `count` packets to `scratch`.

    Normals become unit vectors on the side of the camera. Here and below one call handles many
    packets, because passing so many arrays costs as much as one packet's rays.
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
            hit[HIT, k] = f4(1.0) if instance[k] >= 0 else f4(0.0)
            hit[POSITION_X, k] = rays[ORIGIN, k] + far * dx
            hit[POSITION_X + 1, k] = rays[ORIGIN + 1, k] + far * dy
            hit[POSITION_X + 2, k] = rays[ORIGIN + 2, k] + far * dz
            hit[NORMAL_X, k] = nx * scale
            hit[NORMAL_X + 1, k] = ny * scale
            hit[NORMAL_X + 2, k] = nz * scale
            distance[k] = far
            direction[0, k], direction[1, k], direction[2, k] = dx, dy, dz
