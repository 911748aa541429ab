"""Makes samples of single sensors from the batches of sensor banks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import read_only
from volery.sensors import samples as batches
from volery.sensors.mount import Mount
from volery.sensors.samples import Samples
from volery.sensors.sensor_samples import (
    BatterySample,
    CameraSample,
    GnssSample,
    ImuSample,
    LidarSample,
    MagneticSample,
    PoseSample,
    PressureSample,
    RangeSample,
    SensorSample,
)
from volery.vehicle.battery import BatteryLevel

Row: TypeAlias = "int | slice"
"""Row of one sensor, or all rows (`slice(None)`): a sample whose arrays have a first axis."""


def sample_of(batch: Samples, row: Row, mount: Mount) -> SensorSample:
    """Returns the sample of `row` of a batch; its arrays are views of the batch's."""
    return _MAKERS[type(batch)](batch, row, mount)


def joined(parts: Sequence[tuple[Samples, NDArray[np.int64]]]) -> Samples:
    """Returns one batch of the given rows of batches of equal kind and time.

    Its arrays are read-only, and new unless the rows are one whole batch.
    """
    first, rows = parts[0]
    if len(parts) == 1 and np.array_equal(rows, np.arange(len(first.sensors))):
        return first
    arrays = {
        name: read_only(np.concatenate([getattr(batch, name)[rows] for batch, rows in parts]))
        for name, value in vars(parts[0][0]).items()
        if isinstance(value, np.ndarray)
    }
    sensors = tuple(batch.sensors[row] for batch, rows in parts for row in rows.tolist())
    changed: dict[str, Any] = {"sensors": sensors, **arrays}
    return replace(parts[0][0], **changed)


def _lidar(batch: batches.LidarScans, row: Row, mount: Mount) -> LidarSample:
    return LidarSample(
        batch.stamp_ns, mount, batch.echoes[row], batch.intensities[row], batch.model, batch.number
    )


def _camera(batch: batches.CameraFrames, row: Row, mount: Mount) -> CameraSample:
    parts = (batch.colour[row], batch.depth[row], batch.instance[row], batch.material[row])
    return CameraSample(batch.stamp_ns, mount, *parts, batch.model)


def _imu(batch: batches.ImuSamples, row: Row, mount: Mount) -> ImuSample:
    return ImuSample(batch.stamp_ns, mount, batch.angular_velocity[row], batch.specific_force[row])


def _range(batch: batches.RangeSamples, row: Row, mount: Mount) -> RangeSample:
    limits = (batch.field_of_view_rad, batch.range_min_m, batch.range_max_m)
    return RangeSample(batch.stamp_ns, mount, batch.ranges[row], *limits)


def _pose(batch: batches.OdometrySamples, row: Row, mount: Mount) -> PoseSample:
    return PoseSample(
        batch.stamp_ns,
        mount,
        batch.position_odom[row],
        batch.attitude[row],
        batch.velocity_body[row],
        batch.omega_body[row],
        batch.pose_variance[row],
        batch.twist_variance[row],
        batch.is_ground_truth,
    )


def _gnss(batch: batches.GnssSamples, row: Row, mount: Mount) -> GnssSample:
    has_fix = batch.has_fix[row]
    return GnssSample(
        batch.stamp_ns,
        mount,
        bool(has_fix) if isinstance(row, int) else has_fix,
        batch.position_map[row],
        batch.velocity_map[row],
        batch.position_variance[row],
        batch.velocity_variance[row],
        batch.frame,
    )


def _pressure(batch: batches.PressureSamples, row: Row, mount: Mount) -> PressureSample:
    return PressureSample(batch.stamp_ns, mount, batch.pressure[row], batch.temperature[row])


def _magnetic(batch: batches.MagneticSamples, row: Row, mount: Mount) -> MagneticSample:
    return MagneticSample(batch.stamp_ns, mount, batch.field[row])


def _battery(batch: batches.BatterySamples, row: Row, mount: Mount) -> BatterySample:
    level, cells = batch.level[row], batch.cells[row]
    return BatterySample(
        batch.stamp_ns,
        mount,
        batch.voltage[row],
        batch.current[row],
        batch.charge[row],
        batch.capacity_ah[row],
        int(cells) if isinstance(row, int) else cells,
        BatteryLevel(int(level)) if isinstance(row, int) else level,
    )


_MAKERS: dict[type[Any], Callable[[Any, Row, Mount], SensorSample]] = {
    batches.LidarScans: _lidar,
    batches.CameraFrames: _camera,
    batches.ImuSamples: _imu,
    batches.RangeSamples: _range,
    batches.OdometrySamples: _pose,
    batches.GnssSamples: _gnss,
    batches.PressureSamples: _pressure,
    batches.MagneticSamples: _magnetic,
    batches.BatterySamples: _battery,
}
