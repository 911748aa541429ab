"""Compiled LIDAR scans: rays are aimed, cast and measured in pieces that threads share.

A planar sweep is one piece, measured by the thread that cast it; a large sweep is cut into pieces
of PIECE packets and measured when all of them are cast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel
from volery.core.workers import fetch_add
from volery.sensors.lidar.aim_kernels import RayBatch, aim_packets, sensor_frame
from volery.sensors.lidar.beam_table import BeamTable
from volery.sensors.lidar.echo_kernels import Echoes, LidarConstants, Surfaces
from volery.sensors.lidar.measurement_kernels import measure
from volery.vehicle.pose_history import PoseHistory
from volery.world.embree import DIRECTION, FAR, LANES, NORMAL, PACKET_ROWS
from volery.world.scene_kernels import RayBlock, SceneHandle, cast_block, near_bodies
from volery.world.world_kernels import own_world

PIECE = 2048 // LANES
"""Packets of a piece."""
_CURVE_MARGIN_M = 0.5
"""Distance by which a sensor may leave the box of its first and last position in a sweep."""


@inner_kernel
def _near_scan(
    scene: SceneHandle,
    lidar: LidarConstants,
    batch: RayBatch,
    scan: int,
    history: PoseHistory,
    near: NDArray[np.int32],
) -> int:
    """Lists in `near` the other UAVs within range during the sweep; returns their number."""
    if scene.bodies.scene.shape[0] == 0:
        return 0
    start = batch.sweep_start_ns[scan]
    a = sensor_frame(batch, scan, history, start)
    b = sensor_frame(batch, scan, history, start + lidar.sweep_ns)
    m = _CURVE_MARGIN_M
    count: int = near_bodies(
        scene.bodies,
        (min(a[0], b[0]) - m, min(a[1], b[1]) - m, min(a[2], b[2]) - m),
        (max(a[0], b[0]) + m, max(a[1], b[1]) + m, max(a[2], b[2]) + m),
        lidar.range_max,
        batch.uav[scan],
        near,
    )
    return count


@inner_kernel
def _cast_piece(
    scene: SceneHandle,
    lidar: LidarConstants,
    batch: RayBatch,
    scan: int,
    history: PoseHistory,
    count: int,
    block: RayBlock,
) -> None:
    """Casts the block's first `count` rays of a scan into the world of its UAV."""
    own_scene = own_world(scene, batch.uav[scan])
    near_count = _near_scan(own_scene, lidar, batch, scan, history, block.near)
    cast_block(own_scene, block, count, lidar.range_max, near_count)


@inner_kernel
def _note(
    block: RayBlock, table: BeamTable, first: int, packets: int, row: int, surfaces: Surfaces
) -> None:
    """Writes the hits of a piece, `packets` packets from `first` on, to the rows of their beams.

    Lanes beyond the last ray are written too, for which rows have space: without conditions the
    compiler vectorizes the loops.
    """
    rays, instance, material = block.rays, block.instance, block.material
    start = first * LANES
    ordered = table.in_order
    distance, cosine = surfaces.distance[row], surfaces.cosine[row]
    kind, beam = surfaces.material[row], table.beam[start:]
    if ordered:
        distance, cosine, kind = distance[start:], cosine[start:], kind[start:]
    flat = rays.reshape(rays.size)
    for p in range(packets):
        ray, met = flat[p * PACKET_ROWS * LANES : (p + 1) * PACKET_ROWS * LANES], instance[p]
        for k in range(LANES):
            x, y = ray[NORMAL * LANES + k], ray[(NORMAL + 1) * LANES + k]
            z = ray[(NORMAL + 2) * LANES + k]
            along = (
                x * ray[DIRECTION * LANES + k]
                + y * ray[(DIRECTION + 1) * LANES + k]
                + z * ray[(DIRECTION + 2) * LANES + k]
            )
            squared = max(x * x + y * y + z * z, np.float32(1e-30))
            ray[NORMAL * LANES + k] = abs(along) / np.sqrt(squared)
            far = ray[FAR * LANES + k]
            ray[FAR * LANES + k] = far if met[k] >= 0 else np.float32(np.inf)
        if ordered:
            for k in range(LANES):
                distance[p * LANES + k] = rays[p, FAR, k]
                cosine[p * LANES + k] = rays[p, NORMAL, k]
                kind[p * LANES + k] = material[p, k]
        else:
            for k in range(LANES):
                i = beam[p * LANES + k]
                distance[i] = rays[p, FAR, k]
                cosine[i] = rays[p, NORMAL, k]
                kind[i] = material[p, k]


@inner_kernel
def _measure(
    lidar: LidarConstants,
    batch: RayBatch,
    scan: int,
    row: int,
    surfaces: Surfaces,
    echoes: Echoes,
) -> None:
    measure(
        lidar,
        batch.key[scan],
        batch.scan_number[scan],
        batch.sweep_start_ns[scan],
        scan,
        row,
        surfaces,
        echoes,
    )


@kernel
def scan_batch(
    scene: SceneHandle,
    lidar: LidarConstants,
    table: BeamTable,
    batch: RayBatch,
    history: PoseHistory,
    bodies_start_ns: int,
    bodies_end_ns: int,
    counter: NDArray[np.int64],
    block: RayBlock,
    surfaces: Surfaces,
    echoes: Echoes,
) -> None:
    """Casts pieces of scans, numbered by `counter`, and measures scans of one piece.

    Runs in every thread until no piece is left. Scans of several pieces need a row each in
    `surfaces`, which `measure_batch` reads; scans of one piece use the first row of the thread's
    own memory.
    """
    total, packets = table.rays, table.seen_ns.shape[0]
    pieces = (packets + PIECE - 1) // PIECE
    interval = max(bodies_end_ns - bodies_start_ns, 1)
    while True:
        number = fetch_add(counter.ctypes.data)
        scan = number // pieces
        if scan >= batch.uav.shape[0]:
            return
        first = (number % pieces) * PIECE
        own = min(PIECE, packets - first)
        count = min(own * LANES, total - first * LANES)
        aim_packets(table, batch, scan, history, first, own, block.rays)
        seen_ns = table.seen_ns[first:]
        for p in range(own):
            time = batch.sweep_start_ns[scan] + seen_ns[p]
            fraction = (time - bodies_start_ns) / interval
            block.fraction[p] = min(max(fraction, 0.0), 1.0)
        _cast_piece(scene, lidar, batch, scan, history, count, block)
        _note(block, table, first, own, scan if pieces > 1 else 0, surfaces)
        if pieces == 1:
            _measure(lidar, batch, scan, 0, surfaces, echoes)


@kernel
def measure_batch(
    lidar: LidarConstants,
    batch: RayBatch,
    counter: NDArray[np.int64],
    surfaces: Surfaces,
    echoes: Echoes,
) -> None:
    """Measures whole scans, numbered by `counter`; runs in every thread."""
    while True:
        scan = fetch_add(counter.ctypes.data)
        if scan >= batch.uav.shape[0]:
            return
        _measure(lidar, batch, scan, scan, surfaces, echoes)
