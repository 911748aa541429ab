"""Gathers the sensors of all UAVs into banks that are sampled together."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.clock import Schedule, ns_from_s
from volery.core.errors import DataFileError, ScenarioError
from volery.core.rng import stream_key
from volery.engine.engine import SensorBank
from volery.graph.lidar_publishing import lidar_topic
from volery.runtime.placement import Start
from volery.scenario import schema
from volery.sensors.imu import ImuBank, load_imu_model
from volery.sensors.joints import JointBank
from volery.sensors.lidar_bank import LidarBank
from volery.sensors.lidar_model import LidarModel, load_lidar
from volery.sensors.mount import Mount, make_mount
from volery.sensors.odometry import GroundTruthBank, OdometryBank, load_odometry_model
from volery.sensors.samples import SensorId
from volery.sensors.scan_patterns import PlanarScan
from volery.sensors.sonar import SonarBank, load_sonar_model
from volery.world.scene import Scene


@dataclass(frozen=True)
class Fitted:
    """One sensor on one UAV, before it joins a bank."""

    id: SensorId
    spec: Any
    mount: Mount
    key: np.uint64
    lidar: LidarModel | None = None
    """What kind of LIDAR it is, if it is one."""

    @property
    def bank_key(self) -> tuple[Any, ...]:
        """Sensors with equal keys are sampled together."""
        spec = self.spec
        rate, model = getattr(spec, "rate_hz", None), getattr(spec, "model", None)
        noise, intensities = getattr(spec, "noise", None), getattr(spec, "intensities", None)
        return (spec.kind, model, rate, spec.phase_s, noise, intensities)

    @property
    def topic(self) -> str:
        """Where a LIDAR's scans or points go."""
        assert self.lidar is not None
        return lidar_topic(self.id, self.lidar, self.spec.topic)


def fit_sensors(scenario: schema.Scenario, starts: Sequence[Start]) -> list[Fitted]:
    """Every sensor of every UAV, in fleet order.

    Raises `DataFileError` for a LIDAR model that cannot be loaded, `ScenarioError` where two LIDARs
    of a UAV have one topic.
    """
    models = _LidarModels(scenario)
    fitted = [
        Fitted(
            SensorId(row, start.name, spec.name),
            spec,
            _mount(spec),
            stream_key(scenario.seed, f"{start.name}/{spec.kind}/{spec.name}"),
            models.load(spec) if isinstance(spec, schema.LidarSensor) else None,
        )
        for row, start in enumerate(starts)
        for spec in scenario.types[start.type_name].sensors
    ]
    _check_topics(scenario, fitted)
    return fitted


class _LidarModels:
    """Loads each LIDAR model of a scenario once."""

    def __init__(self, scenario: schema.Scenario) -> None:
        self._scenario = scenario
        self._loaded: dict[str, LidarModel] = {}

    def load(self, spec: schema.LidarSensor) -> LidarModel:
        """Model of a LIDAR; errors name the scenario and the sensor."""
        if spec.model not in self._loaded:
            try:
                self._loaded[spec.model] = load_lidar(spec.model, self._scenario.folder)
            except DataFileError as error:
                where = f"{self._scenario.name}: sensor '{spec.name}'"
                raise DataFileError(f"{where}: {error}") from None
        return self._loaded[spec.model]


def _check_topics(scenario: schema.Scenario, fitted: Sequence[Fitted]) -> None:
    """Refuse LIDARs that would publish on one topic."""
    taken: dict[str, str] = {}
    for sensor in fitted:
        if sensor.lidar is None:
            continue
        other = taken.setdefault(sensor.topic, sensor.id.name)
        if other != sensor.id.name:
            raise ScenarioError(
                f"{scenario.name}: sensors '{other}' and '{sensor.id.name}' both publish on "
                f"{sensor.topic}; give one of them another `topic`"
            )


