"""LIDARs of every pattern against formulas: exact ranges, sweeps, backends, points."""

import numpy as np
import pytest
from plain_scene import PlainScene, plain_echoes
from scanning import DT_NS, LEVEL, echoes_of, flying, solids, standing
from scene_samples import cylinder, drone_shape, small_forest, wall

from volery.core import rotations
from volery.sensors.lidar.lidar import make_batch, sample_echoes, sample_lidars, stack_mounts
from volery.sensors.lidar.lidar_model import load_lidar
from volery.sensors.lidar.point_cloud import POINT, PointMaker
from volery.sensors.mount import make_mount
from volery.sensors.samples import LidarScans, SensorId
from volery.vehicle.pose_history import new_history
from volery.world.scene import Scene
from volery.world.terrain import Terrain

CLOUDS = ["vlp_16", "hdl_32e", "os1_64", "os1_128", "mid_40"]
SENSOR = SensorId(0, "uav1", "top")


def to_plane(direction, x, max_range_m):
    """Distances along unit vectors (3, N) from the origin to the wall at x."""
    with np.errstate(divide="ignore"):
        away = np.where(direction[0] > 0, x / direction[0], np.inf)
    return np.where(away <= max_range_m, away, np.inf)


@pytest.mark.parametrize("name", CLOUDS)
def test_exact_ranges_of_a_plane(name):
    model = load_lidar(name).without_noise()
    scene = solids(wall(12.0, 400.0))
    for sweep in (0, 3):
        ranges = echoes_of(scene, model, number=sweep).ranges[0, 0]
        want = to_plane(model.scan.directions(sweep), 12.0, model.range.max_m)
        inside = want < 100.0
        np.testing.assert_allclose(ranges[inside], want[inside], atol=1e-3)
        assert np.isinf(ranges[np.isinf(want)]).all()
        assert inside.mean() > 0.3
    scene.close()


@pytest.mark.parametrize("name", CLOUDS)
def test_exact_ranges_of_an_upright_cylinder(name):
    model = load_lidar(name).without_noise()
    radius, away = 0.8, 6.0
    scene = solids(cylinder(radius, 20.0, 4000, x=away, z=-10.0))
    ranges = echoes_of(scene, model).ranges[0, 0]
    x, y, _ = model.scan.directions(0)
    level = np.hypot(x, y)
    across = away * y / level  # distance of the axis from the beam, seen from above
    root = radius**2 - across**2
    hit = (root > 1e-3) & (x > 0)
    want = (away * x[hit] / level[hit] - np.sqrt(root[hit])) / level[hit]
    assert hit.sum() > 150
    np.testing.assert_allclose(ranges[hit], want, atol=1e-3)
    assert np.isinf(ranges[(root < -1e-3) | (x < 0)]).all()
    scene.close()


@pytest.mark.parametrize("name", CLOUDS)
def test_every_beam_starts_from_the_pose_it_had(name):
    model = load_lidar(name).without_noise()
    velocity, yaw_rate, start_ns = (4.0, -3.0, 0.5), 1.5, 7_300_000
    scene = solids(wall(15.0, 800.0))
    ranges = echoes_of(scene, model, flying(velocity, yaw_rate), start_ns=start_ns).ranges[0, 0]
    t = (start_ns + model.scan.time_ns) * 1e-9
    x, y, _ = model.scan.directions(0)
    yaw = yaw_rate * t
    towards = x * np.cos(yaw) - y * np.sin(yaw)
    with np.errstate(divide="ignore"):
        want = np.where(towards > 0, (15.0 - velocity[0] * t) / towards, np.inf)
    seen = want < 40.0
    np.testing.assert_allclose(ranges[seen], want[seen], atol=1e-3)
    still = (15.0 - velocity[0] * t[0]) / x[seen]
    assert np.abs(still - want[seen]).max() > 0.3  # the sweep's distortion is far larger
    scene.close()


def test_slow_tables_are_exact_too(tmp_path):
    """Beams milliseconds apart: the pose is looked up for each."""
    from test_scan_patterns import table_model

    azimuth = np.linspace(-60, 60, 40)
    rows = [f"{a},{a / 3},{0.0025 * i:.4f},0" for i, a in enumerate(azimuth)]
    model = table_model(tmp_path, rows).without_noise()
    scene = solids(wall(15.0, 800.0))
    ranges = echoes_of(scene, model, flying((4.0, 0.0, 0.0), 4.0)).ranges[0, 0]
    t = model.scan.time_ns * 1e-9
    x, y, _ = model.scan.directions(0)
    towards = x * np.cos(4.0 * t) - y * np.sin(4.0 * t)
    want = (15.0 - 4.0 * t) / np.where(towards > 0, towards, np.nan)
    seen = want < 45.0
    assert seen.sum() > 20
    np.testing.assert_allclose(ranges[seen], want[seen], atol=1e-3)
    scene.close()


