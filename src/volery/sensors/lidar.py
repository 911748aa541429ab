"""Batches of LIDAR scans over a scene; `lidar_model` tells what a scanner is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.workers import Workers, new_counter
from volery.sensors.lidar_kernels import (
    LidarBatch,
    MountTable,
    measure_scan,
    poses_at,
    scan_batch,
    sweep_rays,
)
from volery.sensors.lidar_model import LidarModel
from volery.sensors.mount import Mount
from volery.vehicle.pose_history import PoseHistory
from volery.world.embreex_fallback import EmbreexBackend
from volery.world.scene import Scene
from volery.world.scene_kernels import new_block, thread_block

__all__ = [
    "LidarBatch",
    "MountTable",
    "make_batch",
    "sample_lidars",
    "scan_rays",
    "stack_mounts",
]

_FEW_BEAMS = 5000
"""A batch up to this size is swept by the calling thread alone."""


def stack_mounts(mounts: Sequence[Mount]) -> MountTable:
    """Mounts as a table that batches refer to by row."""
    return MountTable(
        np.array([m.position_body for m in mounts], dtype=np.float64).reshape(-1, 3),
        np.array([m.attitude_body for m in mounts], dtype=np.float64).reshape(-1, 4),
        np.array(
            [[m.amplitude_rad, m.period_s, m.offset_rad, m.phase_rad] for m in mounts],
            dtype=np.float64,
        ).reshape(-1, 4),
    )


def make_batch(
    uav: ArrayLike,
    mount: ArrayLike,
    sweep_start_ns: ArrayLike,
    key: ArrayLike,
    scan_number: ArrayLike,
    mounts: MountTable,
) -> LidarBatch:
    """Batch of S scans from arrays (S,) or numbers for all; see `LidarBatch` for their meaning."""
    uavs = np.atleast_1d(np.asarray(uav, dtype=np.int64))

    def column(values: ArrayLike, kind: type) -> NDArray[Any]:
        return np.ascontiguousarray(np.broadcast_to(np.asarray(values, dtype=kind), uavs.shape))

    return LidarBatch(
        uav=np.ascontiguousarray(uavs),
        mount=column(mount, np.int64),
        sweep_start_ns=column(sweep_start_ns, np.int64),
        key=column(key, np.uint64),
        scan_number=column(scan_number, np.int64),
        mounts=mounts,
    )


def sample_lidars(
    scene: Scene,
    model: LidarModel,
    batch: LidarBatch,
    history: PoseHistory,
    workers: Workers | None = None,
) -> NDArray[np.float32]:
    """Make the batch's scans: ranges (S, beams) m; inf no return, -inf too near (REP-117).

    `history` must reach from the earliest sweep's start to the latest one's end. The scene's
    bodies, if it has any, are moved along that interval, so that every beam sees the other UAVs
    where they were; the scan's own UAV is not seen. Results do not depend on the number of threads
    or on which scans share a batch, but for the bodies' linear interpolation over the interval.
    """
    ranges = np.empty((len(batch.uav), model.beams), dtype=np.float32)
    if not len(ranges):
        return ranges
    start = int(batch.sweep_start_ns.min())
    end = int(batch.sweep_start_ns.max()) + model.sweep_duration_ns
    count = history.position.shape[1]
    if int(batch.uav.min()) < 0 or int(batch.uav.max()) >= count:
        raise ValueError(f"a scan names UAV row {int(batch.uav.max())} of {count}")
    bodies = len(scene.handle.bodies.scene)
    if bodies:
        poses = np.empty((2, bodies, 3)), np.empty((2, bodies, 4))
        for i, time_ns in enumerate((start, end)):
            poses_at(history, time_ns, poses[0][i], poses[1][i])
        scene.move_bodies(poses[0][0], poses[1][0], poses[0][1], poses[1][1])
    if not scene.compiled:
        for scan in range(len(ranges)):
            _scan_plainly(scene, model, batch, scan, history, (start, end), ranges[scan])
        return ranges
    handle, constants, counter = scene.handle, model.constants, new_counter()

    def work() -> None:
        block = thread_block(model.beams, bodies)
        memory = np.empty((2, block.instance.size), dtype=np.float32)
        scan_batch(handle, constants, batch, history, start, end, counter, block, memory, ranges)

    (workers or scene.workers).run(work, alone=ranges.size <= _FEW_BEAMS)
    return ranges


def scan_rays(
    model: LidarModel, batch: LidarBatch, scan: int, history: PoseHistory
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """One scan's beams as rays: origins and unit directions (beams, 3), map, and times, ns."""
    rays = np.empty((6, model.beams), dtype=np.float32)
    times = np.empty(model.beams, dtype=np.int64)
    packets = new_block(model.beams, 0).rays
    sweep_rays(model.constants, batch, scan, history, packets, rays, times)
    return rays[:3].T.astype(np.float64), rays[3:].T.astype(np.float64), times


def _scan_plainly(
    scene: Scene,
    model: LidarModel,
    batch: LidarBatch,
    scan: int,
    history: PoseHistory,
    interval: tuple[int, int],
    ranges: NDArray[np.float32],
) -> None:
    """One scan through the fallback backend, with the same beams and the same noise."""
    backend = scene.backend
    assert isinstance(backend, EmbreexBackend)
    beams = model.beams
    origins, directions, times = scan_rays(model, batch, scan, history)
    out = (
        ranges,
        np.empty((beams, 3), np.float32),
        np.empty(beams, np.int32),
        np.empty(beams, np.uint8),
    )
    fraction = np.clip((times - interval[0]) / max(interval[1] - interval[0], 1), 0.0, 1.0)
    backend.cast(
        scene.handle,
        scene.workers,
        origins,
        directions,
        model.range.max_m,
        np.array([batch.uav[scan]], dtype=np.int32),
        fraction,
        out,
    )
    cosine = np.abs(np.einsum("ij,ij->i", out[1], directions)).astype(np.float32)
    measure_scan(model.constants, batch.key[scan], batch.scan_number[scan], cosine, ranges)
