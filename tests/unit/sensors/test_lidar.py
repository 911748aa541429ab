"""The LIDAR against formulas: where its beams go, what they measure, how its noise is spread."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from plain_scene import PlainScene, plain_echoes

sys.path.insert(0, str(Path(__file__).parent.parent / "world"))
from scene_samples import cylinder, drone_shape, small_forest, wall

from volery.core import rotations
from volery.core.errors import DataFileError
from volery.core.rng import stream_key
from volery.sensors.lidar.lidar import make_batch, sample_echoes, sample_lidars, stack_mounts
from volery.sensors.lidar.lidar_model import load_lidar
from volery.sensors.mount import make_mount, nodding_angle_at
from volery.vehicle.pose_history import PoseHistory, new_history
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain

DT_NS = 1_000_000
LEVEL = stack_mounts([make_mount()])
MODEL = load_lidar()
EXACT = MODEL.without_noise()
NO_SPREAD = {"floor_m": 1e-9, "slope": 0.0, "offset_m": 0.0}


def standing(position=(0.0, 0.0, 0.0), yaw=0.0):
    return new_history([position], [rotations.from_rpy(0.0, 0.0, yaw)], DT_NS)


def flying(velocity, yaw_rate, length=64):
    t = np.arange(length) * DT_NS * 1e-9
    position = t[:, None, None] * np.asarray(velocity, dtype=float)
    attitude = rotations.from_rpy(0.0, 0.0, yaw_rate * t)[:, None, :]
    return PoseHistory(position, attitude, DT_NS)


def scan(scene, model=EXACT, history=None, mounts=LEVEL, start_ns=0, number=0, key=1, uav=0):
    batch = make_batch(uav, 0, start_ns, key, number, mounts)
    return sample_lidars(scene, model, batch, history or standing())


def one_solid(mesh, **options):
    return Scene(None, None, solids=[Solid(mesh, Material.WALL, "wall")], **options)


def test_the_model_is_the_utm_30lx():
    assert MODEL.beams == 1081
    assert MODEL.scan.angle_increment_rad == pytest.approx(np.radians(0.25))
    assert MODEL.scan.time_increment_s == pytest.approx(1.7361e-5, rel=1e-4)
    assert MODEL.sweep_duration_ns == 18_750_000
    assert (MODEL.range.min_m, MODEL.range.max_m) == (0.1, 30.0)
    np.testing.assert_allclose(
        np.degrees(MODEL.scan.angles[[0, 540, -1]]), [-135, 0, 135], atol=1e-9
    )


def test_exact_ranges_of_a_cylinder_and_a_plane():
    sides = 2000
    cylinder_radius, away = 0.5, 6.0
    scene = Scene(
        None,
        None,
        solids=[
            Solid(wall(12.0), Material.WALL, "wall"),
            Solid(cylinder(cylinder_radius, 4.0, sides, x=away, z=-2.0), Material.WOOD, "trunk"),
        ],
    )
    ranges = scan(scene)[0]
    a = EXACT.scan.angles
    root = cylinder_radius**2 - (away * np.sin(a)) ** 2
    trunk = (root > 0) & (np.abs(a) < 1)
    ahead = np.abs(a) < np.arccos(12.0 / 30.0) - 1e-6
    want = np.where(ahead, 12.0 / np.cos(np.where(ahead, a, 0.0)), np.inf)
    want[trunk] = away * np.cos(a[trunk]) - np.sqrt(root[trunk])
    clear = np.abs(root) > 1e-3  # not at the very rim
    both = clear & np.isfinite(want)
    np.testing.assert_array_equal(np.isfinite(ranges)[clear], np.isfinite(want)[clear])
    np.testing.assert_allclose(ranges[both], want[both], atol=1e-3)
    scene.close()


@pytest.mark.parametrize(("velocity", "yaw_rate"), [((5.0, 0, 0), 0.0), ((3.0, -4.0, 0), 2.5)])
def test_every_beam_starts_from_the_pose_it_had(velocity, yaw_rate):
    scene = one_solid(wall(15.0))
    start_ns = 7_300_000
    position = np.array([0.2, -0.1, 0.3])
    mounts = stack_mounts([make_mount(position, rotations.from_rpy(0.0, 0.0, 0.4))])
    ranges = scan(scene, history=flying(velocity, yaw_rate), mounts=mounts, start_ns=start_ns)[0]
    t = start_ns * 1e-9 + np.arange(EXACT.beams) * EXACT.scan.time_increment_s
    yaw = yaw_rate * t
    x = velocity[0] * t + position[0] * np.cos(yaw) - position[1] * np.sin(yaw)
    towards = np.cos(EXACT.scan.angles + yaw + 0.4)
    with np.errstate(divide="ignore"):
        want = np.where(towards > 0, (15.0 - x) / towards, np.inf)
    seen = want < 29.9
    np.testing.assert_allclose(ranges[seen], want[seen], atol=1e-3)
    assert np.isinf(ranges[want > 30.1]).all()
    # Without the distortion the error would be far larger than that.
    still = (15.0 - x[0]) / np.cos(EXACT.scan.angles + yaw[0] + 0.4)
    assert np.abs(still - want)[seen].max() > 0.05
    scene.close()


def test_a_nodding_mount_sees_the_ground_where_it_looks():
    scene = Scene(Terrain.flat(extent_m=400.0), None)
    mount = make_mount([0.0, 0.0, -0.1], amplitude_rad=0.65, period_s=2.0, offset_rad=0.25)
    for start_ns in (0, 400_000_000, 1_700_000_000):
        steps = np.arange(start_ns // DT_NS, start_ns // DT_NS + 64) % 64
        history = standing([200.0, 200.0, 2.0])
        assert len(set(steps.tolist())) == 64
        ranges = scan(scene, history=history, mounts=stack_mounts([mount]), start_ns=start_ns)[0]
        t = start_ns * 1e-9 + np.arange(EXACT.beams) * EXACT.scan.time_increment_s
        angle = 0.25 + 0.65 * np.sin(np.pi * t)
        down = np.cos(EXACT.scan.angles) * np.sin(angle)
        with np.errstate(divide="ignore"):
            want = np.where(down > 0, 1.9 / down, np.inf)
        seen = want < 29.5
        np.testing.assert_allclose(ranges[seen], want[seen], atol=2e-3)
        assert not np.isfinite(ranges[want > 31.0]).any()
        assert nodding_angle_at(mount, start_ns) == pytest.approx(angle[0])
    scene.close()


def test_too_near_is_minus_infinity_and_nothing_is_infinity():
    scene = one_solid(wall(0.05))
    ranges = scan(scene)[0]
    near = np.cos(EXACT.scan.angles) > 0.55
    assert np.isneginf(ranges[near]).all()
    assert np.isposinf(ranges[np.cos(EXACT.scan.angles) < 0]).all()
    scene.close()


def test_two_uavs_see_each_other_and_never_themselves():
    history = new_history([[0, 0, 5.0], [6, 0, 5.0]], [[0, 0, 0, 1.0], [0, 0, 1.0, 0]], DT_NS)
    for scene in (Scene(None, None), PlainScene(None, None)):
        scene.set_bodies([drone_shape()], [0, 0])
        batch = make_batch([0, 1], 0, 0, [1, 2], 0, LEVEL)
        plain = isinstance(scene, PlainScene)
        sample = plain_echoes if plain else sample_echoes
        for row in sample(scene, EXACT, batch, history).ranges[:, 0]:
            assert row[540] == pytest.approx(5.9, abs=2e-3)
            hit = np.isfinite(row)
            assert 3 <= hit.sum() < 40
            assert row[hit].min() > 5.0
        scene.close()


def test_a_passing_uav_is_seen_where_it_was():
    speed = 20.0
    t = np.arange(64) * 1e-3
    position = np.zeros((64, 2, 3))
    position[:, 1] = np.column_stack([np.full(64, 8.0), -speed * t, np.zeros(64)])
    history = PoseHistory(position, np.tile([0, 0, 0, 1.0], (64, 2, 1)), DT_NS)
    scene = Scene(None, None)
    scene.set_bodies([drone_shape()], [0, 0])
    row = scan(scene, history=history)[0]
    middle = np.flatnonzero(np.isfinite(row)).mean()
    i = np.arange(EXACT.beams)
    bearing = np.arctan2(-speed * i * EXACT.scan.time_increment_s, 8.0)
    expected = i[np.argmin(np.abs(bearing - EXACT.scan.angles))]
    assert abs(middle - expected) < 1.0
    assert expected < 538  # it is not seen where it was when the sweep began
    scene.close()


def test_noise_has_the_spread_of_the_formula_and_whole_millimetres():
    model = MODEL.changed(dropout={"far": 0.0, "grazing": 0.0})
    for distance in (2.0, 28.0):
        scene = one_solid(cylinder(distance, 4.0, 4001, z=-2.0))
        truth = scan(scene)[0].astype(float)
        batch = make_batch(np.zeros(60, int), 0, 0, 5, np.arange(60), LEVEL)
        ranges = sample_lidars(scene, model, batch, standing()).astype(float)
        error = (ranges - truth)[np.isfinite(ranges)]
        sigma = max(0.018, 0.0006 * distance + 0.0015)
        assert error.size == 60 * 1081
        assert abs(error.mean()) < 4.0 * sigma / np.sqrt(error.size)
        assert error.std() == pytest.approx(sigma, rel=0.02)
        np.testing.assert_allclose(ranges * 1000, np.round(ranges * 1000), atol=3e-3)
        assert np.abs(error).max() > 3.5 * sigma  # the tails are there
        scene.close()


def test_dropouts_follow_range_and_incidence():
    scene = one_solid(wall(10.0))
    batch = make_batch(np.zeros(400, int), 0, 0, 9, np.arange(400), LEVEL)
    ranges = sample_lidars(scene, MODEL, batch, standing())
    truth = scan(scene)[0].astype(float)
    for low, high in ((0.0, 20.0), (40.0, 50.0), (60.0, 68.0)):
        angle = np.degrees(np.abs(EXACT.scan.angles))
        beams = (angle >= low) & (angle < high)
        grazing = 1.0 - np.cos(EXACT.scan.angles[beams])
        keep = (1 - MODEL.dropout.far * (truth[beams] / 30.0) ** 2) * (
            1 - MODEL.dropout.grazing * grazing**4
        )
        lost = np.isposinf(ranges[:, beams]).mean()
        assert lost == pytest.approx(1.0 - keep.mean(), abs=0.004)
    scene.close()


def _step(near, far):
    """A near screen on the left half, a wall behind it."""
    screen = [[near, 0.0, -5], [near, 50, -5], [near, 50, 5], [near, 0.0, 5]]
    return (
        Solid(Mesh(np.array(screen), np.array([[0, 1, 2], [0, 2, 3]])), Material.WALL, "screen"),
        Solid(wall(far), Material.WALL, "wall"),
    )


def test_mixed_pixels_lie_between_near_and_far_as_often_as_the_footprint_is_wide():
    model = MODEL.changed(noise=NO_SPREAD)
    model = model.changed(dropout={"far": 0.0, "grazing": 0.0})
    scene = Scene(None, None, solids=_step(5.0, 6.0))
    scans = 4000
    batch = make_batch(np.zeros(scans, int), 0, 0, 3, np.arange(scans), LEVEL)
    ranges = sample_lidars(scene, model, batch, standing(yaw=np.radians(0.125)))
    truth = scan(scene, history=standing(yaw=np.radians(0.125)))[0]
    edge = int(np.flatnonzero(np.diff(truth[500:580]) < -0.5)[0]) + 500
    pair = ranges[:, edge : edge + 2]
    mixed = (pair > 5.001 * 1.0001) & (pair < 5.999)
    footprint = MODEL.mixed_pixels.divergence_rad / MODEL.scan.angle_increment_rad
    assert mixed.sum() / scans == pytest.approx(footprint, abs=0.03)
    # The far beam is mixed with shares up to a half, uniformly: it ends in the upper half.
    far = ranges[:, edge][mixed[:, 0]]
    assert far.min() >= 5.49
    assert far.mean() == pytest.approx(5.75, abs=0.02)
    others = np.delete(ranges, [edge, edge + 1], axis=1)[:, 380:700]
    assert np.abs(others - np.delete(truth, [edge, edge + 1])[380:700]).max() < 2e-3
    scene.close()


def test_echoes_farther_apart_than_a_pulse_do_not_mix():
    model = MODEL.changed(noise=NO_SPREAD)
    scene = Scene(None, None, solids=_step(5.0, 9.0))
    batch = make_batch(np.zeros(500, int), 0, 0, 3, np.arange(500), LEVEL)
    ranges = sample_lidars(scene, model, batch, standing(yaw=np.radians(0.125)))[:, 520:560]
    assert not ((ranges > 5.2) & (ranges < 8.9)).any()
    scene.close()


def test_scans_do_not_depend_on_threads_or_batch():
    forest, terrain = small_forest(), Terrain.flat(extent_m=20.0)
    rng = np.random.default_rng(0)
    positions = np.column_stack([rng.uniform(2, 18, (6, 2)), rng.uniform(1.5, 4, 6)])
    history = new_history(positions, np.tile([0, 0, 0, 1.0], (6, 1)), DT_NS)
    mounts = stack_mounts([make_mount(), make_mount(amplitude_rad=0.6, period_s=2.0)])
    uav, mount = np.repeat(np.arange(6), 2), np.tile([0, 1], 6)
    key = [int(stream_key(7, f"uav{u}/{m}")) for u, m in zip(uav, mount, strict=True)]
    results = []
    for threads in (1, 2):
        scene = Scene(terrain, forest, threads=threads)
        scene.set_bodies([drone_shape()], np.zeros(6, int))
        batch = make_batch(uav, mount, 0, np.array(key, dtype=np.uint64), 3, mounts)
        results.append(sample_lidars(scene, MODEL, batch, history))
        for rows in ([4], [7, 2]):
            part = batch._replace(
                uav=batch.uav[rows],
                mount=batch.mount[rows],
                sweep_start_ns=batch.sweep_start_ns[rows],
                key=batch.key[rows],
                scan_number=batch.scan_number[rows],
            )
            alone = sample_lidars(scene, MODEL, part, history)
            assert alone.tobytes() == results[-1][rows].tobytes()
        scene.close()
    assert results[0].tobytes() == results[1].tobytes()
    plain = PlainScene(terrain, forest)
    plain.set_bodies([drone_shape()], np.zeros(6, int))
    other = plain_echoes(plain, MODEL, batch, history).ranges[:, 0]
    both = np.isfinite(other) & np.isfinite(results[0])
    assert (np.isfinite(other) == np.isfinite(results[0])).mean() > 0.999
    assert (np.abs(other[both] - results[0][both]) < 1.5e-3).mean() > 0.999
    plain.close()


def test_noise_differs_between_scans_and_streams():
    scene = one_solid(cylinder(5.0, 4.0, 400, z=-2.0))
    first, again = scan(scene, MODEL, number=4), scan(scene, MODEL, number=4)
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != scan(scene, MODEL, number=5).tobytes()
    assert first.tobytes() != scan(scene, MODEL, number=4, key=2).tobytes()
    scene.close()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("beams = 1081", "beams = 1", "scan.beams': a number of at least 2 is needed"),
        ("beams = 1081", "beems = 1081", "unknown key 'scan.beems'; did you mean 'beams'"),
        ("max_m = 30.0", "max_m = nan", "range.max_m': a finite number is needed"),
        ("max_m = 30.0", "", "'range.max_m' is missing"),
        ("max_m = 30.0", "max_m = 0.01", "min_m must be below max_m"),
        ("rate_hz = 40.0", 'rate_hz = "fast"', "scan.rate_hz': a number is needed"),
        ("rate_hz = 40.0", "rate_hz = 400.0", "fit in one turn"),
        ("[scan]", "[scan", "not valid TOML"),
    ],
)
def test_a_broken_model_file_is_refused(tmp_path, old, new, message):
    import volery.sensors

    text = (Path(volery.sensors.__file__).parent / "models/utm_30lx.toml").read_text()
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(DataFileError, match=message):
        load_lidar(path)


def test_a_missing_model_is_named():
    with pytest.raises(DataFileError, match="no_such"):
        load_lidar("no_such")


def test_bad_mounts_are_refused():
    with pytest.raises(ValueError, match="finite"):
        make_mount([0, 0, np.nan])
    with pytest.raises(ValueError, match="quaternion"):
        make_mount([0, 0, 0], [0, 0, 0, 0])
    with pytest.raises(ValueError, match="period_s"):
        make_mount(period_s=-1.0)
