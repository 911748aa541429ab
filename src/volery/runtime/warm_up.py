"""Compiles all kernels at the first start: dynamics here, most sensors' in a helper process.

On two cores the wait is halved: numba compiles one function at a time in a process. What the helper
compiles reaches this process through the cache on disk; a marker there tells later starts that
nothing is left to do.

    python -m volery.runtime.warm_up

does it ahead of time, as before parallel test workers.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.clock import Schedule
from volery.core.compiled import cache_dir
from volery.core.geodesy import LocalFrame
from volery.core.quick_typing import remembered_types
from volery.engine.collisions import BOUNCE, Collisions
from volery.sensors.gnss import GnssBank, load_gnss_model
from volery.sensors.imu import ImuBank, load_imu_model
from volery.sensors.joints import JointBank
from volery.sensors.lidar_bank import LidarBank
from volery.sensors.lidar_model import load_lidar
from volery.sensors.magnetometer import MagnetometerBank, load_magnetometer_model
from volery.sensors.mount import make_mount
from volery.sensors.odometry import GroundTruthBank
from volery.sensors.point_cloud import PointMaker
from volery.sensors.samples import SensorId
from volery.sensors.sonar import SonarBank, load_sonar_model
from volery.vehicle.airframe import load_airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plants import Plant, RigidBody
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.weather import Particles, Weather

_IS_HELPER = "VOLERY_COMPILES_SENSORS"
_HELPER = """
import sys
sys.modules["scipy"] = None
from volery.runtime import warm_up
warm_up.compile_sensors()
"""
"""What the helper runs. Where scipy is installed, numba imports its linear algebra for products of
matrices: no sensor's kernel has one."""


def kernels_are_compiled() -> bool:
    """Whether the cache holds the kernels of this version already."""
    return (cache_dir() / "complete").exists()


