"""The Helsinki that ships: its buildings against shapely, rays against its walls, its streets."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely

import volery.world
from volery.core.errors import DataFileError
from volery.core.geodesy import FLATTENING, SEMI_MAJOR_M, LocalFrame
from volery.world.city import FurnitureRule, build_city
from volery.world.city.buildings import FOUNDATION_M, extruded
from volery.world.city.streets import StreetRule, cover_of, covered, find_streets
from volery.world.materials import Material
from volery.world.scene import Scene
from volery.world.terrain import Terrain

FILE = Path(volery.world.__file__).parent / "data" / "city" / "helsinki_buildings.geojson"
LATITUDE, LONGITUDE = 60.1716, 24.9443
GROUND_M = 5.0


@pytest.fixture(scope="module")
def terrain():
    return Terrain.flat(1800.0, GROUND_M, origin=(-900.0, -900.0))


@pytest.fixture(scope="module")
def helsinki(terrain):
    return build_city(FILE, LocalFrame.from_degrees(LATITUDE, LONGITUDE, 0.0), terrain, seed=1)


@pytest.fixture(scope="module")
def scene(helsinki, terrain):
    scene = Scene(terrain, None, solids=helsinki.solids, cover=helsinki.cover)
    yield scene
    scene.close()


def metres(ring):
    """Degrees to metres by the ellipsoid's radii of curvature, without the module under test."""
    longitude, latitude = np.radians(np.asarray(ring, float)).T
    e2 = FLATTENING * (2.0 - FLATTENING)
    w = math.sqrt(1.0 - e2 * math.sin(math.radians(LATITUDE)) ** 2)
    north = SEMI_MAJOR_M * (1.0 - e2) / w**3 * (latitude - math.radians(LATITUDE))
    east = SEMI_MAJOR_M / w * np.cos(latitude) * (longitude - math.radians(LONGITUDE))
    return np.column_stack([east, north])


def test_number_and_area_of_the_buildings(helsinki):
    """480 of 486; their area is that of the file's valid polygons and of the mended ones."""
    assert len(helsinki.buildings) == 480
    assert len(helsinki.report.repaired) == 8
    assert len(helsinki.report.dropped) == 6
    kept = {building.outline.id for building in helsinki.buildings}
    area = 0.0
    for feature in json.loads(FILE.read_text())["features"]:
        if str(feature["properties"]["id"]) in kept:
            shape = shapely.geometry.shape(feature["geometry"])
            area += shapely.transform(shapely.make_valid(shape), metres).area
    assert sum(building.area_m2 for building in helsinki.buildings) == pytest.approx(area, rel=1e-4)


def test_solids_are_closed_and_hold_area_times_height(helsinki):
    for building, solid in zip(helsinki.buildings, helsinki.solids, strict=False):
        a, b, c = np.moveaxis(solid.mesh.corners.astype(float) - solid.mesh.bounds[0], 1, 0)
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
        height = building.roof_m - building.foot_m + FOUNDATION_M
        assert volume == pytest.approx(building.area_m2 * height, rel=2e-3), solid.name
        towards = (solid.mesh.face_normals * 1.0).T @ (
            np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
        )
        np.testing.assert_allclose(towards, 0.0, atol=0.05)  # a closed surface faces all ways


def test_rays_meet_walls_where_the_polygons_are(helsinki, scene):
    """Level rays from streets: within a millimetre of shapely's distance to the outlines."""
    walls = shapely.union_all([building.outline.footprint for building in helsinki.buildings])
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    checked = 0
    for lamp in helsinki.lamps[[10, 150, 300]]:
        x, y = (lamp[:2] + 2.5 * lamp[2:]).tolist()
        assert not walls.contains(shapely.Point(x, y))
        directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(60)])
        hits = scene.cast(np.tile([x, y, GROUND_M + 2.0], (60, 1)), directions, 200.0)
        for offset, distance, instance, material in zip(
            directions, hits.distance, hits.instance, hits.material, strict=True
        ):
            beam = shapely.LineString([(x, y), (x + 200.0 * offset[0], y + 200.0 * offset[1])])
            wanted = beam.intersection(walls.boundary).distance(shapely.Point(x, y))
            if "lamp" in scene.instance_name(int(instance)) or not math.isfinite(wanted):
                continue
            assert distance == pytest.approx(wanted, abs=1e-3)
            assert material == Material.FACADE
            assert scene.instance_name(int(instance)).startswith("building ")
            checked += 1
    assert checked > 100


def test_roofs_and_streets_from_above(helsinki, scene):
    building = helsinki.buildings[1]
    inside = building.outline.footprint.representative_point()
    lamp = helsinki.lamps[0]
    street = lamp[:2] + 3.0 * lamp[2:]  # beyond the kerb
    down = np.array([[inside.x, inside.y, 200.0], [*street, 200.0], [880.0, 880.0, 200.0]])
    hits = scene.cast(down, np.tile([0.0, 0.0, -1.0], (3, 1)), 300.0)
    assert hits.distance[0] == pytest.approx(200.0 - building.roof_m, abs=1e-3)
    assert hits.material.tolist() == [Material.ROOF, Material.ASPHALT, Material.GROUND]
    assert hits.distance[1] == pytest.approx(200.0 - GROUND_M, abs=1e-3)


