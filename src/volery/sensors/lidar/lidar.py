"""Batches of LIDAR scans over a scene; `lidar_model` describes the scanners."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.workers import Workers, new_counter
from volery.sensors.lidar.aim_kernels import MountTable, RayBatch, poses_at, sweep_rays
from volery.sensors.lidar.beam_table import BeamTable, packets_of
from volery.sensors.lidar.echo_kernels import Echoes, Surfaces
from volery.sensors.lidar.lidar_kernels import PIECE, measure_batch, scan_batch
from volery.sensors.lidar.lidar_model import LidarModel
from volery.sensors.lidar.particle_echo_kernels import weather_scans
from volery.sensors.lidar.particle_echoes import ParticleTable
from volery.sensors.mount import Mount
from volery.vehicle.pose_history import PoseHistory
from volery.world.embree import LANES
from volery.world.scene import Scene
from volery.world.scene_kernels import new_block, thread_block

__all__ = [
    "Echoes",
    "MountTable",
    "RayBatch",
    "make_batch",
    "move_bodies",
    "sample_echoes",
    "sample_lidars",
    "scan_rays",
    "stack_mounts",
]

_FEW_BEAMS = 5000
"""Maximum size of a batch that the calling thread sweeps alone."""


def stack_mounts(mounts: Sequence[Mount]) -> MountTable:
    """Returns the table of M mounts that batches refer to by row."""
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
) -> RayBatch:
    """Returns a batch of S scans from arrays (S,) or scalars for all; see `RayBatch`."""
    uavs = np.atleast_1d(np.asarray(uav, dtype=np.int64))

    def column(values: ArrayLike, kind: type) -> NDArray[Any]:
        filled: NDArray[Any] = np.empty(uavs.shape, kind)
        filled[...] = values
        return filled

    return RayBatch(
        uav=column(uavs, np.int64),
        mount=column(mount, np.int64),
        sweep_start_ns=column(sweep_start_ns, np.int64),
        key=column(key, np.uint64),
        scan_number=column(scan_number, np.int64),
        mounts=mounts,
    )


def sample_lidars(
    scene: Scene,
    model: LidarModel,
    batch: RayBatch,
    history: PoseHistory,
    workers: Workers | None = None,
) -> NDArray[np.float32]:
    """Returns the ranges (S, beams) of the batch's first echoes, m; see `sample_echoes`."""
    return sample_echoes(scene, model, batch, history, workers=workers).ranges[:, 0]


def sample_echoes(
    scene: Scene,
    model: LidarModel,
    batch: RayBatch,
    history: PoseHistory,
    *,
    intensities: bool = False,
    air: ParticleTable | None = None,
    workers: Workers | None = None,
) -> Echoes:
    """Returns the echoes of the batch's S scans: ranges, m, and intensities if requested.

    `history` must reach from the earliest sweep's start to the latest one's end. The scene's
    bodies, if any, move linearly over that interval, so that every beam sees the other UAVs at
    their positions of that time; a scan does not see its own UAV. Apart from this interpolation,
    results do not depend on the number of threads or on the other scans of a batch. `air`:
    particles in the air; None for clear air.

    Raises `ValueError` if a scan's UAV row is out of range, or if scans of a non-repeating pattern
    have different numbers.
    """
    echoes = _clear_echoes(scene, model, batch, history, intensities, workers)
    if air is not None and len(batch.uav):
        alone = echoes.ranges.size <= _FEW_BEAMS
        team = workers or scene.workers
        team.run(weather_scans, model.constants, air, batch, new_counter(), echoes, alone=alone)
    return echoes


