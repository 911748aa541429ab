"""Groups the sensors of all UAVs into banks that are sampled together."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.control.fleet import Fleet
from volery.core.clock import Schedule, ns_from_s
from volery.core.errors import DataFileError
from volery.engine.engine import SensorBank
from volery.runtime.construction.geo_reference import denial, local_frame, magnetic_field_map
from volery.runtime.construction.partition import DIVIDED_SENSORS, WHOLE, Partition
from volery.runtime.construction.sensor_suites import IMAGE_KEYS, RESULT_OF, SensorInstance
from volery.runtime.construction.worlds import light_of
from volery.scenario import schema
from volery.sensors.bank import Bank, SensorGroup
from volery.sensors.barometer import BarometerBank, BarometerModel
from volery.sensors.battery import BatteryBank
from volery.sensors.faults import FaultableBank
from volery.sensors.gnss import GnssBank, GnssModel
from volery.sensors.imu import ImuBank, ImuModel
from volery.sensors.joints import JointBank
from volery.sensors.lidar.lidar_bank import LidarBank
from volery.sensors.lidar.lidar_model import LidarModel
from volery.sensors.lidar.scan_patterns import PlanarScan
from volery.sensors.magnetometer import MagnetometerBank, MagnetometerModel
from volery.sensors.odometry import GroundTruthBank, OdometryBank, OdometryModel
from volery.sensors.samples import (
    JointAngles,
)
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
    partition: Partition = WHOLE,
) -> list[SensorBank]:
    """Returns the banks in a fixed order; estimates come last, after their inputs.

    partition: the UAVs whose LIDARs and cameras are sampled here.
    """
    groups: dict[tuple[Any, ...], list[SensorInstance]] = defaultdict(list)
    for sensor in sorted(fitted, key=lambda sensor: sensor.spec.kind == "estimate"):
        own = groups[sensor.bank_key]  # the order of the banks is that of all sensors
        if sensor.spec.kind not in DIVIDED_SENSORS or partition.serves(sensor.id.uav_name):
            own.append(sensor)
    builder = _Builder(scenario, fleet, scene, estimation)
    banks: list[SensorBank] = [
        FaultableBank(
            builder.build(group),
            RESULT_OF[group[0].spec.kind].MEASURED,
            [sensor.key for sensor in group],
        )
        for group in groups.values()
        if group
    ]
    nodding = [sensor for sensor in fitted if sensor.mount.nods]
    if nodding:
        joints = JointBank(tuple(s.id for s in nodding), tuple(s.mount for s in nodding))
        keys = [sensor.key for sensor in nodding]
        banks.append(FaultableBank(joints, JointAngles.MEASURED, keys))
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
        self._find_model = scenario.access.find_model
        self._fleet = fleet
        self._scene = scene

    def build(self, instances: list[SensorInstance]) -> Bank:
        """Returns the bank of sensors that are sampled together."""
        first = instances[0]
        group = _group_of(instances)
        by_kind: dict[str, Callable[[SensorInstance, SensorGroup], Bank]] = {
            "lidar": self._lidar,
            "camera": self._camera,
            "imu": lambda one, group: ImuBank(ImuModel.load(self._model(one)), group),
            "sonar": self._sonar,
            "odometry": self._odometry,
            "estimate": self._estimate,
            "ground_truth": lambda _, group: GroundTruthBank(group),
            "gnss": self._gnss,
            "barometer": self._barometer,
            "magnetometer": self._magnetometer,
            "battery": lambda _, group: BatteryBank(group, self._fleet),
        }
        try:
            return by_kind[first.spec.kind](first, group)
        except DataFileError as error:
            raise DataFileError(f"{self._scenario}: sensor '{first.id.name}': {error}") from None

    def _model(self, one: SensorInstance) -> str:
        return self._find_model(one.spec.model)

    def _lidar(self, one: SensorInstance, group: SensorGroup) -> Bank:
        assert one.lidar is not None
        intensities = _wants_intensities(one.spec, one.lidar)
        return LidarBank(one.lidar, group, self._scene, intensities=intensities)

    def _camera(self, one: SensorInstance, group: SensorGroup) -> Bank:
        from volery.sensors.cameras.bank import CameraBank
        from volery.sensors.cameras.model import CameraModel

        spec = one.spec
        own = {name: getattr(spec, name) for name in IMAGE_KEYS if getattr(spec, name) is not None}
        model = CameraModel.load(self._model(one)).model_copy(update=own)
        return CameraBank(model, group, self._scene, light_of(self._world))

    def _sonar(self, one: SensorInstance, group: SensorGroup) -> Bank:
        return SonarBank(SonarModel.load(self._model(one)), group, self._scene)

    def _odometry(self, one: SensorInstance, group: SensorGroup) -> Bank:
        return OdometryBank(OdometryModel.load(self._model(one)), group, self._fleet)

    def _estimate(self, _one: SensorInstance, group: SensorGroup) -> Bank:
        from volery.sensors.estimate import EstimateBank

        assert self._estimation is not None
        rows = self._estimation.rows_of(np.array([sensor.uav for sensor in group.sensors]))
        variance = self._estimation.gyro_variance[rows]
        return EstimateBank(group, self._estimation.estimator, rows, variance)

    def _gnss(self, one: SensorInstance, group: SensorGroup) -> Bank:
        model = GnssModel.load(self._model(one))
        return GnssBank(model, group, local_frame(self._world), denial(self._world))

    def _barometer(self, one: SensorInstance, group: SensorGroup) -> Bank:
        model = BarometerModel.load(self._model(one))
        return BarometerBank(model, group, self._world.origin.altitude_m)

    def _magnetometer(self, one: SensorInstance, group: SensorGroup) -> Bank:
        model = MagnetometerModel.load(self._model(one))
        return MagnetometerBank(model, group, magnetic_field_map(self._world))


def _wants_intensities(spec: schema.LidarSensor, model: LidarModel) -> bool:
    if spec.intensities and model.intensity is None:
        raise DataFileError(f"LIDAR model '{model.name}' has no [intensity], which it needs here")
    if model.intensity is None or spec.intensities is False:
        return False
    if not isinstance(model.scan, PlanarScan):
        return True
    return spec.intensities or model.intensity.published


def _group_of(instances: list[SensorInstance]) -> SensorGroup:
    first = instances[0]
    rate_hz = first.spec.rate_hz if first.lidar is None else first.lidar.scan.rate_hz
    return SensorGroup(
        Schedule.from_hz(rate_hz, ns_from_s(first.spec.phase_s)),
        tuple(one.id for one in instances),
        tuple(one.mount for one in instances),
        np.array([one.key for one in instances]) if getattr(first.spec, "noise", False) else None,
    )
