"""Samples of sensors, as batches: one object for all S sensors of a bank at one time.

Row i of every array belongs to `sensors[i]`. Arrays are new, owned by the sample and read-only.
`MEASURED` names the quantities that faults add a bias or noise to, and the numbers that a sensor's
bias has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.geodesy import LocalFrame
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar_model import LidarModel


@dataclass(frozen=True)
class SensorId:
    """Identifies a sensor of a UAV."""

    uav: int
    """Row of the UAV in the fleet."""
    uav_name: str
    name: str

    @property
    def path(self) -> str:
        """Name such as `uav1/imu`, which stays valid when rows change."""
        return f"{self.uav_name}/{self.name}"


@dataclass(frozen=True)
class LidarScans:
    """One sweep of each LIDAR of a bank."""

    MEASURED: ClassVar[dict[str, int]] = {"echoes": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    """Time of the first beam."""
    model: LidarModel
    number: int
    """Number of the sweep, counted from 0."""
    echoes: NDArray[np.float32]
    """(S, E, beams) m, nearest first; +inf no echo, -inf below the minimum range (REP-117)."""
    intensities: NDArray[np.float32]
    """(S, E, beams), 0 without an echo; (S, 0, beams) if not requested."""

    @property
    def ranges(self) -> NDArray[np.float32]:
        """(S, beams) ranges of the first echoes, m."""
        return self.echoes[:, 0]


@dataclass(frozen=True)
class CameraFrames:
    """One image of each camera of a bank; a part without receivers has no pixels."""

    MEASURED: ClassVar[dict[str, int]] = {"depth": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    """Time of the first row's exposure."""
    model: CameraModel
    colour: NDArray[np.uint8]
    """(S, height, width, 3) sRGB."""
    depth: NDArray[np.float32]
    """(S, height, width) m along the optical axis; -inf too near, inf too far, NaN outside the
    lens."""
    instance: NDArray[np.int32]
    """(S, height, width) scene instance, -1 for none."""
    material: NDArray[np.uint8]
    """(S, height, width) `Material`."""


@dataclass(frozen=True)
class ImuSamples:
    """Rates and specific forces in the sensors' frames."""

    MEASURED: ClassVar[dict[str, int]] = {"angular_velocity": 3, "specific_force": 3}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    angular_velocity: Array
    """(S, 3) rad/s."""
    specific_force: Array
    """(S, 3) m/s^2; +g upward at rest."""
    angular_velocity_variance: float
    specific_force_variance: float


@dataclass(frozen=True)
class RangeSamples:
    """Distances of single-cone range finders."""

    MEASURED: ClassVar[dict[str, int]] = {"ranges": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    ranges: Array
    """(S,) m; +inf nothing in range, -inf below the minimum range (REP-117)."""
    field_of_view_rad: float
    range_min_m: float
    range_max_m: float
    variance: float
    """Variance of the noise, m^2."""


@dataclass(frozen=True)
class OdometrySamples:
    """Poses in the odometry frame and twists in the body frame."""

    MEASURED: ClassVar[dict[str, int]] = {"position_odom": 3}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    position_odom: Array
    """(S, 3) m."""
    attitude: Array
    """(S, 4) x y z w, odom from body."""
    velocity_body: Array
    """(S, 3) m/s, FLU."""
    omega_body: Array
    """(S, 3) rad/s, FLU."""
    pose_variance: Array
    """(S, 6): x, y, z m^2 and roll, pitch, yaw rad^2."""
    twist_variance: Array
    """(S, 6): linear (m/s)^2 and angular (rad/s)^2, body frame."""
    is_ground_truth: bool


@dataclass(frozen=True)
class JointAngles:
    """Angles of nodding mounts; positive tilts the sensor downward."""

    MEASURED: ClassVar[dict[str, int]] = {"angle": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    angle: Array
    """(S,) rad."""
    rate: Array
    """(S,) rad/s."""


@dataclass(frozen=True)
class GnssSamples:
    """Fixes of GNSS receivers: position and velocity of the antennas."""

    MEASURED: ClassVar[dict[str, int]] = {"position_map": 3}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    """Time of the position, before the receiver's delay."""
    frame: LocalFrame
    """Position of the map on the earth."""
    has_fix: NDArray[np.bool_]
    """(S,) whether the receiver has a fix."""
    position_map: Array
    """(S, 3) m; nan without a fix."""
    velocity_map: Array
    """(S, 3) m/s; nan without a fix."""
    position_variance: Array
    """(S, 3) m^2, east-north-up."""
    velocity_variance: Array
    """(S, 3) (m/s)^2, east-north-up."""


@dataclass(frozen=True)
class PressureSamples:
    """Static pressure and temperature of the air at the sensors."""

    MEASURED: ClassVar[dict[str, int]] = {"pressure": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    pressure: Array
    """(S,) Pa."""
    temperature: Array
    """(S,) K."""
    pressure_variance: float


@dataclass(frozen=True)
class MagneticSamples:
    """Magnetic flux density in the sensors' frames."""

    MEASURED: ClassVar[dict[str, int]] = {"field": 3}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    field: Array
    """(S, 3) T."""
    field_variance: float


@dataclass(frozen=True)
class BatterySamples:
    """Measurements of battery monitors."""

    MEASURED: ClassVar[dict[str, int]] = {"voltage": 1, "current": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    voltage: Array
    """(S,) V under load."""
    current: Array
    """(S,) A out of the battery."""
    charge: Array
    """(S,) remaining fraction of the capacity."""
    capacity_ah: Array
    """(S,) capacity, A h."""
    cells: NDArray[np.int64]
    """(S,) cells in series."""
    level: NDArray[np.int64]
    """(S,) `vehicle.battery.BatteryLevel`."""


Samples: TypeAlias = (
    LidarScans
    | CameraFrames
    | ImuSamples
    | RangeSamples
    | OdometrySamples
    | JointAngles
    | GnssSamples
    | PressureSamples
    | MagneticSamples
    | BatterySamples
)
