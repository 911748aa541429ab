"""Groups the sensors of all UAVs into banks that are sampled together."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.clock import Schedule, ns_from_s
from volery.core.errors import DataFileError
from volery.engine.engine import SensorBank
from volery.runtime.build.geo_reference import denial, local_frame, magnetic_field_map
from volery.runtime.build.sensor_suites import PICTURE, RESULT_OF, SensorInstance
from volery.runtime.build.worlds import light_of
from volery.scenario import schema
from volery.sensors.bank import Bank
from volery.sensors.barometer import BarometerBank, BarometerModel
from volery.sensors.battery import BatteryBank
from volery.sensors.faults import FaultableBank
from volery.sensors.gnss import GnssBank, GnssModel
from volery.sensors.imu import ImuBank, ImuModel
from volery.sensors.joints import JointBank
from volery.sensors.lidar_bank import LidarBank
from volery.sensors.lidar_model import LidarModel
from volery.sensors.magnetometer import MagnetometerBank, MagnetometerModel
from volery.sensors.odometry import GroundTruthBank, OdometryBank, OdometryModel
from volery.sensors.samples import (
    JointAngles,
    SensorId,
)
from volery.sensors.scan_patterns import PlanarScan
from volery.sensors.sonar import SonarBank, SonarModel
from volery.world.scene import Scene

if TYPE_CHECKING:
    from volery.engine.estimation import Estimation


def build_banks(
    scenario: schema.Scenario,
    fitted: Sequence[SensorInstance],
    fleet: Fleet,
    scene: Scene,
    estimation: Estimation | None = None,
) -> list[SensorBank]:
    """Returns the banks in a fixed order; estimates come last, after their inputs."""
    groups: dict[tuple[Any, ...], list[SensorInstance]] = defaultdict(list)
    for sensor in sorted(fitted, key=lambda sensor: sensor.spec.kind == "estimate"):
        groups[sensor.bank_key].append(sensor)
    builder = _Builder(scenario, fleet, scene, estimation)
    banks: list[SensorBank] = [
        FaultableBank(builder.build(group), RESULT_OF[group[0].spec.kind].MEASURED)
        for group in groups.values()
    ]
    nodding = [sensor for sensor in fitted if sensor.mount.nods]
    if nodding:
        joints = JointBank(tuple(s.id for s in nodding), tuple(s.mount for s in nodding))
        banks.append(FaultableBank(joints, JointAngles.MEASURED))
    return banks


class _Builder:
    def __init__(
        self,
        scenario: schema.Scenario,
        fleet: Fleet,
        scene: Scene,
        estimation: Estimation | None,
    ) -> None:
        self._estimation = estimation
        self._scenario = scenario.name
        self._world = scenario.world
        self._model = scenario.access.find_model
        self._fleet = fleet
        self._scene = scene

    def build(self, group: list[SensorInstance]) -> Bank:
        by_kind: dict[str, Callable[[list[SensorInstance]], Bank]] = {
            "lidar": self._lidar,
            "camera": self._camera,
            "imu": self._imu,
            "sonar": self._sonar,
            "odometry": self._odometry,
            "estimate": self._estimate,
            "ground_truth": self._ground_truth,
            "gnss": self._gnss,
            "barometer": self._barometer,
            "magnetometer": self._magnetometer,
            "battery": self._battery,
        }
        try:
            return by_kind[group[0].spec.kind](group)
        except DataFileError as error:
            name = group[0].id.name
            raise DataFileError(f"{self._scenario}: sensor '{name}': {error}") from None

    def _lidar(self, group: list[SensorInstance]) -> Bank:
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

    def _camera(self, group: list[SensorInstance]) -> Bank:
        from volery.sensors.cameras.bank import CameraBank
        from volery.sensors.cameras.model import CameraModel

        spec = group[0].spec
        own = {name: getattr(spec, name) for name in PICTURE if getattr(spec, name) is not None}
        return CameraBank(
            CameraModel.load(self._model(spec.model)).model_copy(update=own),
            _schedule(group),
            _ids(group),
            tuple(s.mount for s in group),
            _keys(group),
            self._scene,
            light_of(self._world),
        )

    def _imu(self, group: list[SensorInstance]) -> Bank:
        spec = group[0].spec
        model = ImuModel.load(self._model(spec.model))
        return ImuBank(model, _schedule(group), _ids(group), *_places(group), _keys(group))

    def _sonar(self, group: list[SensorInstance]) -> Bank:
        model = SonarModel.load(self._model(group[0].spec.model))
        return SonarBank(
            model, _schedule(group), _ids(group), *_places(group), _keys(group), self._scene
        )

    def _odometry(self, group: list[SensorInstance]) -> Bank:
        model = OdometryModel.load(self._model(group[0].spec.model))
        return OdometryBank(model, _schedule(group), _ids(group), _keys(group), self._fleet)

    def _estimate(self, group: list[SensorInstance]) -> Bank:
        from volery.sensors.estimate import EstimateBank

        assert self._estimation is not None
        rows = self._estimation.rows_of(np.array([sensor.id.uav for sensor in group]))
        variance = self._estimation.gyro_variance[rows]
        estimator = self._estimation.estimator
        return EstimateBank(_schedule(group), _ids(group), estimator, rows, variance)

    def _ground_truth(self, group: list[SensorInstance]) -> Bank:
        return GroundTruthBank(_schedule(group), _ids(group))

    def _gnss(self, group: list[SensorInstance]) -> Bank:
        model = GnssModel.load(self._model(group[0].spec.model))
        places, _ = _places(group)
        return GnssBank(
            model,
            _schedule(group),
            _ids(group),
            places,
            _keys(group),
            local_frame(self._world),
            denial(self._world),
        )

    def _barometer(self, group: list[SensorInstance]) -> Bank:
        model = BarometerModel.load(self._model(group[0].spec.model))
        places, _ = _places(group)
        altitude = self._world.origin.altitude_m
        return BarometerBank(model, _schedule(group), _ids(group), places, _keys(group), altitude)

    def _magnetometer(self, group: list[SensorInstance]) -> Bank:
        model = MagnetometerModel.load(self._model(group[0].spec.model))
        _, turns = _places(group)
        field = magnetic_field_map(self._world)
        return MagnetometerBank(model, _schedule(group), _ids(group), turns, _keys(group), field)

    def _battery(self, group: list[SensorInstance]) -> Bank:
        return BatteryBank(_schedule(group), _ids(group), self._fleet)


def _wants_intensities(spec: schema.LidarSensor, model: LidarModel) -> bool:
    if spec.intensities and model.intensity is None:
        raise DataFileError(f"LIDAR model '{model.name}' has no [intensity], which it needs here")
    if model.intensity is None or spec.intensities is False:
        return False
    if not isinstance(model.scan, PlanarScan):
        return True
    return spec.intensities or model.intensity.published


def _ids(group: list[SensorInstance]) -> tuple[SensorId, ...]:
    return tuple(sensor.id for sensor in group)


def _places(group: list[SensorInstance]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return (
        np.array([s.mount.position_body for s in group]),
        np.array([s.mount.attitude_body for s in group]),
    )


def _keys(group: list[SensorInstance]) -> NDArray[np.uint64] | None:
    return np.array([s.key for s in group]) if group[0].spec.noise else None


def _phase_ns(group: list[SensorInstance]) -> int:
    return ns_from_s(group[0].spec.phase_s)


def _schedule(group: list[SensorInstance]) -> Schedule:
    return Schedule.from_hz(group[0].spec.rate_hz, _phase_ns(group))