@contextmanager
def compiled_kernels() -> Iterator[None]:
    """Compile what the cache lacks, if anything; the helper goes on while the body runs.

    All is compiled at its end. It should not measure: sensors' kernels would compile twice.
    """
    if kernels_are_compiled() or os.environ.get(_IS_HELPER):
        yield
        return
    helper = subprocess.Popen(
        [sys.executable, "-c", _HELPER],
        env={**os.environ, _IS_HELPER: "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        compile_dynamics()
        compile_guidance()
        yield
        # A helper that failed costs time, nothing else: the kernels compile when they are called.
        if helper.wait() == 0:
            (cache_dir() / "complete").touch()
    finally:
        helper.kill()
        helper.wait()


def compile_dynamics() -> None:
    """Compile the fused step, for rigid bodies alone."""
    with _quicker():
        _fleet().advance(0, Terrain.flat(extent_m=10.0).grid)


def compile_guidance() -> None:
    """Compile what places UAVs on the ground and lets them follow gaps."""
    from volery.autonomy.gaps import free_distances
    from volery.autonomy.ground_plane import GroundPlane
    from volery.autonomy.obstacle_memory import ObstacleMemory
    from volery.autonomy.scan_points import Pose, ScanProjector
    from volery.graph.zero import zero_message

    origin, level = np.zeros(3), np.array(rotations.IDENTITY)
    pose = Pose(0, origin, level, origin, origin)
    scan = zero_message("sensor_msgs/msg/LaserScan")
    scan.ranges = np.zeros(1, dtype=np.float32)  # may be written, as those of the sensors
    with _quicker():
        Terrain.flat(extent_m=10.0).height([0.0], [0.0])
        points = ScanProjector([0.0, 0.0, 0.0]).points(scan, pose)
        ground = GroundPlane()
        ground.add(points, 0)
        ground.fit(origin, None, 0)
        obstacles = ObstacleMemory()
        obstacles.add(points, 0)
        obstacles.around(origin, 0, 1.0)
        free_distances(np.zeros((0, 2)), 1.0, 1.0)


@contextmanager
def _quicker() -> Iterator[None]:
    """Compile without what repeats itself, and without searching for garbage.

    Compiling makes millions of small objects: a sixth of its time would go into searching.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        with remembered_types():
            yield
    finally:
        if was_on:
            gc.enable()


def compile_sensors() -> None:
    """Look around as contacts do, and let two sensors of the kinds that most UAVs have measure."""
    with _quicker():
        _look_and_measure()


def _look_and_measure() -> None:
    fleet = _fleet()
    scene = Scene(Terrain.flat(extent_m=10.0), None)
    scene.clearance(np.zeros((1, 3)), 1.0, include_terrain=False)
    scene.enclosing(np.zeros((1, 3)))
    scene.set_bodies([body_shape(fleet.airframes[0])], [0, 0])
    sensors = tuple(SensorId(row, f"uav{row + 1}", "sensor") for row in range(2))
    schedule, mounts = Schedule.from_hz(40.0), 2 * (make_mount(amplitude_rad=0.5, period_s=2.0),)
    place, turn = np.zeros((2, 3)), np.tile(rotations.IDENTITY, (2, 1))
    keys = np.zeros(2, dtype=np.uint64)
    for bank in (
        LidarBank(load_lidar(), schedule, sensors, mounts, keys, scene),
        SonarBank(load_sonar_model("downward_sonar"), schedule, sensors, place, turn, keys, scene),
        ImuBank(load_imu_model("adis16448"), schedule, sensors, place, turn, keys),
        GroundTruthBank(schedule, sensors),
        JointBank(sensors, mounts),
    ):
        bank.sample(0, 0, fleet)
    names = tuple(sensor.uav_name for sensor in sensors)
    Collisions(fleet, scene, names, BOUNCE, lambda _event: None).resolve(0)
    scene.close()


def compile_the_rest() -> None:
    """Compile what only some flights need, and what else compiles when it is first used."""
    fleet, scene = _fleet(), Scene(Terrain.flat(extent_m=10.0), None)
    sensors = tuple(SensorId(row, f"uav{row + 1}", "sensor") for row in range(2))
    schedule, mounts = Schedule.from_hz(10.0), 2 * (make_mount(),)
    keys, place = np.zeros(2, dtype=np.uint64), np.zeros((2, 3))
    clouds = LidarBank(load_lidar("vlp_16"), schedule, sensors, mounts, keys, scene)
    PointMaker(clouds.sample(0, 0, fleet)).points(0)
    fleet.set_weather(Weather(particles=Particles(rain_mm_h=1.0)))
    clouds.sample(0, 0, fleet)
    gnss = load_gnss_model("gnss_m8")
    GnssBank(gnss, schedule, sensors, place, keys, LocalFrame(0, 0, 0)).sample(0, 0, fleet)
    compass, level = (
        load_magnetometer_model("magnetometer_px4"),
        np.tile(rotations.IDENTITY, (2, 1)),
    )
    MagnetometerBank(compass, schedule, sensors, level, keys, np.zeros(3)).sample(0, 0, fleet)
    scene.close()
    _compile_estimators()
    _fleet(Kinematic()).advance(0, Terrain.flat(extent_m=10.0).grid)


def _compile_estimators() -> None:
    from volery.control.estimator.estimator import Estimator
    from volery.control.estimator.settings import EstimatorSettings

    still, level = np.zeros((2, 3)), np.tile(rotations.IDENTITY, (2, 1))
    rows, up = np.arange(2), np.tile([0.0, 0.0, 9.8], (2, 1))
    estimator = Estimator(2, EstimatorSettings(), position=still, velocity=still, attitude=level)
    estimator.fuse_pressure_height(rows, 1, np.zeros(2), 1.0)
    estimator.predict(rows, 5_000_000, still, up)
    estimator.covariance(rows)


def _fleet(plant: Plant | None = None) -> Fleet:
    """Two UAVs: views of a single one would have another memory layout, and another kernel."""
    places = [[0.0, 0.0, 1.0], [3.0, 0.0, 1.0]]
    airframes, level = [load_airframe("f450")] * 2, np.tile(rotations.IDENTITY, (2, 1))
    return Fleet(airframes, places, level, plants=plant or RigidBody())


if __name__ == "__main__":
    with compiled_kernels():
        pass
    compile_the_rest()
