"""Images of small scenes whose depth, shadows and labels are known."""

import numpy as np
import pytest

from volery.core import rotations
from volery.core.workers import Workers
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.lens import undistort
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.airframe import load_airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.pose_history import new_history
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain

NOON = make_light(sun_elevation_deg=90.0)
SMALL = CameraModel(width=64, height=48, far_m=100.0)


def wall(x, y0=-50.0, y1=50.0, z0=0.0, z1=40.0):
    """A rectangle across the x axis."""
    corners = np.array([[x, y0, z0], [x, y1, z0], [x, y1, z1], [x, y0, z1]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Solid(Mesh(corners, triangles), Material.WALL, "wall")


@pytest.fixture
def render():
    """Render an image from `position`, looking along x but for `rpy` (rad)."""
    scenes = []

    def shoot(model, position=(0.0, 0.0, 2.0), rpy=(0, 0, 0), *, solids=(), light=NOON, **options):
        scene = Scene(Terrain.flat(200.0, origin=(-100.0, -100.0)), None, solids=solids)
        scenes.append(scene)
        attitude = rotations.from_rpy(*rpy)
        history = new_history([position], [attitude], 1_000_000)
        batch = make_batch([0], [0], [0], [0], [0], stack_mounts([make_mount()]))
        return take(scene, model, light, batch, history, **options)

    yield shoot
    for scene in scenes:
        scene.close()


def test_depth_of_a_wall_is_its_distance_along_the_axis(render):
    seen = render(SMALL, (0.0, 0.0, 20.0), solids=[wall(12.0)])
    np.testing.assert_allclose(seen.depth[0], 12.0, atol=1e-3)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, (-0.2, 0.05, 0.003, -0.002, 0.01)])
def test_depth_of_the_ground_against_analytic_rays(render, distortion):
    """Each pixel's depth puts its point on the ground, within a millimetre."""
    model = CameraModel(width=80, height=60, distortion=distortion)
    pitch = np.radians(35.0)
    turn = rotations.from_rpy(0.0, pitch, 0.4)
    seen = render(model, (3.0, -2.0, 6.0), (0.0, pitch, 0.4))
    v, u = np.mgrid[0:60, 0:80]
    depth = seen.depth[0].astype(np.float64)
    ideal = undistort((np.stack([u, v], -1) - model.centre_px) / model.focal_px, distortion)
    optical = np.dstack([ideal * depth[..., None], depth])
    body = np.stack([optical[..., 2], -optical[..., 0], -optical[..., 1]], -1)
    points = np.add(rotations.rotate(turn, body), [3.0, -2.0, 6.0])
    np.testing.assert_allclose(points[..., 2], 0.0, atol=1e-3)


def test_where_objects_stand_they_are_seen(render):
    """A post right of the axis is right in the image, at the column of the model's formula."""
    post = wall(10.0, y0=-3.1, y1=-2.9)
    seen = render(SMALL, (0.0, 0.0, 10.0), solids=[post])
    columns = np.flatnonzero(seen.material[0][24] == Material.WALL)
    wanted = SMALL.project([3.0, 0.0, 10.0])[0]
    assert abs(columns.mean() - wanted) <= 0.5
    assert (seen.instance[0][24, columns] == 1).all()
    sky = seen.material[0] == Material.NONE
    assert np.isinf(seen.depth[0][sky]).all()
    assert (seen.instance[0][sky] == -1).all()


def test_too_near_and_too_far(render):
    near = CameraModel(width=16, height=16, near_m=3.0, far_m=20.0)
    assert (render(near, (0, 0, 20.0), solids=[wall(2.0)]).depth == -np.inf).all()
    beyond = render(near, (0.0, 0.0, 20.0), solids=[wall(20.1)])
    assert (beyond.depth == np.inf).all()
    assert (beyond.instance == -1).all()
    at_the_end = render(near, (0.0, 0.0, 20.0), solids=[wall(19.9)])
    np.testing.assert_allclose(at_the_end.depth, 19.9, atol=1e-3)  # in the corners too


