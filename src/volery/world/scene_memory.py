"""What the compiled queries of a scene read and write: its tables, and memory for rays.

Written by `scene` and `embree_backend`, read by `scene_kernels`, `body_kernels` and the sensors.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.world.embree import INVALID, LANES, MASK, PACKET_ROWS, aligned, coherent_arguments
from volery.world.ground_cover import GroundCover

_KEPT_BLOCKS = 8


class BodyTable(NamedTuple):
    """The moving bodies, one row a UAV, then one a thing that moves by itself."""

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
    crew: int
    """UAVs of one copy of a scenario: a UAV's rays see the others of its own copy alone."""
    rotors: NDArray[np.float64]
    """(N, R, 10) `BodyShape.rotors`, for rays that tell blades from gaps; (N, 0, 10) for those that
    see discs."""
    turn: NDArray[np.float64]
    """(N, R, 2) rad, angles of the rotors at fractions 0 and 1."""
    actors: int
    """How many of the last rows are things: people, vehicles, birds. Everybody sees them."""


class SceneHandle(NamedTuple):
    """What kernels need of a scene; valid until the scene is closed."""

    static: int
    """Embree scene of terrain, trees and solids."""
    obstacles: int
    """The same without the terrain."""
    steepest: float
    """Largest slope of the terrain, height by distance; 0 without one."""
    moving_offset: int
    """Instance number of the first body."""
    trees: int
    """How many there are; see `point_query.instance_of` for Embree's numbers of them."""
    normal_matrix: NDArray[np.float32]
    """(instances, 9) rows of the matrix that takes normals to the map (not unit length)."""
    material: NDArray[np.uint8]
    """(instances, 2) of the instance's parts (trees: wood, leaves; solids: sides, tops)."""
    look: NDArray[np.float32]
    """(instances, 6) rows of `scene_content.Look`."""
    cover: GroundCover
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
