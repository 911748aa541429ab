"""Rays, occlusion and clearance against known geometry, brute force and embreex's own call."""

from __future__ import annotations

import re
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from plain_scene import PlainScene
from scene_samples import cylinder, drone_shape, small_forest, unit, wall

from volery.core import rotations
from volery.world import embree, embree_backend
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain


def small_world(scene_class=Scene, **options):
    return scene_class(
        Terrain.flat(extent_m=20.0),
        small_forest(),
        solids=[Solid(cylinder(1.0, 3.0, 48, x=10.0, y=10.0), Material.WALL, "pillar")],
        **options,
    )


@pytest.fixture(scope="module")
def scenes():
    both = small_world(), small_world(PlainScene)
    rng = np.random.default_rng(5)
    position = rng.uniform([3, 3, 1], [17, 17, 4], (9, 3))
    attitude = unit(rng.normal(size=(9, 4)))
    turned = rotations.multiply(attitude, rotations.exponential([0.0, 0.1, 0.2]))
    for scene in both:
        scene.set_bodies([drone_shape()], np.zeros(9, dtype=int))
        scene.move_bodies(position, attitude, position + 0.3, turned)
    yield (*both, position)
    for scene in both:
        scene.close()


def some_rays(position, count=6000, seed=1):
    rng = np.random.default_rng(seed)
    origins = rng.uniform([0, 0, 0.5], [20, 20, 6], (count, 3))
    directions = unit(rng.normal(size=(count, 3)))
    half = count // 2  # half of them roughly at the bodies
    aim = position[rng.integers(0, len(position), half)] + rng.normal(size=(half, 3)) * 0.15
    directions[:half] = unit(aim - origins[:half])
    return origins, directions, rng.integers(-1, len(position), count)


@pytest.mark.parametrize("fraction", [0.0, 0.35, 1.0])
def test_both_backends_agree(scenes, fraction):
    main, plain, position = scenes
    o, d, exclude = some_rays(position)
    a, b = (s.cast(o, d, 15.0, exclude, fraction=fraction) for s in (main, plain))
    assert (a.instance == b.instance).mean() > 0.9995  # rays through an edge may go either way
    same = a.instance == b.instance
    hit = same & (a.instance >= 0)
    assert 0.2 < hit.mean() < 0.9
    assert {0, 1, main.moving_offset - 1, main.moving_offset} <= set(a.instance[hit].tolist())
    np.testing.assert_allclose(a.distance[hit], b.distance[hit], atol=1e-4, rtol=0)
    np.testing.assert_array_equal(a.material[same], b.material[same])
    np.testing.assert_allclose(a.normal[hit], b.normal[hit], atol=1e-3)
    assert (np.einsum("ij,ij->i", a.normal[hit], d[hit]) <= 1e-6).all()
    assert np.isinf(a.distance[a.instance < 0]).all()


def test_both_backends_agree_on_occlusion_and_clearance(scenes):
    main, plain, position = scenes
    o, d, exclude = some_rays(position, seed=2)
    targets = o + d * np.random.default_rng(0).uniform(0.0, 12.0, (len(o), 1))
    a, b = (s.occluded(o, targets, exclude) for s in (main, plain))
    assert (a == b).mean() > 0.9995
    assert 0.1 < a.mean() < 0.9
    for terrain in (True, False):
        near, other = (s.clearance(o[:500], 3.0, terrain) for s in (main, plain))
        np.testing.assert_allclose(near.distance, other.distance, atol=1e-6)
        assert (near.instance == other.instance).mean() > 0.99


def test_occlusion_means_that_the_cast_ends_before_the_target(scenes):
    main, _, position = scenes
    o, d, exclude = some_rays(position, seed=3)
    length = np.random.default_rng(1).uniform(0.1, 12.0, len(o))
    hidden = main.occluded(o, o + d * length[:, None], exclude)
    distance = main.cast(o, d, 20.0, exclude).distance
    clear_cut = np.abs(distance - length) > 1e-3
    np.testing.assert_array_equal(hidden[clear_cut], (distance < length)[clear_cut])


def test_clearance_is_exact_against_every_triangle(scenes):
    main, plain, _ = scenes
    points = np.random.default_rng(9).uniform([-2, -2, -1], [22, 22, 9], (400, 3))
    for radius in (0.5, 4.0, np.inf):
        found = main.clearance(points, radius)
        true = np.empty(400), np.empty((400, 3)), np.empty(400, np.int32)
        plain.backend.clearance(points, radius, True, true)
        np.testing.assert_allclose(found.distance, true[0], atol=1e-9)
        np.testing.assert_allclose(found.nearest, true[1], atol=1e-6)
        seen = found.instance >= 0
        gap = np.linalg.norm(found.nearest - points, axis=1)
        np.testing.assert_allclose(gap[seen], found.distance[seen], atol=1e-9)
        np.testing.assert_array_equal(found.distance[~seen], radius)


