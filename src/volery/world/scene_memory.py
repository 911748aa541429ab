"""Data of the compiled queries of a scene: tables, and memory for rays.

`scene` and `embree_backend` write it; `scene_kernels`, `body_kernels` and the sensors read it.
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
    """The N moving bodies: one row per UAV, then one per actor."""

    scene: NDArray[np.int64]
    """(N,) Embree scene of the shape, in the body frame."""
    radius: NDArray[np.float64]
    """(N,) radius in m of the sphere about the body's origin that contains the shape."""
    material: NDArray[np.uint8]
    """(N, parts) `Material`."""
    start: NDArray[np.float64]
    """(N, 7) x y z (m) qx qy qz qw, map from body, at fraction 0 of the interval."""
    end: NDArray[np.float64]
    """(N, 7) the same at fraction 1: the newest pose."""
    uavs_per_env: int
    """Number of UAVs in one copy of a scenario: a UAV's rays see those of its own copy alone."""
    rotors: NDArray[np.float64]
    """(N, R, 10) `BodyShape.rotors`, for rays that distinguish blades from gaps; (N, 0, 10) for
    rays that see discs."""
    turn: NDArray[np.float64]
    """(N, R, 2) rad, angles of the rotors at fractions 0 and 1."""
    actors: int
    """Number of actors, the last rows: people, vehicles, birds. All rays see them."""


class WorldTable(NamedTuple):
    """The W worlds of a scene whose environments are in different ones; see `world_kernels`."""

    world: NDArray[np.int32]
    """(E,) number of the world of each environment; (0,) in a scene of one world."""
    static: NDArray[np.int64]
    """(W,) `SceneHandle.static` of each world; so are the next three."""
    obstacles: NDArray[np.int64]
    steepest: NDArray[np.float64]
    trees: NDArray[np.int64]
    first: NDArray[np.int64]
    """(W + 1,) first row of each world in the scene's tables of instances."""


ONE_WORLD = WorldTable(
    np.zeros(0, np.int32),
    np.zeros(0, np.int64),
    np.zeros(0, np.int64),
    np.zeros(0),
    np.zeros(0, np.int64),
    np.zeros(1, np.int64),
)
"""Table of a scene of one world."""


class SceneHandle(NamedTuple):
    """A scene for kernels; valid until the scene is closed.

    A scene of several worlds has their tables one after the other, and the numbers of the first
    world; `world_kernels.own_world` returns the handle of the world of a UAV.
    """

    static: int
    """Embree scene of terrain, trees and solids."""
    obstacles: int
    """Embree scene of trees and solids."""
    steepest: float
    """Maximum slope of the terrain, height by distance; 0 without one."""
    moving_offset: int
    """Instance number of the first body."""
    trees: int
    """Number of trees; see `point_query.instance_of` for their numbers in Embree."""
    normal_matrix: NDArray[np.float32]
    """(instances, 9) rows of the matrix that transforms normals to the map (not unit length)."""
    material: NDArray[np.uint8]
    """(instances, 2) materials of the instance's parts (trees: wood, leaves; solids: sides, tops).
    """
    look: NDArray[np.float32]
    """(instances, 6) rows of `scene_content.Look`."""
    cover: GroundCover
    bodies: BodyTable
    worlds: WorldTable = ONE_WORLD


class RayBlock(NamedTuple):
    """Rays and results of one piece of work, P packets of LANES rays; used by one thread at a time.

    Kernels fill `rays` (and `skip`, `fraction`), call `cast_block` and read the rest.
    """

    rays: NDArray[np.float32]
    """(P, PACKET_ROWS, LANES) Embree's packets. Inputs: ORIGIN and unit DIRECTION, map; outputs:
    FAR, m, and, for hits, NORMAL, map, of any length, facing either side."""
    words: NDArray[np.uint32]
    """The same memory as integers."""
    skip: NDArray[np.int32]
    """(P, LANES) row of the body that a ray does not see, -1 for none."""
    fraction: NDArray[np.float64]
    """(P,) fraction of the bodies' interval of motion at which a packet sees them."""
    instance: NDArray[np.int32]
    """(P, LANES) result: instance number, -1 for none."""
    material: NDArray[np.uint8]
    """(P, LANES) result: `Material`."""
    near: NDArray[np.int32]
    """(N,) body rows that these rays may hit; the count is an argument."""
    valid: NDArray[np.int32]
    """(LANES,) -1 for the lanes that are cast."""
    body_rays: NDArray[np.float32]
    """(PACKET_ROWS, LANES) packet in a body's frame."""
    body_words: NDArray[np.uint32]
    """The same memory as integers."""
    body_valid: NDArray[np.int32]
    """(LANES,) -1 for the lanes that are cast at the body."""
    coherent: NDArray[np.int32]
    """Embree's arguments for coherent rays."""


def new_block(rays: int, bodies: int) -> RayBlock:
    """Allocates memory for `rays` rays in a scene with that many bodies."""
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
    """Returns the calling thread's block of that size, reused between calls."""
    blocks: dict[tuple[int, int], RayBlock] = _own.__dict__.setdefault("blocks", {})
    block = blocks.get((rays, bodies))
    if block is None:
        if len(blocks) >= _KEPT_BLOCKS:
            blocks.clear()
        block = blocks[rays, bodies] = new_block(rays, bodies)
    return block
