"""Scanning range finders: a model read from a data file, and batches of scans over a scene."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.clock import ns_from_s
from volery.core.errors import DataFileError
from volery.core.workers import Workers, new_counter
from volery.sensors.lidar_kernels import (
    LidarBatch,
    LidarConstants,
    MountTable,
    measure_scan,
    poses_at,
    scan_batch,
    sweep_rays,
)
from volery.sensors.mount import Mount
from volery.vehicle.pose_history import PoseHistory
from volery.world.embreex_fallback import EmbreexBackend
from volery.world.scene import Scene
from volery.world.scene_kernels import new_block, thread_block

__all__ = [
    "LidarBatch",
    "LidarModel",
    "MountTable",
    "load_lidar",
    "make_batch",
    "sample_lidars",
    "scan_rays",
    "stack_mounts",
]

_FEW_BEAMS = 5000
"""A batch up to this size is swept by the calling thread alone."""


@dataclass(frozen=True)
class LidarModel:
    """A planar scanner; where the numbers come from stands in its data file."""

    name: str
    beams: int
    angle_min_rad: float
    angle_max_rad: float
    rate_hz: float
    sweep_duration_s: float
    """From the first beam to the last; the rest of a turn is blind."""
    range_min_m: float
    range_max_m: float
    range_resolution_m: float
    noise_floor_m: float
    noise_slope: float
    noise_offset_m: float
    dropout_far: float
    dropout_grazing: float
    mixed_pixels_divergence_rad: float
    mixed_pixels_least_jump_m: float
    mixed_pixels_pulse_length_m: float
    mixed_pixels_first_echo_share: float
    noise: bool = True
    """Without noise a range is the exact distance: nothing is quantised, lost or mixed."""

    @property
    def angle_increment_rad(self) -> float:
        """Angle from a beam to the next."""
        return (self.angle_max_rad - self.angle_min_rad) / (self.beams - 1)

    @property
    def time_increment_s(self) -> float:
        """Time from a beam to the next."""
        return self.sweep_duration_s / (self.beams - 1)

    @property
    def sweep_duration_ns(self) -> int:
        """`sweep_duration_s` on the simulation's clock."""
        return ns_from_s(self.sweep_duration_s)

    @cached_property
    def angles(self) -> NDArray[np.float64]:
        """(beams,) angle of each beam about the sensor's z axis, rad."""
        return np.linspace(self.angle_min_rad, self.angle_max_rad, self.beams)

    @cached_property
    def constants(self) -> LidarConstants:
        """The model as kernels take it."""
        return LidarConstants(
            cosine=np.cos(self.angles),
            sine=np.sin(self.angles),
            sweep_ns=self.sweep_duration_ns,
            range_min=self.range_min_m,
            range_max=self.range_max_m,
            resolution=self.range_resolution_m,
            noise_floor=self.noise_floor_m,
            noise_slope=self.noise_slope,
            noise_offset=self.noise_offset_m,
            dropout_far=self.dropout_far,
            dropout_grazing=self.dropout_grazing,
            half_footprint=0.5 * self.mixed_pixels_divergence_rad / self.angle_increment_rad,
            least_jump=self.mixed_pixels_least_jump_m,
            pulse_length=self.mixed_pixels_pulse_length_m,
            first_echo_share=self.mixed_pixels_first_echo_share,
            noise=self.noise,
        )

    def without_noise(self) -> LidarModel:
        """The same scanner with exact ranges."""
        return replace(self, noise=False)


def load_lidar(model: str | Path = "utm_30lx") -> LidarModel:
    """Read a model that ships with Volery by name, or a TOML file by path.

    Raises DataFileError naming file and key for what is missing, unknown or out of range.
    """
    shipped = files("volery.sensors") / "models" / f"{model}.toml"
    source = shipped if isinstance(model, str) and shipped.is_file() else Path(model)
    try:
        data = tomllib.loads(source.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"cannot read the LIDAR model {model}: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise DataFileError(f"{source}: not TOML: {error}") from error
    flat: dict[str, Any] = {}
    for key, value in data.items():
        inner = value if isinstance(value, dict) else {"": value}
        # [scan] beams -> beams; [noise] floor_m -> noise_floor_m
        prefix = f"{key}_" if key != "scan" else ""
        flat.update({(prefix + name).rstrip("_"): v for name, v in inner.items()})
    return _checked(flat, str(source))


def _checked(flat: dict[str, Any], source: str) -> LidarModel:
    known = {field.name: field.type for field in fields(LidarModel) if field.name != "noise"}
    for name in flat:
        if name not in known:
            raise DataFileError(f"{source}: unknown key {name}")
    for name, kind in known.items():
        if name not in flat:
            raise DataFileError(f"{source}: {name} is missing")
        value = flat[name]
        if kind == "str":
            flat[name] = str(value)
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise DataFileError(f"{source}: {name} must be a number, not {value!r}")
        elif not np.isfinite(value) or (value < 0 and not name.startswith("angle")):
            raise DataFileError(f"{source}: {name} must be finite and not negative, not {value}")
        else:
            flat[name] = int(value) if kind == "int" else float(value)
    model = LidarModel(**flat)
    rules = (
        (model.beams >= 2, "beams must be at least 2"),
        (model.angle_max_rad > model.angle_min_rad, "angle_max_rad must exceed angle_min_rad"),
        (model.rate_hz > 0.0, "rate_hz must be positive"),
        (
            0.0 < model.sweep_duration_s <= 1.0 / max(model.rate_hz, 1e-9),
            "sweep_duration_s must be positive and fit in one turn",
        ),
        (0.0 <= model.range_min_m < model.range_max_m, "range min_m must be below max_m"),
        (model.range_resolution_m > 0.0, "range resolution_m must be positive"),
        (max(model.dropout_far, model.dropout_grazing) <= 1.0, "dropout shares go up to 1"),
    )
    for fine, sentence in rules:
        if not fine:
            raise DataFileError(f"{source}: {sentence}")
    return model


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
        model.range_max_m,
        np.array([batch.uav[scan]], dtype=np.int32),
        fraction,
        out,
    )
    cosine = np.abs(np.einsum("ij,ij->i", out[1], directions)).astype(np.float32)
    measure_scan(model.constants, batch.key[scan], batch.scan_number[scan], cosine, ranges)
