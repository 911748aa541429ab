"""Intensities, several echoes, warm-up and noise of LIDARs."""

import numpy as np
import pytest
from scanning import echoes_of, solids, standing
from scene_samples import cylinder, wall

from volery.sensors.lidar.lidar_model import load_lidar
from volery.world.materials import REFLECTIVITY, Material
from volery.world.mesh import Mesh
from volery.world.scene import Scene, Solid

SURE = {"dropout": {"far": 0.0, "grazing": 0.0}}
STILL = {"floor_m": 1e-9, "slope": 0.0, "offset_m": 0.0}


def screen(x, y0, y1, material=Material.WALL):
    """An upright screen at x from y0 to y1."""
    corners = np.array([[x, y0, -50.0], [x, y1, -50.0], [x, y1, 50.0], [x, y0, 50.0]])
    return Solid(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), material, f"screen {x} {y0}")


@pytest.mark.parametrize("name", ["utm_30lx", "vlp_16", "os1_64", "mid_40"])
def test_intensities_follow_reflectivity_incidence_and_range(name):
    model = load_lidar(name).without_noise()
    shine = model.intensity
    before = None
    for material in sorted(Material, key=lambda m: REFLECTIVITY[m])[1:]:
        scene = solids(wall(8.0, 400.0), material=material)
        echoes = echoes_of(scene, model, intensities=True)
        scene.close()
        ranges, found = echoes.ranges[0, 0], echoes.intensities[0, 0]
        seen = np.isfinite(ranges)
        cosine = model.scan.directions(0)[0][seen]
        r = ranges[seen].astype(float)
        want = shine.scale * REFLECTIVITY[material] * cosine**shine.incidence_exponent
        want *= (shine.reference_range_m / np.maximum(r, shine.reference_range_m)) ** (
            shine.range_exponent
        )
        np.testing.assert_allclose(found[seen], np.minimum(want, shine.maximum), rtol=1e-3)
        assert (found[~seen] == 0.0).all()
        if before is not None and REFLECTIVITY[material] > before[0]:
            assert (found[seen] > before[1][seen]).all()  # a brighter material, a stronger echo
        before = REFLECTIVITY[material], found


def test_intensity_noise_has_its_spread_and_is_cut():
    model = load_lidar("vlp_16").changed(**SURE)
    scene = solids(cylinder(10.0, 40.0, 2000, z=-20.0))
    exact = echoes_of(scene, model.without_noise(), intensities=True).intensities[0, 0]
    noisy = echoes_of(scene, model, scans=3, intensities=True).intensities[:, 0]
    scene.close()
    relative = (noisy / exact - 1.0)[:, exact > 0]
    assert relative.size > 80_000
    assert abs(relative.mean()) < 4.0 * 0.05 / np.sqrt(relative.size)
    assert relative.std() == pytest.approx(0.05, rel=0.02)
    cut = model.changed(intensity={"maximum": 30.0})
    scene = solids(cylinder(10.0, 40.0, 200, z=-20.0))
    assert echoes_of(scene, cut, intensities=True).intensities.max() == 30.0
    scene.close()


@pytest.mark.parametrize(("name", "scans"), [("vlp_16", 2), ("os1_64", 1), ("mid_40", 1)])
def test_range_noise_of_clouds_has_the_spread_of_the_formula(name, scans):
    model = load_lidar(name).changed(
        **SURE, range={"resolution_m": 0.001}, mixed_pixels={"divergence_rad": 0.0}
    )
    distance = 25.0
    scene = solids(wall(distance, 2000.0))
    truth = echoes_of(scene, model.without_noise(), scans=scans).ranges[:, 0].astype(float)
    found = echoes_of(scene, model, scans=scans).ranges[:, 0].astype(float)
    scene.close()
    both = np.isfinite(truth) & np.isfinite(found) & (truth < 60.0)
    sigma = np.maximum(model.noise.floor_m, model.noise.slope * truth[both] + model.noise.offset_m)
    score = (found[both] - truth[both]) / sigma
    assert score.size > 9_000
    assert abs(score.mean()) < 4.0 / np.sqrt(score.size)
    assert score.std() == pytest.approx(1.0, abs=0.03)
    assert np.abs(score).max() > 3.3
    assert abs(np.corrcoef(score[:-1], score[1:])[0, 1]) < 4.0 / np.sqrt(score.size)


def test_dropouts_of_clouds_follow_range_and_incidence():
    model = load_lidar("os1_64")
    scene = solids(wall(20.0, 2000.0))
    truth = echoes_of(scene, model.without_noise()).ranges[0, 0].astype(float)
    found = echoes_of(scene, model, scans=6).ranges[:, 0]
    scene.close()
    for low, high in ((20.0, 24.0), (40.0, 60.0), (80.0, 110.0)):
        beams = (truth > low) & (truth < high)
        cosine = model.scan.directions(0)[0][beams]
        keep = (1 - 0.3 * (truth[beams] / 120.0) ** 2) * (1 - 0.6 * (1 - cosine) ** 4)
        assert np.isinf(found[:, beams]).mean() == pytest.approx(1 - keep.mean(), abs=0.015)


# ---------------------------------------------------------------------------------- several echoes


def edge_scans(model, far, scans=3000, material=Material.WALL):
    """Scans of a screen at 5 m on the left half before a wall at `far`; the last far beam."""
    half = np.radians(0.125)
    scene = Scene(
        None,
        None,
        solids=[screen(5.0, 0.0, 50.0, material), Solid(wall(far), Material.WALL, "far")],
    )
    echoes = echoes_of(scene, model, standing(yaw=half), scans=scans, intensities=True)
    truth = echoes_of(scene, model.without_noise(), standing(yaw=half)).ranges[0, 0]
    scene.close()
    edge = int(np.flatnonzero(np.diff(truth[500:580]) < -0.5)[0]) + 500
    return echoes, edge


