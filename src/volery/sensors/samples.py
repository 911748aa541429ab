"""What sensors measured, as batches: one object for all sensors of a bank at one instant.

Row i of every array belongs to `sensors[i]`. Arrays are fresh, owned by the sample and read-only.
`MEASURED` names what a biased sensor gets wrong, and how many numbers tell the error of one sensor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.core.geodesy import LocalFrame
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar_model import LidarModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SensorId:
    """Which sensor of which UAV."""

    uav: int
    """Row of the UAV in the fleet."""
    uav_name: str
    name: str

    @property
    def path(self) -> str:
        """`uav1/imu`: names it also where rows have changed."""
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
    """Of the sweep, counted from 0."""
    echoes: NDArray[np.float32]
    """(S, E, beams) m, nearest first; +inf no echo, -inf nearer than the least range (REP-117)."""
    intensities: NDArray[np.float32]
    """(S, E, beams), 0 without an echo; (S, 0, beams) where they were not wanted."""

    @property
    def ranges(self) -> NDArray[np.float32]:
        """(S, beams) of the first echoes, m."""
        return self.echoes[:, 0]


@dataclass(frozen=True)
class CameraFrames:
    """One picture of each camera of a bank; a part that nobody wanted has no pixels."""

    MEASURED: ClassVar[dict[str, int]] = {"depth": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    """When the first row was exposed."""
    model: CameraModel
    colour: NDArray[np.uint8]
    """(S, height, width, 3) sRGB."""
    depth: NDArray[np.float32]
    """(S, height, width) m along the optical axis; -inf too near, inf too far, NaN not seen."""
    instance: NDArray[np.int32]
    """(S, height, width) instance of the scene, -1 for none."""
    material: NDArray[np.uint8]
    """(S, height, width) `Material`."""


@dataclass(frozen=True)
class ImuReadings:
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
class RangeReadings:
    """Distances of single-cone range finders."""

    MEASURED: ClassVar[dict[str, int]] = {"ranges": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    ranges: Array
    """(S,) m; +inf nothing in reach, -inf nearer than the least range (REP-117)."""
    field_of_view_rad: float
    range_min_m: float
    range_max_m: float
    variance: float
    """m^2 of the noise."""


@dataclass(frozen=True)
class OdometryReadings:
    """Poses in the odometry frame and twists in the body."""

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
    """(S, 6)."""
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
class GnssReadings:
    """Fixes of satellite navigation receivers: where and how fast their antennas were."""

    MEASURED: ClassVar[dict[str, int]] = {"position_map": 3}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    """Time of the position, before it was worked out and sent."""
    frame: LocalFrame
    """The map's place on the earth."""
    has_fix: NDArray[np.bool_]
    """(S,)."""
    position_map: Array
    """(S, 3) m; nan without a fix."""
    velocity_map: Array
    """(S, 3) m/s; nan without a fix."""
    position_variance: Array
    """(S, 3) m^2, east-north-up."""
    velocity_variance: Array
    """(S, 3) (m/s)^2, east-north-up."""


@dataclass(frozen=True)
class PressureReadings:
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
class MagneticReadings:
    """Magnetic flux density in the sensors' frames."""

    MEASURED: ClassVar[dict[str, int]] = {"field": 3}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    field: Array
    """(S, 3) T."""
    field_variance: float


@dataclass(frozen=True)
class BatteryReadings:
    """What battery monitors tell."""

    MEASURED: ClassVar[dict[str, int]] = {"voltage": 1, "current": 1}

    sensors: tuple[SensorId, ...]
    stamp_ns: int
    voltage: Array
    """(S,) V under load."""
    current: Array
    """(S,) A out of the battery."""
    charge: Array
    """(S,) share of the capacity that is left."""
    capacity_ah: Array
    """(S,) A h."""
    cells: NDArray[np.int64]
    """(S,) in series."""
    level: NDArray[np.int64]
    """(S,) `vehicle.battery.BatteryLevel`."""


Samples: TypeAlias = (
    LidarScans
    | CameraFrames
    | ImuReadings
    | RangeReadings
    | OdometryReadings
    | JointAngles
    | GnssReadings
    | PressureReadings
    | MagneticReadings
    | BatteryReadings
)


def owned(array: NDArray[Any]) -> NDArray[Any]:
    """The array, made read-only."""
    array.flags.writeable = False
    return array
