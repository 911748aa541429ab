"""Defines the tasks that compile the simulation's kernels: dynamics, sensors, estimators."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.clock import Schedule
from volery.core.geodesy import LocalFrame
from volery.engine.collisions import BOUNCE, Collisions
from volery.runtime.construction.worlds import light_of
from volery.scenario.schema import World
from volery.sensors.bank import SensorGroup
from volery.sensors.gnss import GnssBank, GnssModel
from volery.sensors.imu import ImuBank, ImuModel
from volery.sensors.joints import JointBank
from volery.sensors.lidar.lidar_bank import LidarBank
from volery.sensors.lidar.lidar_model import load_lidar
from volery.sensors.lidar.point_cloud import PointMaker
from volery.sensors.magnetometer import MagnetometerBank, MagnetometerModel
from volery.sensors.mount import Mount, make_mount
from volery.sensors.odometry import GroundTruthBank
from volery.sensors.samples import SensorId
from volery.sensors.sonar import SonarBank, SonarModel
from volery.vehicle.airframe import load_airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import Plant, RigidBody
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.weather import Particles, Weather


def dynamics() -> None:
    """Compiles the fused step for rigid bodies, and the placement of UAVs on the ground."""
    terrain = Terrain.flat(extent_m=10.0)
    terrain.height([0.0], [0.0])
    _fleet().advance(0, terrain.grid)


def sensing() -> None:
    """Compiles contacts, and sensors of the kinds that most UAVs have."""
    for count in (2, 1):  # views of a single row have another memory layout: some more kernels
        _look_and_measure(count)


def _look_and_measure(count: int) -> None:
    fleet, scene = _fleet(count), _scene()
    scene.clearance(np.zeros((1, 3)), 1.0, include_terrain=False)
    scene.enclosing(np.zeros((1, 3)))
    scene.set_bodies([body_shape(fleet.airframes[0])], [0] * count)
    group = _group(count, make_mount(amplitude_rad=0.5, period_s=2.0))
    for bank in (
        LidarBank(load_lidar(), group, scene),
        SonarBank(SonarModel.load("downward_sonar"), group, scene),
        ImuBank(ImuModel.load("adis16448"), group),
        GroundTruthBank(group),
        JointBank(group.sensors, group.mounts),
    ):
        bank.sample(0, 0, fleet)
    names = tuple(sensor.uav_name for sensor in group.sensors)
    Collisions(fleet, scene, names, BOUNCE, lambda _event: None).resolve(0)
    scene.close()


def point_clouds() -> None:
    """Compiles LIDARs with many rings, and their points."""
    fleet, scene = _fleet(), _scene()
    PointMaker(_clouds(scene).sample(0, 0, fleet)).points(0)
    scene.close()


def falling_drops() -> None:
    """Compiles LIDAR echoes of rain, snow, fog and dust."""
    fleet, scene = _fleet(), _scene()
    fleet.set_weather(_RAIN)
    _clouds(scene).sample(0, 0, fleet)
    scene.close()


def images() -> None:
    """Compiles cameras, and the points of their images."""
    _render_images(Weather())


def images_in_rain() -> None:
    """Compiles drops and flakes in images."""
    _render_images(_RAIN)


_RAIN = Weather(particles=Particles(rain_mm_h=1.0))


def _render_images(weather: Weather) -> None:
    from volery.sensors.cameras.bank import CameraBank
    from volery.sensors.cameras.cloud import organised_points
    from volery.sensors.cameras.model import CameraModel

    scene, fleet = _scene(), _fleet()
    fleet.set_weather(weather)
    model = CameraModel.load("pinhole").model_copy(update={"width": 8, "height": 8})
    bank = CameraBank(model, _group(), scene, light_of(World()))
    frames = bank.sample(0, 0, fleet)
    organised_points(model, frames.depth[0], frames.colour[0])
    scene.close()


def fixes() -> None:
    """Compiles GNSS."""
    bank = GnssBank(GnssModel.load("gnss_m8"), _group(), LocalFrame(0, 0, 0))
    bank.sample(0, 0, _fleet())


def magnetic_fields() -> None:
    """Compiles magnetometers."""
    compass = MagnetometerModel.load("magnetometer_px4")
    MagnetometerBank(compass, _group(), np.zeros(3)).sample(0, 0, _fleet())


def estimates() -> None:
    """Compiles the UAVs' estimators."""
    from volery.control.estimator.errors import twist_covariance
    from volery.control.estimator.estimator import Estimator
    from volery.control.estimator.settings import EstimatorSettings

    still, level = np.zeros((2, 3)), _level()
    rows, up = np.arange(2), np.tile([0.0, 0.0, 9.8], (2, 1))
    estimator = Estimator(2, EstimatorSettings(), position=still, velocity=still, attitude=level)
    estimator.fuse_pressure_height(rows, 1, np.zeros(2), 1.0)
    estimator.predict(rows, 5_000_000, still, up)
    twist_covariance(estimator.covariance(rows), still, level, 0.0)


def other_plants() -> None:
    """Compiles the fused step with plants other than rigid bodies."""
    _fleet(plant=Kinematic()).advance(0, Terrain.flat(extent_m=10.0).grid)


def _clouds(scene: Scene) -> LidarBank:
    return LidarBank(load_lidar("vlp_16"), _group(), scene)


def _scene() -> Scene:
    return Scene(Terrain.flat(extent_m=10.0), None)


def _group(count: int = 2, mount: Mount | None = None) -> SensorGroup:
    sensors = tuple(SensorId(row, f"uav{row + 1}", "sensor") for row in range(count))
    keys = np.zeros(count, dtype=np.uint64)
    return SensorGroup(Schedule.from_hz(10.0), sensors, count * (mount or make_mount(),), keys)


def _level(count: int = 2) -> NDArray[np.float64]:
    return np.tile(rotations.IDENTITY, (count, 1))


def _fleet(count: int = 2, plant: Plant | None = None) -> Fleet:
    positions = [[3.0 * row, 0.0, 1.0] for row in range(count)]
    return Fleet(
        [load_airframe("f450")] * count, positions, _level(count), plants=plant or RigidBody()
    )


ALWAYS = dynamics, sensing
"""Tasks of every scenario; they take longest, so they come first."""
SOMETIMES = (
    images,
    estimates,
    point_clouds,
    falling_drops,
    images_in_rain,
    other_plants,
    fixes,
    magnetic_fields,
)
