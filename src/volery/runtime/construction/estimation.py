"""Builds the estimators of a scenario: their inputs and their sensor parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.runtime.construction.geo_reference import magnetic_field_map
from volery.scenario.schema import FlatTerrain, Scenario
from volery.sensors.gnss import GnssModel
from volery.sensors.imu import ImuModel
from volery.sensors.sonar import SonarModel

if TYPE_CHECKING:
    from volery.control.estimator.settings import EstimatorSettings, Mounting
    from volery.engine.estimation import Estimation
    from volery.runtime.construction.sensor_suites import SensorInstance

_AIDS = ("imu", "gnss", "barometer", "magnetometer", "sonar")
_START_M, _START_M_S, _START_TILT_RAD, _START_HEADING_RAD = 0.5, 0.02, 0.01, 0.03
"""Standard deviations of the initial estimate's error (modelling choices): a UAV starts on a
surveyed position, at rest, aligned by gravity and compass."""


def build_estimation(
    scenario: Scenario, fitted: Sequence[SensorInstance], fleet: Fleet
) -> Estimation | None:
    """Returns the estimators of the UAVs with a sensor of kind "estimate"; None without any."""
    wanted = [sensor for sensor in fitted if sensor.spec.kind == "estimate"]
    if not wanted:
        return None
    # Late import: the kernels take seconds to compile and most scenarios need none of them.
    from volery.control.estimator.estimator import Estimator
    from volery.control.estimator.settings import StartSigmas
    from volery.engine.estimation import Estimation, EstimationSetup

    by_uav: dict[int, dict[str, SensorInstance]] = {sensor.id.uav: {} for sensor in wanted}
    for sensor in fitted:
        if sensor.spec.kind in _AIDS and sensor.id.uav in by_uav:
            by_uav[sensor.id.uav].setdefault(sensor.spec.kind, sensor)  # the first of each kind
    aids = list(by_uav.values())
    known = _Knowledge(scenario)
    uavs = np.array([sensor.id.uav for sensor in wanted])
    start = StartSigmas((_START_M,) * 3, (_START_M_S,) * 3, _START_TILT_RAD, _START_HEADING_RAD)
    estimator = Estimator(
        len(wanted),
        [known.settings(own) for own in aids],
        position=fleet.state.position_map[uavs],
        velocity=fleet.state.velocity_map[uavs],
        attitude=fleet.state.attitude[uavs],
        mounting=[_mounting(own) for own in aids],
        start=start,
    )
    terrain = scenario.world.terrain
    setup = EstimationSetup(
        uavs=uavs,
        used_for_control=np.array([sensor.spec.used_for_control for sensor in wanted]),
        listens={
            (aid.id.uav, aid.id.name): e for e, own in enumerate(aids) for aid in own.values()
        },
        gyro_variance=np.array([known.gyro_variance(own) for own in aids]),
        gnss_drift_variance=np.array([known.drift_variance(own) for own in aids]),
        origin_altitude_m=scenario.world.origin.altitude_m,
        ground_height_m=terrain.height_m if isinstance(terrain, FlatTerrain) else None,
        start=start,
    )
    estimation = Estimation(estimator, setup, fleet)
    estimation.restart({sensor.id.uav: sensor.key for sensor in wanted})
    return estimation


class _Knowledge:
    """Reads the sensor parameters of estimators from the data files, each once."""

    def __init__(self, scenario: Scenario) -> None:
        self._model = scenario.access.find_model
        self._field = tuple(magnetic_field_map(scenario.world).tolist())
        self._settings: dict[tuple[Any, ...], EstimatorSettings] = {}
        self._gnss: dict[str, GnssModel] = {}

    def settings(self, aids: Mapping[str, SensorInstance]) -> EstimatorSettings:
        """Returns the settings of an estimator that uses `aids`."""
        key = tuple((kind, aid.spec) for kind, aid in sorted(aids.items()))
        if key not in self._settings:
            self._settings[key] = self._make_settings(aids)
        return self._settings[key]

    def gyro_variance(self, aids: Mapping[str, SensorInstance]) -> float:
        """Returns the variance of one gyroscope sample, rad^2/s^2."""
        settings = self.settings(aids)
        return settings.gyro_noise_density_rad_s_sqrt_hz**2 * settings.imu_rate_hz

    def drift_variance(self, aids: Mapping[str, SensorInstance]) -> tuple[float, float, float]:
        """Returns the variance of the receiver's drift, m^2, east, north, up; zero without one."""
        horizontal, _, vertical = self._drift(aids)
        return horizontal**2, horizontal**2, vertical**2

    def _make_settings(self, aids: Mapping[str, SensorInstance]) -> EstimatorSettings:
        from volery.control.estimator.settings import EstimatorSettings

        keys = set(EstimatorSettings.model_fields)
        imu = ImuModel.load(self._model(aids["imu"].spec.model)).model_dump()
        values: dict[str, Any] = {key: value for key, value in imu.items() if key in keys}
        values["imu_rate_hz"] = aids["imu"].spec.rate_hz
        values["magnetic_field_map"] = self._field
        if "gnss" in aids:
            values["gnss_offset_sigma_m"] = self._drift(aids)
            values["gnss_offset_correlation_s"] = self._receiver(aids).drift_correlation_s
        if "sonar" in aids:
            cone = SonarModel.load(self._model(aids["sonar"].spec.model)).field_of_view_deg
            values["range_half_cone_rad"] = math.radians(cone / 2.0)
        return EstimatorSettings(**values)

    def _drift(self, aids: Mapping[str, SensorInstance]) -> tuple[float, float, float]:
        if "gnss" not in aids:
            return 0.0, 0.0, 0.0
        model = self._receiver(aids)
        return model.horizontal_drift_m, model.horizontal_drift_m, model.vertical_drift_m

    def _receiver(self, aids: Mapping[str, SensorInstance]) -> GnssModel:
        name = aids["gnss"].spec.model
        if name not in self._gnss:
            self._gnss[name] = GnssModel.load(self._model(name))
        return self._gnss[name]


def _mounting(aids: Mapping[str, SensorInstance]) -> Mounting:
    from volery.control.estimator.settings import Mounting

    mounting: dict[str, Any] = {}
    for kind, key in (
        ("imu", "imu_position_body"),
        ("gnss", "gnss_position_body"),
        ("barometer", "barometer_position_body"),
        ("sonar", "range_position_body"),
    ):
        if kind in aids:
            mounting[key] = tuple(aids[kind].mount.position_body.tolist())
    for kind, key in (("imu", "imu_attitude_body"), ("magnetometer", "magnetometer_attitude_body")):
        if kind in aids:
            mounting[key] = tuple(aids[kind].mount.attitude_body.tolist())
    if "sonar" in aids:
        ahead = rotations.rotate(aids["sonar"].mount.attitude_body, [1.0, 0.0, 0.0])
        mounting["range_axis_body"] = tuple(ahead.tolist())
    return Mounting(**mounting)
