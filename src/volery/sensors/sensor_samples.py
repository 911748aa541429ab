"""Samples of single sensors, as Python code reads them: named arrays with shapes, units and frames.

`sensors.samples` holds the batches that banks make; a sample here is a row of such a batch. Its
arrays are read-only views of the batch, without a copy: later measurements never change them, so a
sample may be kept. A view keeps the arrays of all sensors of its batch in memory; code that
keeps many samples of many UAVs copies what it needs (`np.array(sample.ranges)`).

In vectorized environments the same classes hold one row per environment: every array has a first
axis of K environments, and a number is an array (K,).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import s_from_ns
from volery.core.geodesy import LocalFrame
from volery.sensors.cameras.cloud import organised_points
from volery.sensors.cameras.depth_units import millimetres
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar_model import LidarModel
from volery.sensors.mount import Mount
from volery.vehicle.battery import BatteryLevel

Number: TypeAlias = "float | Array"
"""A number; in vectorized environments (K,)."""


@dataclass(frozen=True, eq=False)
class _SensorSample:
    """What all samples share."""

    stamp_ns: int
    """Time of the measurement, ns of simulated time."""
    mount: Mount
    """Mount of the sensor on the UAV."""

    @property
    def stamp_s(self) -> float:
        """Time of the measurement, s of simulated time."""
        return s_from_ns(self.stamp_ns)


@dataclass(frozen=True, eq=False)
class LidarSample(_SensorSample):
    """One sweep of a LIDAR with N beams; `stamp_ns` is the time of the first beam."""

    echoes: NDArray[np.float32]
    """(E, N) m, nearest first; +inf: no echo, -inf: below the minimum range (REP-117)."""
    echo_intensities: NDArray[np.float32]
    """(E, N) numbers, 0 without an echo; (0, N) if the LIDAR measures none."""
    model: LidarModel
    """Model of the LIDAR: scan pattern, range, noise."""
    number: int
    """Number of the sweep, counted from 0."""

    @property
    def ranges(self) -> NDArray[np.float32]:
        """(N,) ranges of the first echoes, m; +inf no echo, -inf below the minimum range."""
        return self.echoes[..., 0, :]

    @property
    def intensities(self) -> NDArray[np.float32]:
        """(N,) intensities of the first echoes, numbers; empty if the LIDAR measures none."""
        if not self.echo_intensities.shape[-2]:
            return self.echo_intensities.reshape(*self.echo_intensities.shape[:-2], -1)
        return self.echo_intensities[..., 0, :]

    @property
    def directions(self) -> Array:
        """(N, 3) directions of the beams, 1 m long, in the sensor's frame (FLU)."""
        return self.model.scan.directions(self.number).T

    @property
    def beam_times_ns(self) -> NDArray[np.int64]:
        """(N,) times of the beams after `stamp_ns`, ns."""
        return self.model.scan.time_ns

    def points_sensor(self) -> Array:
        """Returns the first echoes as points (M, 3), m, in the sensor's frame, in order of beams.

        In vectorized environments (K, N, 3), nan for beams without an echo.
        """
        return _with_echo(self._all_points())

    def points_base(self) -> Array:
        """Returns the first echoes as points (M, 3), m, in `base_link` (FLU), in order of beams.

        A nodding mount is corrected for each beam's own time, the UAV's motion during the sweep is
        not. In vectorized environments (K, N, 3), nan for beams without an echo.
        """
        points = self._all_points()
        if self.mount.nods:
            points = rotations.rotate(self._nodding(), points)
        points = rotations.rotate(self.mount.attitude_body, points)
        return _with_echo(points + self.mount.position_body)

    def _all_points(self) -> Array:
        """Returns points (..., beams, 3), nan without an echo."""
        ranges = np.where(np.isfinite(self.ranges), self.ranges, np.nan).astype(np.float64)
        return np.asarray(ranges[..., None] * self.directions)

    def _nodding(self) -> Array:
        """Returns quaternions (beams, 4) of the nodding mount at the beams' times."""
        mount = self.mount
        period_ns = round(mount.period_s * 1e9)
        turn = ((self.stamp_ns + self.beam_times_ns) % period_ns) / period_ns
        swing = np.sin(2.0 * math.pi * turn + mount.phase_rad)
        angle = mount.offset_rad + mount.amplitude_rad * swing
        still = np.zeros_like(angle)
        return np.stack([still, np.sin(0.5 * angle), still, np.cos(0.5 * angle)], axis=-1)