def test_shadows_fall_away_from_the_sun(render):
    """A wall between sun and ground darkens the ground behind it, and only there."""
    down = CameraModel(width=40, height=40, horizontal_fov_deg=40.0)
    low = make_light(sun_elevation_deg=45.0, sun_azimuth_deg=90.0)  # in the east: +x
    blind = wall(5.0, z0=0.0, z1=4.0)  # its shadow reaches from x = 5 to x = 1
    plain = render(down, (0.0, 0.0, 20.0), (0, np.pi / 2, 0), light=low).colour[0].astype(float)
    dark = render(down, (0.0, 0.0, 20.0), (0, np.pi / 2, 0), light=low, solids=[blind])
    ratio = dark.colour[0].astype(float).sum(-1) / plain.sum(-1)
    ahead = 20.0 * -(np.arange(40) - 19.5) / down.focal_px  # rows are x, ahead is up
    shaded, lit = (ahead > 1.3) & (ahead < 4.7), (ahead < 0.7)
    assert ratio[shaded].max() < 0.85
    np.testing.assert_array_equal(ratio[lit], 1.0)


@pytest.mark.parametrize(
    ("elevation_deg", "length_m"), [(30.0, 10.0 / np.tan(np.pi / 6)), (50.0, 0)]
)
def test_a_ridge_throws_a_shadow_unless_the_sun_is_above_its_slope(elevation_deg, length_m):
    """A ridge of 10 m with slopes of 45 degrees; the sun is in the east, +x."""
    heights = np.zeros((13, 13))
    heights[:, 6] = 10.0
    scene = Scene(Terrain.from_heights(heights, 10.0, origin=(-60.0, -60.0)), None)
    down = CameraModel(width=81, height=41, horizontal_fov_deg=50.0)
    history = new_history([(-20.0, 0.0, 30.0)], [rotations.from_rpy(0, np.pi / 2, 0)], 1_000_000)
    batch = make_batch([0], [0], [0], [0], [0], stack_mounts([make_mount()]))
    light = make_light(sun_elevation_deg=elevation_deg, sun_azimuth_deg=90.0)
    seen = take(scene, down, light, batch, history)
    scene.close()
    # the image's top shows what lies ahead of the UAV's belly: +x
    up = -(np.arange(41) - down.centre_px[1]) / down.focal_px
    x = -20.0 + up[:, None] * seen.depth[0]
    level = x < -10.5
    brightness = seen.colour[0].astype(float).sum(axis=-1)
    dark = level & (x > -length_m + 0.5)
    bright = level & (x < -length_m - 0.5)
    assert bright.any()
    if length_m:
        assert dark.any()
        assert brightness[dark].max() < brightness[bright].min()
    else:
        assert brightness[level].min() > 0.6 * brightness[level].max()


def test_night_is_dark_and_fog_hides(render):
    day = render(SMALL, solids=[wall(30.0)]).colour.mean()
    night = make_light(sun_elevation_deg=-20.0)
    assert render(SMALL, solids=[wall(30.0)], light=night).colour.mean() < 0.5 * day
    fog = make_light(visibility_m=30.0)
    rows = slice(10, 20)
    clear = render(SMALL, solids=[wall(30.0)]).colour[0][rows].astype(float)
    misty = render(SMALL, solids=[wall(30.0)], light=fog).colour[0][rows].astype(float)
    horizon = 255.0 * (1.055 * fog.horizon ** (1 / 2.4) - 0.055)
    assert np.abs(misty - horizon).mean() < 0.3 * np.abs(clear - horizon).mean()