def test_a_beam_over_an_edge_has_two_echoes():
    model = load_lidar("utm_30lx_ew").changed(noise=STILL, **SURE, intensity={"noise": 0.0})
    echoes, edge = edge_scans(model, 9.0)
    beam = echoes.ranges[:, :, edge]
    both = np.isfinite(beam[:, 1])
    # The neighbour's share 0.5 (1 - gap / half) must reach a tenth: gap up to .8 of the half width.
    half = 0.5 * 0.0015 / model.scan.angle_increment_rad
    assert both.mean() == pytest.approx(0.8 * half, abs=0.02)
    np.testing.assert_allclose(beam[both, 0], 5.0, atol=5e-3)
    np.testing.assert_allclose(beam[both, 1], 9.0, atol=5e-3)
    assert np.isinf(beam[:, 2]).all()
    # Two echoes share the light: each, over its whole echo, is its share; the shares add up to 1.
    whole = np.array([(2.0 / 5.0) ** 2, (2.0 / 9.0) ** 2]) * 4000.0 * REFLECTIVITY[Material.WALL]
    fraction = echoes.intensities[both][:, :2, edge] / whole
    np.testing.assert_allclose(fraction.sum(axis=1), 1.0, atol=0.01)
    assert fraction[:, 0].max() <= 0.5 + 1e-3
    assert fraction[:, 0].min() >= 0.1 - 1e-3
    elsewhere = np.delete(echoes.ranges, [edge, edge + 1], axis=2)
    assert np.isinf(elsewhere[:, 1:]).all()


def test_echoes_within_a_pulse_are_one_between_the_surfaces():
    model = load_lidar("utm_30lx_ew").changed(noise=STILL, **SURE)
    echoes, edge = edge_scans(model, 6.0)
    beam = echoes.ranges[:, :, edge]
    assert np.isinf(beam[:, 1:]).all()
    mixed = (beam[:, 0] > 5.01) & (beam[:, 0] < 5.99)
    half = 0.5 * 0.0015 / model.scan.angle_increment_rad
    assert mixed.mean() == pytest.approx(half, abs=0.02)
    assert beam[mixed, 0].min() >= 5.49


def test_a_narrow_gap_gives_three_echoes_in_order():
    """A beam through a gap between two near screens: both edges and the wall behind."""
    model = load_lidar("utm_30lx_ew").changed(
        noise=STILL, **SURE, mixed_pixels={"divergence_rad": 0.0087}
    )
    step = model.scan.angle_increment_rad
    half = 0.5 * np.tan(step)
    left = screen(4.0, 4.0 * half, 20.0)
    right = screen(7.0, -20.0, -7.0 * half)
    scene = Scene(None, None, solids=[left, right, Solid(wall(10.0), Material.WALL, "far")])
    echoes = echoes_of(scene, model, scans=400)
    scene.close()
    beam = echoes.ranges[:, :, 540]
    three = np.isfinite(beam[:, 2])
    assert three.mean() > 0.3
    np.testing.assert_allclose(beam[three], np.tile([4.0, 7.0, 10.0], (three.sum(), 1)), atol=5e-3)


def test_foliage_gives_more_echoes_than_a_wall():
    from scene_samples import small_forest

    from volery.world.terrain import Terrain

    model = load_lidar("utm_30lx_ew")
    scene = Scene(Terrain.flat(extent_m=20.0), small_forest())
    in_wood = echoes_of(scene, model, standing([10.0, 10.0, 3.0]), scans=30).ranges
    scene.close()
    scene = solids(cylinder(5.0, 4.0, 400, z=-2.0))
    in_room = echoes_of(scene, model, scans=5).ranges
    scene.close()
    assert np.isfinite(in_wood[:, 1]).sum() > 50
    assert not np.isfinite(in_room[:, 1]).any()
    near, far = in_wood[:, 0], in_wood[:, 1]
    both = np.isfinite(far)
    assert (far[both] - near[both] > 1.3).all()


def test_exact_scans_have_one_echo():
    model = load_lidar("utm_30lx_ew")
    echoes, _ = edge_scans(model.without_noise(), 9.0, scans=1)
    single, _ = edge_scans(load_lidar("utm_30lx").without_noise(), 9.0, scans=1)
    np.testing.assert_array_equal(echoes.ranges[:, 0], single.ranges[:, 0])
    assert np.isinf(echoes.ranges[:, 1:]).all()


# ------------------------------------------------------------------------------------------ warm-up


def test_warm_up_is_a_bias_that_decays():
    model = load_lidar("utm_30lx").changed(
        noise=STILL, **SURE, warm_up={"bias_m": 0.02, "time_constant_s": 600.0}
    )
    scene = solids(cylinder(5.0, 4.0, 4001, z=-2.0))
    for minutes in (0, 10, 60):
        start_ns = minutes * 60 * 1_000_000_000
        ranges = echoes_of(scene, model, start_ns=start_ns).ranges[0, 0]
        want = 5.0 + 0.02 * np.exp(-minutes / 10.0)
        np.testing.assert_allclose(ranges, want, atol=6e-4)
    exact = echoes_of(scene, model.without_noise()).ranges[0, 0]
    np.testing.assert_allclose(exact, 5.0, atol=1e-4)
    scene.close()


def test_shipped_models_are_warm():
    for name in ("utm_30lx", "utm_30lx_ew", "vlp_16", "os1_64", "mid_40"):
        assert load_lidar(name).warm_up.bias_m == 0.0
