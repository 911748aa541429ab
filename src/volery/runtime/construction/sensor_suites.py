"""Assigns sensors to every UAV, with their mounts and noise streams."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.core import rotations
from volery.core.errors import DataFileError, ScenarioError
from volery.core.rng import stream_key
from volery.publishing.lidar_publishing import lidar_topic
from volery.runtime.construction.placement import StartPose
from volery.scenario import schema
from volery.scenario.camera import CameraSensor
from volery.sensors.lidar.lidar_model import LidarModel, load_lidar
from volery.sensors.lidar.scan_patterns import PlanarScan
from volery.sensors.mount import Mount, make_mount
from volery.sensors.samples import (
    BatterySamples,
    CameraFrames,
    GnssSamples,
    ImuSamples,
    LidarScans,
    MagneticSamples,
    OdometrySamples,
    PressureSamples,
    RangeSamples,
    Samples,
    SensorId,
)

if TYPE_CHECKING:
    pass

RESULT_OF: dict[str, type[Samples]] = {
    "lidar": LidarScans,
    "camera": CameraFrames,
    "imu": ImuSamples,
    "sonar": RangeSamples,
    "odometry": OdometrySamples,
    "estimate": OdometrySamples,
    "ground_truth": OdometrySamples,
    "gnss": GnssSamples,
    "barometer": PressureSamples,
    "magnetometer": MagneticSamples,
    "battery": BatterySamples,
}
"""Samples of each kind of sensor."""


IMAGE_KEYS = ("width", "height", "horizontal_fov_deg", "samples")
"""Keys of a camera's model that a scenario may override."""


@dataclass(frozen=True)
class SensorInstance:
    """Describes one sensor on one UAV, before it joins a bank."""

    id: SensorId
    spec: Any
    mount: Mount
    key: np.uint64
    lidar: LidarModel | None = None
    """Model of a LIDAR; None for other sensors."""
    left: SensorId | None = None
    """For the right camera of a stereo pair: the left camera."""

    @property
    def bank_key(self) -> tuple[Any, ...]:
        """Key of the bank: sensors with equal keys are sampled together."""
        spec = self.spec
        rate, model = getattr(spec, "rate_hz", None), getattr(spec, "model", None)
        noise, intensities = getattr(spec, "noise", None), getattr(spec, "intensities", None)
        image = [getattr(spec, name, None) for name in IMAGE_KEYS]
        return (spec.kind, model, rate, spec.phase_s, noise, intensities, *image)

    @property
    def topic(self) -> str:
        """Topic of a LIDAR's scans or points."""
        assert self.lidar is not None
        return lidar_topic(self.id, self.lidar, self.spec.topic)


def fit_sensors(scenario: schema.Scenario, starts: Sequence[StartPose]) -> list[SensorInstance]:
    """Returns every sensor of every UAV, in fleet order.

    Raises `DataFileError` if a LIDAR model cannot be loaded, `ScenarioError` if two LIDARs of a
    UAV share a topic.
    """
    models = _LidarModels(scenario)
    fitted = [
        SensorInstance(
            SensorId(row, start.name, spec.name),
            spec,
            _mount(spec),
            noise_key(scenario.seed, spec.kind, SensorId(row, start.name, spec.name)),
            models.load(spec) if isinstance(spec, schema.LidarSensor) else None,
        )
        for row, start in enumerate(starts)
        for spec in scenario.types[start.type_name].sensors
    ]
    fitted = [camera for sensor in fitted for camera in _pair(scenario.seed, sensor)]
    _check_topics(scenario, fitted)
    return fitted


def _pair(seed: int, sensor: SensorInstance) -> list[SensorInstance]:
    """Returns the left and right camera of a stereo pair; any other sensor unchanged."""
    spec = sensor.spec
    if not isinstance(spec, CameraSensor) or spec.stereo is None:
        return [sensor]
    ids = [replace(sensor.id, name=f"{spec.name}/{side}") for side in ("left", "right")]
    aside = [0.5 * spec.stereo.baseline_m, -0.5 * spec.stereo.baseline_m]  # y is to the left
    return [
        replace(
            sensor,
            id=own,
            mount=_moved(sensor.mount, y),
            key=noise_key(seed, spec.kind, own),
            left=None if own is ids[0] else ids[0],
        )
        for own, y in zip(ids, aside, strict=True)
    ]