@dataclass(frozen=True, eq=False)
class CameraSample(_SensorSample):
    """One image of a camera; `stamp_ns` is the exposure of the first row."""

    image: NDArray[np.uint8]
    """(H, W, 3) sRGB."""
    depth: NDArray[np.float32]
    """(H, W) m along the optical axis; -inf too near, +inf too far, nan outside the lens."""
    instance: NDArray[np.int32]
    """(H, W) number of the scene's instance, -1 for none."""
    material: NDArray[np.uint8]
    """(H, W) `world.materials.Material`."""
    model: CameraModel
    """Model of the camera: size, lens, noise."""

    @property
    def intrinsics(self) -> Array:
        """(3, 3) camera matrix K, numbers of pixels; pixel centres are at integer coordinates."""
        return self.model.matrix

    @property
    def distortion(self) -> Array:
        """(5,) coefficients k1, k2, p1, p2, k3 of OpenCV's lens model."""
        return np.array(self.model.distortion, dtype=np.float64)

    def depth_mm(self) -> NDArray[np.uint16]:
        """Returns the depth (H, W) in whole mm, 0 for unknown or beyond 65.535 m (REP 118).

        The array is new; `PIL.Image.fromarray` and `cv2.imwrite` save it as a PNG of 16 bits.
        """
        return millimetres(self.depth)

    def points_optical(self) -> NDArray[np.float32]:
        """Returns the points of the pixels (H, W, 3), m, in the optical frame.

        It has z forward, x right, y down; a pixel without depth is nan. In vectorized environments
        (K, H, W, 3).
        """
        if self.depth.ndim == 2:
            return organised_points(self.model, self.depth, None)
        return np.stack([organised_points(self.model, depth, None) for depth in self.depth])


@dataclass(frozen=True, eq=False)
class ImuSample(_SensorSample):
    """Rates and specific force in the sensor's frame."""

    angular_velocity: Array
    """(3,) rad/s."""
    specific_force: Array
    """(3,) m/s^2; +g upward at rest."""


@dataclass(frozen=True, eq=False)
class RangeSample(_SensorSample):
    """Distance of a range finder."""

    range: Number
    """Distance, m; +inf nothing in range, -inf below the minimum range (REP-117)."""
    field_of_view_rad: float
    """Full angle of the cone, rad."""
    min_m: float
    """Minimum range, m."""
    max_m: float
    """Maximum range, m."""


@dataclass(frozen=True, eq=False)
class PoseSample(_SensorSample):
    """Pose and twist: of odometry, of an estimate or of the ground truth.

    Odometry drifts in its own frame, `odom`; for ground truth that frame is the map.
    """

    position_odom: Array
    """(3,) m."""
    attitude: Array
    """(4,) x y z w, odom from body."""
    velocity_body: Array
    """(3,) m/s, FLU."""
    omega_body: Array
    """(3,) rad/s, FLU."""
    pose_variance: Array
    """(6,) x, y, z m^2 and roll, pitch, yaw rad^2."""
    twist_variance: Array
    """(6,) linear (m/s)^2 and angular (rad/s)^2, body frame."""
    is_ground_truth: bool
    """Whether it is the true motion."""


@dataclass(frozen=True, eq=False)
class GnssSample(_SensorSample):
    """Fix of a GNSS receiver; `stamp_ns` is the time of the position, before the delay."""

    has_fix: bool | NDArray[np.bool_]
    """Whether the receiver has a fix; in vectorized environments a mask (K,)."""
    position_map: Array
    """(3,) m; nan without a fix."""
    velocity_map: Array
    """(3,) m/s; nan without a fix."""
    position_variance: Array
    """(3,) m^2, east-north-up."""
    velocity_variance: Array
    """(3,) (m/s)^2, east-north-up."""
    frame: LocalFrame
    """Position of the map on the earth."""

    @property
    def geodetic(self) -> Array:
        """(3,) latitude rad, longitude rad, height m (WGS-84); nan without a fix."""
        return self.frame.geodetic_from_enu(self.position_map)


@dataclass(frozen=True, eq=False)
class PressureSample(_SensorSample):
    """Static pressure and temperature of the air."""

    pressure: Number
    """Pa."""
    temperature: Number
    """K."""


@dataclass(frozen=True, eq=False)
class MagneticSample(_SensorSample):
    """Magnetic flux density in the sensor's frame."""

    field: Array
    """(3,) T."""


@dataclass(frozen=True, eq=False)
class BatterySample(_SensorSample):
    """Measurement of a battery monitor."""

    voltage: Number
    """V under load."""
    current: Number
    """A out of the battery."""
    charge: Number
    """Remaining fraction of the capacity."""
    capacity_ah: Number
    """Capacity, A h."""
    cells: int | NDArray[np.int64]
    """Number of cells in series; in vectorized environments numbers (K,)."""
    level: BatteryLevel | NDArray[np.int64]
    """Battery level; in vectorized environments its numbers (K,)."""


SensorSample: TypeAlias = (
    LidarSample
    | CameraSample
    | ImuSample
    | RangeSample
    | PoseSample
    | GnssSample
    | PressureSample
    | MagneticSample
    | BatterySample
)


def _with_echo(points: Array) -> Array:
    """Returns the points (N, 3) that are not nan; an array with more axes unchanged."""
    return points[~np.isnan(points[:, 0])] if points.ndim == 2 else points