@pytest.mark.parametrize("size", [(1, 1), (3, 5), (17, 2), (64, 48)])
@pytest.mark.parametrize("samples", [1, 4])
def test_any_size_is_filled(render, size, samples):
    model = CameraModel(width=size[0], height=size[1], samples=samples)
    seen = render(model, (0.0, 0.0, 20.0), solids=[wall(12.0)])
    assert seen.colour.shape == (1, size[1], size[0], 3)
    np.testing.assert_allclose(seen.depth, 12.0, atol=1e-2)
    assert (seen.material == Material.WALL).all()
    assert (seen.colour > 0).all()


def test_more_samples_smooth_an_edge(render):
    """Four samples are nearer to the mean of an eight times finer image than one."""

    def shot(size, samples):
        model = CameraModel(width=size, height=size, samples=samples)
        seen = render(model, (0, 0, 20.0), (0.3, 0, 0), solids=[wall(10.0, y1=0.0)])
        return seen.colour[0].astype(float)

    fine = shot(512, 4).reshape(64, 8, 64, 8, 3).mean((1, 3))
    off = {samples: np.abs(shot(64, samples) - fine).mean() for samples in (1, 4)}
    assert off[4] < 0.6 * off[1]


def test_only_what_is_wanted_is_made(render):
    seen = render(SMALL, parts=("depth",))
    assert seen.colour is None
    assert seen.material is None
    assert seen.depth is not None