@pytest.mark.parametrize("name", ["vlp_16", "mid_40", "utm_30lx_ew"])
def test_threads_batches_and_the_oracle_agree(name):
    model = load_lidar(name)
    forest, terrain = small_forest(), Terrain.flat(extent_m=20.0)
    positions = np.array([[5.0, 5.0, 2.0], [10.0, 12.0, 3.0], [15.0, 6.0, 1.5]])
    yaw = rotations.from_rpy(np.zeros(3), 0.0, np.arange(3.0))
    history = new_history(positions, yaw, DT_NS)
    mounts = stack_mounts([make_mount(), make_mount([0, 0, 0.1], rotations.from_rpy(0, 0.3, 0))])
    batch = make_batch(np.repeat(np.arange(3), 2), np.tile([0, 1], 3), 0, np.arange(6), 3, mounts)
    results = []
    for threads in (1, 2):
        scene = Scene(terrain, forest, threads=threads)
        scene.set_bodies([drone_shape()], np.zeros(3, int))
        results.append(sample_echoes(scene, model, batch, history, intensities=True))
        alone = sample_lidars(scene, model, batch._replace(**_rows(batch, [4])), history)
        assert alone.tobytes() == results[-1].ranges[4:5, 0].tobytes()
        scene.close()
    for a, b in zip(*results, strict=True):
        assert a.tobytes() == b.tobytes()
    plain = PlainScene(terrain, forest)
    plain.set_bodies([drone_shape()], np.zeros(3, int))
    other = plain_echoes(plain, model, batch, history)
    plain.close()
    for a, b, close in zip(
        other, results[0], (2.5e-3, 0.02 * model.intensity.maximum), strict=True
    ):
        both = np.isfinite(a) & np.isfinite(b)
        assert (np.isfinite(a) == np.isfinite(b)).mean() > 0.999
        assert (np.abs(a[both] - b[both]) < close).mean() > 0.998


def _rows(batch, rows):
    return {
        name: getattr(batch, name)[rows]
        for name in ("uav", "mount", "sweep_start_ns", "key", "scan_number")
    }


def test_a_passing_uav_is_seen_where_it_was():
    """It flies round a turning head at 20 m/s; each column sees it at the column's own time."""
    model = load_lidar("os1_64").without_noise()
    t = np.arange(128) * 1e-3
    position = np.zeros((128, 2, 3))
    position[:, 1] = np.column_stack([np.full(128, 8.0), 20.0 * (t - 0.05), np.zeros(128)])
    history = standing()._replace(position=position, attitude=np.tile([0, 0, 0, 1.0], (128, 2, 1)))
    scene = Scene(None, None)
    scene.set_bodies([drone_shape()], [0, 0])
    ranges = echoes_of(scene, model, history).ranges[0, 0]
    hit = np.isfinite(ranges)
    assert hit.sum() > 10
    points = model.scan.directions(0)[:, hit] * ranges[hit]
    when = model.scan.time_ns[hit] * 1e-9
    assert np.abs(points[1] - 20.0 * (when - 0.05)).max() < 0.45  # half its width
    assert np.abs(points[1] - 20.0 * (when - 0.05)).mean() < 0.25
    scene.close()


def test_a_rosette_wants_scans_of_one_number():
    model = load_lidar("mid_40")
    scene = solids(wall(5.0))
    batch = make_batch([0, 0], 0, 0, 1, [0, 1], LEVEL)
    with pytest.raises(ValueError, match="one scan number"):
        sample_lidars(scene, model, batch, standing())
    scene.close()


# ------------------------------------------------------------------------------------------ points


def scans_of(model, echoes, number=0):
    return LidarScans((SENSOR,), 0, model, number, echoes.ranges, echoes.intensities)


@pytest.mark.parametrize("name", CLOUDS)
def test_points_are_the_echoes(name):
    model = load_lidar(name)
    scene = solids(wall(12.0, 400.0))
    echoes = echoes_of(scene, model, number=5, intensities=True)
    points = PointMaker(scans_of(model, echoes, 5)).points(0)
    scene.close()
    ranges = echoes.ranges[0, 0]
    seen = np.isfinite(ranges)
    assert len(points) == seen.sum()
    xyz = np.stack([points["x"], points["y"], points["z"]])
    want = ranges[seen] * model.scan.directions(5)[:, seen]
    np.testing.assert_allclose(xyz, want, rtol=3e-7, atol=1e-6)
    np.testing.assert_array_equal(points["ring"], model.scan.ring[seen])
    np.testing.assert_array_equal(points["intensity"], echoes.intensities[0, 0][seen])
    np.testing.assert_allclose(points["time"], model.scan.time_ns[seen] * 1e-9, rtol=1e-6)
    # In order of time, but for the firing order within a column.
    assert np.diff(points["time"].astype(float)).min() > -60e-6
    assert points.dtype.itemsize == POINT.itemsize == 22
    assert not points.flags.writeable