def _moved(mount: Mount, y: float) -> Mount:
    """Returns the mount shifted by `y` m along its own y axis."""
    offset = rotations.rotate(mount.attitude_body, np.array([0.0, y, 0.0]))
    return mount._replace(position_body=mount.position_body + offset)


def refit(fitted: Sequence[SensorInstance], seed: int, first_row: int = 0) -> list[SensorInstance]:
    """Returns the same sensors with the noise of `seed`, on UAVs from `first_row` on."""
    return [
        replace(
            sensor,
            id=replace(sensor.id, uav=sensor.id.uav + first_row),
            key=noise_key(seed, sensor.spec.kind, sensor.id),
        )
        for sensor in fitted
    ]


def noise_key(seed: int, kind: str, sensor: SensorId) -> np.uint64:
    """Returns the noise stream of a sensor in a run with `seed`; `kind` is the bank's name."""
    return stream_key(seed, stream_name(kind, sensor))


def stream_name(kind: str, sensor: SensorId) -> str:
    """Returns the name of a sensor's noise stream; `kind` is the bank's name."""
    return f"{sensor.uav_name}/{kind}/{sensor.name}"


class _LidarModels:
    """Loads each LIDAR model of a scenario once."""

    def __init__(self, scenario: schema.Scenario) -> None:
        self._scenario = scenario
        self._loaded: dict[str, LidarModel] = {}

    def load(self, spec: schema.LidarSensor) -> LidarModel:
        """Returns the model of a LIDAR; errors contain the scenario and the sensor."""
        if spec.model not in self._loaded:
            try:
                self._loaded[spec.model] = load_lidar(self._scenario.access.find_model(spec.model))
            except DataFileError as error:
                where = f"{self._scenario.name}: sensor '{spec.name}'"
                raise DataFileError(f"{where}: {error}") from None
        return self._loaded[spec.model]


def _check_topics(scenario: schema.Scenario, fitted: Sequence[SensorInstance]) -> None:
    """Raises `ScenarioError` if two LIDARs of a UAV publish on one topic."""
    names_by_topic: dict[str, str] = {}
    for sensor in fitted:
        if sensor.lidar is None:
            continue
        other = names_by_topic.setdefault(sensor.topic, sensor.id.name)
        if other != sensor.id.name:
            raise ScenarioError(
                f"{scenario.name}: sensors '{other}' and '{sensor.id.name}' both publish on "
                f"{sensor.topic}; give one of them another `topic`"
            )


def lidar_mounts(fitted: Sequence[SensorInstance], *, planar: bool) -> Mapping[str, Mount]:
    """Returns the mounts of LIDARs by topic, of LaserScans or of PointCloud2s."""
    return MappingProxyType(
        {
            sensor.topic: sensor.mount
            for sensor in fitted
            if sensor.lidar is not None and isinstance(sensor.lidar.scan, PlanarScan) == planar
        }
    )


def _mount(spec: Any) -> Mount:
    if not hasattr(spec, "position_m"):
        return make_mount()
    roll, pitch, yaw = (math.radians(angle) for angle in spec.rpy_deg)
    attitude = rotations.from_rpy(roll, pitch, yaw)
    nodding: schema.Nodding | None = getattr(spec, "nodding", None)
    if nodding is None:
        return make_mount(spec.position_m, attitude)
    return make_mount(
        spec.position_m,
        attitude,
        amplitude_rad=math.radians(nodding.amplitude_deg),
        period_s=nodding.period_s,
        offset_rad=math.radians(nodding.offset_deg),
        phase_rad=math.radians(nodding.phase_deg),
    )