def test_threads_change_nothing(render):
    workers = Workers(3)
    model = CameraModel(width=320, height=240, samples=4)
    one = render(model, solids=[wall(8.0, y1=2.0)])
    three = render(model, solids=[wall(8.0, y1=2.0)], workers=workers)
    workers.close()
    for a, b in zip(one, three, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.fixture
def two():
    """A camera at the origin and another UAV 3 m ahead of it."""
    scene = Scene(Terrain.flat(200.0, origin=(-100.0, -100.0)), None)
    scene.set_bodies([body_shape(load_airframe("f450"))], [0, 0])
    yield scene
    scene.close()


def shoot(scene, history, model, time_ns=0):
    batch = make_batch([0], [0], [time_ns], [0], [0], stack_mounts([make_mount()]))
    return take(scene, model, NOON, batch, history)


def test_others_are_seen_and_oneself_is_not(two):
    level = np.tile(rotations.IDENTITY, (2, 1))
    history = new_history([[0.0, 0.0, 5.0], [3.0, 0.0, 5.0]], level, 1_000_000)
    seen = shoot(two, history, CameraModel(width=160, height=120))
    assert (seen.instance[0] == two.moving_offset + 1).sum() > 20
    assert not (seen.instance[0] == two.moving_offset).any()
    body = seen.depth[0][seen.instance[0] == two.moving_offset + 1]
    assert 2.4 < body.min() < 3.0


def test_a_rolling_shutter_leans(two):
    """What passes by while rows are exposed one after the other is seen slanting."""
    model = CameraModel(width=160, height=160, horizontal_fov_deg=40.0, readout_s=0.06)
    level = np.tile(rotations.IDENTITY, (2, 1))
    history = new_history([[0.0, 0.0, 5.0], [3.0, 0.0, 5.0]], level, 1_000_000)
    for step in range(64):
        history.position[step, 1] = [3.0, 0.5 - step / 64, 5.0]
    seen = shoot(two, history, model).instance[0] == two.moving_offset + 1
    rows = np.flatnonzero(seen.any(axis=1))
    middles = [np.flatnonzero(seen[row]).mean() for row in (rows[0], rows[-1])]
    global_shutter = shoot(two, history, model.model_copy(update={"readout_s": 0.0}), 30_000_000)
    still = global_shutter.instance[0] == two.moving_offset + 1
    rows = np.flatnonzero(still.any(axis=1))
    upright = [np.flatnonzero(still[row]).mean() for row in (rows[0], rows[-1])]
    assert middles[1] - middles[0] > 4.0 + abs(upright[1] - upright[0])


def test_noise_has_the_stated_size(render):
    numbers = {"read_noise": 0.01, "shot_noise": 0.04, "depth_noise_per_m": 0.002}
    exact = CameraModel(width=128, height=128, horizontal_fov_deg=5.0)
    noisy = exact.model_copy(update=numbers)
    scene = {"position": (0.0, 0.0, 20.0), "solids": [wall(10.0)]}
    sound, seen = render(exact, **scene), render(noisy, **scene)
    off = seen.depth - sound.depth
    assert off.std() == pytest.approx(0.002 * 10.0**2, rel=0.03)
    assert abs(off.mean()) < 0.01
    coded = np.arange(256) / 255.0
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    light = linear[sound.colour]
    off = linear[seen.colour] - light
    wanted = np.sqrt(0.01**2 + 0.04**2 * light.mean())
    assert off.std() == pytest.approx(wanted, rel=0.05)
    assert abs(off.mean()) < 0.1 * wanted


def test_a_changed_model_has_rays_of_its_own():
    model = CameraModel(width=16, height=8)
    assert model.table.after_ns.max() == 0
    assert model.ideal.shape == (8, 16, 2)
    other = model.model_copy(update={"width": 32, "readout_s": 0.01})
    assert other.table.after_ns.max() > 0
    assert other.ideal.shape == (8, 32, 2)


def test_noisy_depth_is_a_depth(render):
    """1/z = .0125 at 80 m with .004 of noise: never negative, too far where little is left."""
    model = CameraModel(width=128, height=128, horizontal_fov_deg=5.0, depth_noise_per_m=0.004)
    depth = render(model, (0.0, 0.0, 20.0), solids=[wall(80.0)]).depth[0]
    assert depth.min() > 25.0
    assert (depth[np.isfinite(depth)] <= model.far_m).all()
    lost = np.mean(depth == np.inf)  # 1/z below 1/200: 1.875 standard deviations
    assert lost == pytest.approx(0.0304, abs=0.006)
    assert np.median(1.0 / depth) == pytest.approx(1.0 / 80.0, rel=0.01)


def test_the_shipped_camera_loads():
    assert CameraModel.load("pinhole").without_noise() == CameraModel(name="pinhole camera")


@pytest.mark.parametrize(("name", "far_m"), [("f450_front", 1300.0), ("f450_down", 100.0)])
def test_the_cameras_of_the_f450_load(name, far_m):
    """The edge of an image with a field of view of 1 rad is half a radian off the axis."""
    model = CameraModel.load(name)
    assert (model.width, model.height, model.far_m) == (640, 480, far_m)
    edge = model.project([np.tan(0.5), 0.0, 1.0])
    np.testing.assert_allclose(edge, [639.5, 239.5], atol=1e-9)


def test_a_uav_out_of_sight_throws_its_shadow_into_the_image(two):
    """From 20 m up the image is 23 m wide; the sun is 45 degrees high in the east."""
    down = rotations.from_rpy(0.0, np.pi / 2, 0.0)
    light = make_light(sun_elevation_deg=45.0, sun_azimuth_deg=90.0)
    model = CameraModel(width=320, height=320)

    def colour(other):
        history = new_history([[0.0, 0.0, 20.0], other], [down, rotations.IDENTITY], 1_000_000)
        batch = make_batch([0], [0], [0], [0], [0], stack_mounts([make_mount()]))
        seen = take(two, model, light, batch, history)
        assert not (seen.instance == two.moving_offset + 1).any()
        return seen.colour[0].astype(int)

    # 16 m up and 16 m to the east: its shadow falls on the middle, itself is beyond the edge.
    changed = np.abs(colour([16.0, 0.0, 16.0]) - colour([80.0, 0.0, 1.0])).sum(axis=-1) > 0
    rows, columns = np.nonzero(changed)
    assert len(rows) >= 3
    assert abs(rows.mean() - 159.5) < 8
    assert abs(columns.mean() - 159.5) < 8