def test_clearance_to_a_cylinder_and_to_the_ground_by_formula():
    sides = 720
    pillar = Solid(cylinder(0.5, 4.0, sides), Material.WOOD, "pillar")
    scene = Scene(Terrain.flat(extent_m=40.0, height_m=-1.0), None, solids=[pillar])
    points = np.array([[2.0, 0.0, 2.0], [0.0, -3.0, 1.0], [10.0, 10.0, 0.5]])
    found = scene.clearance(points, 5.0, include_terrain=False)
    np.testing.assert_allclose(
        found.distance, [1.5, 2.5, 5.0], atol=0.5 * (1 - np.cos(np.pi / sides))
    )
    np.testing.assert_array_equal(found.instance, [1, 1, -1])
    assert scene.instance_name(1) == "pillar"
    ground = scene.clearance(points[2:], 5.0)
    assert ground.distance[0] == pytest.approx(1.5)
    assert ground.instance[0] == 0
    scene.close()


def test_rays_meet_planes_and_cylinders_where_geometry_says():
    sides = 720
    solids = [
        Solid(wall(10.0), Material.WALL, "wall"),
        Solid(cylinder(1.0, 6.0, sides, x=5.0, z=-3.0), Material.WOOD, "trunk"),
    ]
    scene = Scene(None, None, solids=solids)
    angle = np.radians(np.linspace(-60, 60, 241))
    d = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    hits = scene.cast(np.zeros_like(d), d, 100.0)
    inside = 1.0 - 25.0 * np.sin(angle) ** 2
    trunk = inside > 0.01
    want = np.where(trunk, 5 * np.cos(angle) - np.sqrt(np.abs(inside)), 10.0 / np.cos(angle))
    clear = np.abs(inside) > 0.01
    np.testing.assert_allclose(hits.distance[clear], want[clear], atol=1e-4)
    np.testing.assert_array_equal(hits.instance[clear], np.where(trunk, 2, 1)[clear])
    np.testing.assert_allclose(hits.normal[~trunk & clear], [[-1, 0, 0]] * (~trunk & clear).sum())
    shorter = scene.cast(np.zeros_like(d), d, 8.0)
    assert (shorter.instance[clear & ~trunk] == -1).all()
    scene.close()


def test_no_ray_slips_through_the_ground_at_its_grid_points():
    terrain = Terrain.flat(extent_m=100.0)
    scene = Scene(terrain, None)
    x, y = np.meshgrid(np.arange(0.0, 100.1, 2.5), np.arange(0.0, 100.1, 2.5))
    o = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 3.0)])
    hits = scene.cast(o, np.tile([0.0, 0.0, -1.0], (len(o), 1)), 10.0)
    np.testing.assert_allclose(hits.distance, 3.0, atol=1e-5)
    scene.close()


def test_a_direction_with_a_vanishing_component_does_not_blind_its_neighbours(scenes):
    main, plain, _ = scenes
    angle = np.radians(np.arange(1081) * 0.25 - 135.0)
    tilt = 5.9e-3 * np.arange(1081) / 1080
    d = np.column_stack([np.cos(angle), np.sin(angle), -np.cos(angle) * tilt])
    o = np.tile([15.0123, 16.604, 3.324], (1081, 1))
    assert ((np.abs(d) < 1e-15) & (d < 0)).any()
    a, b = main.cast(o, d, 30.0), plain.cast(o, d, 30.0)
    assert (a.instance != b.instance).sum() <= 1


def test_a_uav_sees_others_and_never_itself():
    scene = Scene(None, None, solids=[Solid(wall(20.0), Material.WALL, "wall")])
    scene.set_bodies([drone_shape()], [0, 0])
    scene.move_bodies([[0, 0, 0], [5, 0, 0]], [[0, 0, 0, 1]] * 2)
    ray = np.zeros((1, 3)), np.array([[1.0, 0, 0]])
    own = scene.cast(*ray, 50.0)
    assert own.instance[0] == scene.moving_offset
    assert own.distance[0] == pytest.approx(0.1, abs=2e-3)
    other = scene.cast(*ray, 50.0, exclude=0)
    assert other.instance[0] == scene.moving_offset + 1
    assert other.distance[0] == pytest.approx(4.9, abs=2e-3)
    assert scene.instance_name(int(other.instance[0])) == "uav2"
    assert other.material[0] == Material.UAV_BODY
    assert scene.occluded(ray[0], [[10.0, 0, 0]], exclude=0)[0]
    assert not scene.occluded(ray[0], [[4.0, 0, 0]], exclude=0)[0]
    scene.move_bodies([[0, 0, 0], [5, 3, 0]], [[0, 0, 0, 1]] * 2)
    assert scene.cast(*ray, 50.0, exclude=0).instance[0] == 1
    scene.close()