def test_inside_of_buildings_is_known(helsinki, scene):
    """Places in a building are, its courtyard, roof and street are not."""
    with_court = next(
        building
        for building in helsinki.buildings
        if any(len(part.interiors) for part in shapely.get_parts(building.outline.footprint))
    )
    footprint = with_court.outline.footprint
    inside = footprint.representative_point()
    hole = shapely.Polygon(
        next(p for p in shapely.get_parts(footprint) if p.interiors).interiors[0]
    )
    court = hole.representative_point()
    z = with_court.foot_m + 1.0
    points = [
        [inside.x, inside.y, z],
        [court.x, court.y, z],
        [inside.x, inside.y, with_court.roof_m + 1.0],
        [-70.0, -300.0, z],
    ]
    found = scene.enclosing(points)
    assert scene.instance_name(int(found[0])) == f"building {with_court.outline.id}"
    assert found[1:].tolist() == [-1, -1, -1]


def test_lamps_and_trees_stand_apart_in_streets(helsinki):
    walls = shapely.union_all([building.outline.footprint for building in helsinki.buildings])
    lamps, trees = helsinki.lamps[:, :2], helsinki.trees.position
    assert min(len(lamps), len(trees)) > 300
    assert shapely.distance(walls, shapely.points(lamps)).min() > 2.0
    assert shapely.distance(walls, shapely.points(trees)).min() > 4.0
    offset = 1.5 * helsinki.lamps[:, 2:]  # of the arm: over the street, off the walls
    ahead, behind = (shapely.distance(walls, shapely.points(lamps + k * offset)) for k in (1, -1))
    assert (ahead > behind).all()
    for positions, min_distance in ((lamps, 0.6 * 28.0), (trees, 0.35 * 11.0)):
        apart = np.linalg.norm(positions[:, None] - positions[None], axis=2)
        assert apart[np.triu_indices(len(positions), 1)].min() >= min_distance - 1e-9


def test_the_same_seed_makes_the_same_city(helsinki, terrain):
    region = (-100.0, -450.0, 250.0, -180.0)
    frame = LocalFrame.from_degrees(LATITUDE, LONGITUDE, 0.0)
    one, two, other = (
        build_city(FILE, frame, terrain, seed=seed, region=region) for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(one.lamps, two.lamps)
    np.testing.assert_array_equal(one.trees.position, two.trees.position)
    assert not np.array_equal(one.trees.position, other.trees.position)
    assert 5 < len(one.buildings) < 100
    bare = build_city(FILE, frame, terrain, region=region, furniture=FurnitureRule(0.0, 0.0))
    assert len(bare.lamps) == len(bare.trees) == 0


def test_buildings_beyond_the_terrain_are_refused(terrain):
    small = Terrain.flat(200.0, origin=(-100.0, -100.0))
    frame = LocalFrame.from_degrees(LATITUDE, LONGITUDE, 0.0)
    with pytest.raises(DataFileError, match=r"buildings, \d+ for one, beyond the terrain"):
        build_city(FILE, frame, small)
    with pytest.raises(DataFileError, match="no building is left"):
        build_city(FILE, frame, terrain, region=(800.0, 800.0, 801.0, 801.0))


def test_buildings_on_a_slope_stand_on_their_lowest_ground():
    slope = Terrain.from_heights([[0.0, 180.0], [0.0, 180.0]], 1800.0, origin=(-900.0, -900.0))
    frame = LocalFrame.from_degrees(LATITUDE, LONGITUDE, 0.0)
    city = build_city(FILE, frame, slope, region=(-100.0, -450.0, 250.0, -180.0))
    for building in city.buildings:
        west = building.outline.footprint.bounds[0]
        assert building.foot_m == pytest.approx((west + 900.0) / 10.0, abs=0.02)
        assert building.roof_m - building.foot_m == pytest.approx(building.outline.height.height_m)


def test_extruded_square():
    mesh = extruded(shapely.box(0.0, 0.0, 2.0, 3.0).normalize().reverse(), 1.0, 5.0)
    assert mesh.area == pytest.approx(2 * 6.0 + 4.0 * 10.0)
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 1], [2, 3, 5]])


def test_raster_of_an_area_against_shapely():
    area = shapely.Polygon(
        [(0.3, 0.2), (7.7, 1.1), (6.2, 5.9), (1.4, 5.2)], [[(3, 2), (4, 4), (5, 2)]]
    )
    cells = covered(area, (-1.0, -1.0), 0.25, (32, 40))
    y, x = np.mgrid[0:32, 0:40] * 0.25 - 1.0 + 0.125
    np.testing.assert_array_equal(cells, shapely.contains_xy(area, x, y))


def test_a_street_between_two_walls():
    """Two long houses 12 m apart: 3 m pavement on each side of 6 m asphalt; too far: no street."""
    rule = StreetRule(max_width_m=20.0, pavement_m=3.0)
    near = find_streets([shapely.box(0, 0, 100, 10), shapely.box(0, 22, 100, 40)], rule)
    assert near.roadway.buffer(0.2).contains(shapely.box(5, 13, 95, 19))
    assert near.roadway.bounds[1] == pytest.approx(13.0)
    assert near.roadway.bounds[3] <= 19.0 + 1e-9
    assert find_streets(
        [shapely.box(0, 0, 100, 10), shapely.box(0, 40, 100, 50)], rule
    ).roadway.is_empty
    assert (cover_of(near).material == Material.ASPHALT).sum() * 0.25 == pytest.approx(
        near.roadway.area, rel=0.02
    )