def _clear_echoes(
    scene: Scene,
    model: LidarModel,
    batch: RayBatch,
    history: PoseHistory,
    intensities: bool,
    workers: Workers | None,
) -> Echoes:
    """Returns the batch's echoes in clear air."""
    scans, beams = len(batch.uav), model.beams
    echoes = Echoes(
        np.empty((scans, model.echoes, beams), dtype=np.float32),
        np.empty((scans, model.echoes if intensities else 0, beams), dtype=np.float32),
    )
    if not scans:
        return echoes
    start, end = _interval(model, batch, history)
    bodies = move_bodies(scene, history, start, end)
    table = model.scan.table(_sweep_number(model, batch))
    handle, constants, counter = scene.handle, model.constants, new_counter()
    rays = min(beams, PIECE * LANES)
    common = _surfaces(scans, beams) if packets_of(beams) > PIECE else None

    def cast() -> None:
        block, met = thread_block(rays, bodies), common or _surfaces(1, beams)
        scan_batch(
            handle, constants, table, batch, history, start, end, counter, block, met, echoes
        )

    team, alone = workers or scene.workers, scans * beams <= _FEW_BEAMS
    team.run(cast, alone=alone)
    if common is not None:
        team.run(measure_batch, constants, batch, new_counter(), common, echoes, alone=alone)
    return echoes


def scan_rays(
    model: LidarModel, batch: RayBatch, scan: int, history: PoseHistory
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Returns one scan's rays: origins and unit directions (beams, 3), map frame, and times, ns.

    A time is that at which the beam's packet sees the other UAVs.
    """
    table = model.scan.table(int(batch.scan_number[scan]))
    return _rays(table, batch, scan, history)


def _rays(
    table: BeamTable, batch: RayBatch, scan: int, history: PoseHistory
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    count = table.rays
    rays = np.empty((6, count), dtype=np.float32)
    times = np.empty(count, dtype=np.int64)
    sweep_rays(table, batch, scan, history, new_block(count, 0).rays, rays, times)
    return rays[:3].T.astype(np.float64), rays[3:].T.astype(np.float64), times


def _interval(model: LidarModel, batch: RayBatch, history: PoseHistory) -> tuple[int, int]:
    """Returns the start of the earliest sweep and the end of the latest one, ns."""
    count = history.position.shape[1]
    if int(batch.uav.min()) < 0 or int(batch.uav.max()) >= count:
        raise ValueError(f"a scan has UAV row {int(batch.uav.max())}; the history has {count} UAVs")
    starts = batch.sweep_start_ns
    return int(starts.min()), int(starts.max()) + model.sweep_duration_ns


def move_bodies(scene: Scene, history: PoseHistory, start: int, end: int) -> int:
    """Moves UAVs and actors of the scene through the interval, ns; returns the number of bodies."""
    table = scene.handle.bodies
    bodies = len(table.scene)
    uavs = bodies - table.actors
    scene.move_actors(start, end)
    if uavs:
        poses = np.empty((2, uavs, 3)), np.empty((2, uavs, 4))
        for i, time_ns in enumerate((start, end)):
            poses_at(history, time_ns, poses[0][i], poses[1][i])
        scene.move_bodies(poses[0][0], poses[1][0], poses[0][1], poses[1][1])
    return bodies


def _sweep_number(model: LidarModel, batch: RayBatch) -> int:
    number = int(batch.scan_number[0])
    if not model.scan.is_fixed and (batch.scan_number != number).any():
        raise ValueError(f"scans of a {model.name} in one batch must have one scan number")
    return number


_own = threading.local()


def _surfaces(scans: int, beams: int) -> Surfaces:
    """Returns the calling thread's memory for that many scans; reuse saves page faults."""
    room = packets_of(beams) * LANES
    needed = scans * room
    flat: Surfaces | None = _own.__dict__.get("surfaces")
    if flat is None or len(flat.distance) < needed:
        flat = _own.surfaces = Surfaces(
            np.empty(needed, np.float32), np.empty(needed, np.float32), np.empty(needed, np.uint8)
        )
    shape = (scans, room)
    return Surfaces(
        flat.distance[:needed].reshape(shape),
        flat.cosine[:needed].reshape(shape),
        flat.material[:needed].reshape(shape),
    )