def test_results_do_not_depend_on_threads_or_on_the_rest_of_the_batch():
    one, two = small_world(), small_world(threads=2)
    o, d, _ = some_rays(np.array([[10.0, 10, 3]]), count=20000)
    a, b = one.cast(o, d, 15.0), two.cast(o, d, 15.0)
    for x, y in zip(a, b, strict=True):
        assert x.tobytes() == y.tobytes()
    part = one.cast(o[512:1024], d[512:1024], 15.0)
    assert part.distance.tobytes() == a.distance[512:1024].tobytes()
    assert one.occluded(o, o + d).tobytes() == two.occluded(o, o + d).tobytes()
    one.close()
    two.close()


def test_without_the_library_the_error_says_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setattr(embree, "load", embree.load.__wrapped__)
    monkeypatch.setattr(embree, "library_folder", lambda: tmp_path)
    wanted = rf"no libembree4 in {tmp_path}; run `pip install --force-reinstall embreex==(\S+)`"
    with pytest.raises(embree.EmbreeUnavailableError, match=wanted) as raised:
        Scene(None, None)
    assert version("embreex") == re.search(wanted, str(raised.value))[1]


def test_a_wrong_layout_or_version_is_noticed(monkeypatch):
    monkeypatch.setattr(embree, "SUPPORTED_MAJOR_MINOR", (9, 9))
    with pytest.raises(embree.EmbreeUnavailableError, match=r"is not the supported 9\.9"):
        embree.Device()
    monkeypatch.undo()
    monkeypatch.setattr(embree, "_cast_one", lambda *_: (1.0, 0, 0))
    with pytest.raises(embree.EmbreeUnavailableError, match="not laid out"):
        Scene(None, None)


def test_embree_errors_become_exceptions():
    device = embree.Device()
    scene = device.new_scene()
    mesh = embree.padded(wall(1.0))
    device.attach_mesh([scene], 3, mesh)
    with pytest.raises(embree.EmbreeError, match=r"adding mesh 3 .* failed"):
        device.attach_mesh([scene], 3, mesh)  # the number is taken
    device.close()
    device.close()  # closing twice is fine


def test_scenes_leave_no_thread_behind():
    """A worker of Embree's that spins would take half a core from all that follows."""
    threads = Path("/proc/self/task")
    wall_before = Solid(wall(3.0), Material.WALL, "wall")
    Scene(None, None, solids=[wall_before]).close()
    before = len(list(threads.iterdir()))
    for _ in range(3):
        scene = Scene(None, None, solids=[wall_before])
        scene.cast([[0, 0, 0]], [[1, 0, 0]], 10.0)
        scene.close()
        assert len(list(threads.iterdir())) == before


def test_an_empty_scene_answers_nothing():
    scene = Scene(None, None)
    assert scene.cast([[0, 0, 0]], [[1, 0, 0]], 10.0).instance[0] == -1
    assert scene.clearance([[0, 0, 0]], 3.0).distance[0] == 3.0
    assert scene.cast(np.zeros((0, 3)), np.zeros((0, 3)), 1.0).distance.shape == (0,)
    scene.close()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.cast([[0, 0, np.nan]], [[1, 0, 0]], 1.0), "finite"),
        (lambda s: s.cast([[0, 0, 0]], np.ones((2, 3)), 1.0), "1 origins but 2"),
        (lambda s: s.cast(np.zeros((3, 3)), np.ones((3, 3)), 1.0, [0, 1]), "exclude"),
        (lambda s: s.clearance([[0, 0, 0]], -1.0), "negative"),
        (lambda s: s.clearance([[np.inf, 0, 0]], 1.0), "finite"),
        (lambda s: s.set_bodies([drone_shape()], [1]), "shape_index"),
    ],
)
def test_bad_questions_are_refused(call, message):
    scene = Scene(
        None, None, solids=[Solid(Mesh(np.zeros((3, 3)), [[0, 1, 2]]), Material.WALL, "w")]
    )
    with pytest.raises(ValueError, match=message):
        call(scene)
    scene.close()


def test_few_rays_stay_on_the_calling_thread():
    assert embree_backend.FEW_RAYS == 5000
