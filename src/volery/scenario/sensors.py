"""The sensors of a scenario's UAVs."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from volery.scenario.base import Data, MountedSensor, Name, Rate, SensorData, Topic
from volery.scenario.camera import CameraSensor
from volery.scenario.navigation import NavigationSensor


class Nodding(Data):
    """Sinusoidal tilt of a mount about the sensor's y axis (positive tilts downward)."""

    amplitude_deg: Annotated[float, Field(gt=0.0, le=90.0)] = 45.0
    """Largest tilt from the offset."""
    period_s: Annotated[float, Field(ge=0.1, le=60.0)] = 2.0
    """Time of a full cycle."""
    offset_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 0.0
    """Mean tilt; positive tilts downward."""
    phase_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Phase of the cycle at time 0."""


class LidarSensor(MountedSensor):
    """A LIDAR of a named model: planar, with many rings, or with a rosette."""

    kind: Literal["lidar"] = "lidar"
    """A LIDAR."""
    name: Name = "horizontal"
    """Name of the sensor in frames and topics."""
    model: str = "utm_30lx"
    """Shipped model, or path of a .toml file."""
    topic: Topic | None = None
    """Topic below the UAV's name; None: `laser/NAME/scan` for a planar scanner, else `points`."""
    intensities: bool | None = None
    """Whether echoes have intensities; None: the model's default."""
    nodding: Nodding | None = None
    """Tilt of the mount over time; None: the mount is fixed."""


class ImuSensor(MountedSensor):
    """Accelerometer and gyroscope of a named model."""

    kind: Literal["imu"] = "imu"
    """An inertial measurement unit."""
    name: Name = "imu"
    """Name of the sensor in frames and topics."""
    model: str = "adis16448"
    """Shipped model, or path of a .toml file."""
    rate_hz: Rate = 200.0
    """Rate of samples."""


class SonarSensor(MountedSensor):
    """Downward ultrasonic range finder."""

    kind: Literal["sonar"] = "sonar"
    """A sonar."""
    name: Name = "range"
    """Name of the sensor in frames and topics."""
    model: str = "downward_sonar"
    """Shipped model, or path of a .toml file."""
    rate_hz: Rate = 10.0
    """Rate of samples."""


class OdometrySensor(SensorData):
    """Pose and velocity from an odometry source: true motion plus a modelled drift."""

    kind: Literal["odometry"] = "odometry"
    """An odometry source."""
    name: Literal["odom"] = "odom"
    """Name of the sensor; it is fixed."""
    noise: bool = True
    """Whether the odometry drifts; false: it is exact."""
    model: str = "visual_inertial"
    """Shipped model of the drift, or path of a .toml file."""
    rate_hz: Rate = 50.0
    """Rate of samples."""


class ExternalOdometrySource(Data):
    """Odometry of a node, such as a SLAM's, that aids an estimator; assumed to be in the map frame.

    Covariances of such odometry state its drift from the map. The UAV flies in the frame of the
    odometry, where its errors are those of one pose relative to the next: `sigma_m`, `sigma_deg`.
    """

    topic: Topic
    """Topic of type nav_msgs/Odometry, below the UAV's name."""
    sigma_m: Annotated[float, Field(gt=0.0, le=100.0)] = 0.05
    """Standard deviation of a position relative to the previous one."""
    sigma_deg: Annotated[float, Field(gt=0.0, le=180.0)] = 1.0
    """Standard deviation of an attitude relative to the previous one."""
    rate_hz: Rate = 10.0
    """Maximum rate of poses: closer ones repeat each other's errors."""


class EstimateSensor(SensorData):
    """Output of the UAV's estimator, as odometry; it needs an IMU."""

    kind: Literal["estimate"] = "estimate"
    """The UAV's state estimator."""
    name: Literal["odom"] = "odom"
    """Name of the sensor; it is fixed."""
    rate_hz: Rate = 50.0
    """Rate of samples."""
    used_for_control: bool = True
    """Whether the UAV's controllers use the estimate; false: ground truth."""
    external_odometry: ExternalOdometrySource | None = None
    """Odometry of a node that aids the estimator; None: there is none."""


class GroundTruthSensor(SensorData):
    """The true state, for reports and checks; autonomy must not read it."""

    kind: Literal["ground_truth"] = "ground_truth"
    """The true state."""
    name: Literal["ground_truth"] = "ground_truth"
    """Name of the sensor; it is fixed."""
    rate_hz: Rate = 50.0
    """Rate of samples."""


class BatterySensor(SensorData):
    """Battery monitor: voltage, current and charge, if the airframe has a battery."""

    kind: Literal["battery"] = "battery"
    """A battery monitor."""
    name: Literal["battery"] = "battery"
    """Name of the sensor; it is fixed."""
    rate_hz: Rate = 1.0
    """Rate of samples."""


Sensor: TypeAlias = Annotated[
    LidarSensor
    | ImuSensor
    | SonarSensor
    | OdometrySensor
    | EstimateSensor
    | GroundTruthSensor
    | CameraSensor
    | NavigationSensor
    | BatterySensor,
    Field(discriminator="kind"),
]