def lidar_mounts(fitted: Sequence[Fitted], *, planar: bool) -> Mapping[str, Mount]:
    """Topics of LaserScans, or of PointCloud2s, and how their LIDARs are mounted."""
    return MappingProxyType(
        {
            sensor.topic: sensor.mount
            for sensor in fitted
            if sensor.lidar is not None and isinstance(sensor.lidar.scan, PlanarScan) == planar
        }
    )


def build_banks(
    scenario: schema.Scenario, fitted: Sequence[Fitted], fleet: Fleet, scene: Scene
) -> list[SensorBank]:
    """Banks of all sensors, in a fixed order."""
    groups: dict[tuple[Any, ...], list[Fitted]] = defaultdict(list)
    for sensor in fitted:
        groups[sensor.bank_key].append(sensor)
    builder = _Builder(scenario, fleet, scene)
    banks = [builder.build(group) for group in groups.values()]
    nodding = [sensor for sensor in fitted if sensor.mount.nods]
    if nodding:
        banks.append(JointBank(tuple(s.id for s in nodding), tuple(s.mount for s in nodding)))
    return banks


class _Builder:
    def __init__(self, scenario: schema.Scenario, fleet: Fleet, scene: Scene) -> None:
        self._scenario = scenario.name
        self._folder = scenario.folder
        self._fleet = fleet
        self._scene = scene

    def build(self, group: list[Fitted]) -> SensorBank:
        by_kind: dict[str, Callable[[list[Fitted]], SensorBank]] = {
            "lidar": self._lidar,
            "imu": self._imu,
            "sonar": self._sonar,
            "odometry": self._odometry,
            "ground_truth": self._ground_truth,
        }
        try:
            return by_kind[group[0].spec.kind](group)
        except DataFileError as error:
            name = group[0].id.name
            raise DataFileError(f"{self._scenario}: sensor '{name}': {error}") from None

    def _lidar(self, group: list[Fitted]) -> SensorBank:
        model = group[0].lidar
        assert model is not None
        return LidarBank(
            model,
            Schedule.from_hz(model.scan.rate_hz, _phase_ns(group)),
            _ids(group),
            tuple(s.mount for s in group),
            _keys(group),
            self._scene,
            intensities=_wants_intensities(group[0].spec, model),
        )

    def _imu(self, group: list[Fitted]) -> SensorBank:
        spec = group[0].spec
        model = load_imu_model(spec.model, self._folder)
        return ImuBank(model, _schedule(group), _ids(group), *_places(group), _keys(group))

    def _sonar(self, group: list[Fitted]) -> SensorBank:
        model = load_sonar_model(group[0].spec.model, self._folder)
        return SonarBank(
            model, _schedule(group), _ids(group), *_places(group), _keys(group), self._scene
        )

    def _odometry(self, group: list[Fitted]) -> SensorBank:
        model = load_odometry_model(group[0].spec.model, self._folder)
        return OdometryBank(model, _schedule(group), _ids(group), _keys(group), self._fleet)

    def _ground_truth(self, group: list[Fitted]) -> SensorBank:
        return GroundTruthBank(_schedule(group), _ids(group))


def _wants_intensities(spec: schema.LidarSensor, model: LidarModel) -> bool:
    if spec.intensities and model.intensity is None:
        raise DataFileError(f"LIDAR model '{model.name}' has no [intensity], which it needs here")
    if model.intensity is None or spec.intensities is False:
        return False
    if not isinstance(model.scan, PlanarScan):
        return True
    return spec.intensities or model.intensity.published


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


def _ids(group: list[Fitted]) -> tuple[SensorId, ...]:
    return tuple(sensor.id for sensor in group)


def _places(group: list[Fitted]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return (
        np.array([s.mount.position_body for s in group]),
        np.array([s.mount.attitude_body for s in group]),
    )


def _keys(group: list[Fitted]) -> NDArray[np.uint64] | None:
    return np.array([s.key for s in group]) if group[0].spec.noise else None


def _phase_ns(group: list[Fitted]) -> int:
    return ns_from_s(group[0].spec.phase_s)


def _schedule(group: list[Fitted]) -> Schedule:
    return Schedule.from_hz(group[0].spec.rate_hz, _phase_ns(group))
