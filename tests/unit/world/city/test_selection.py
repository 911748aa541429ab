"""Which features of an export are buildings, and parts of buildings that hang in the air."""

import json

import numpy as np
import pytest

from volery.core.errors import DataFileError
from volery.core.geodesy import LocalFrame
from volery.world.city import build_city
from volery.world.city.heights import HeightRule
from volery.world.city.outlines import read_outlines
from volery.world.materials import Material
from volery.world.scene import Scene
from volery.world.terrain import Terrain

FRAME = LocalFrame.from_degrees(60.0, 25.0, 0.0)
RULE = HeightRule(storey_m=3.0, default_m=10.0)
GROUND_M = 5.0
AREAS = [
    {"natural": "water"},
    {"landuse": "grass"},
    {"amenity": "parking"},
    {"highway": "pedestrian", "area": "yes"},
    {"building": "no"},
    {"boundary": "administrative", "admin_level": "8"},
    {"building": "yes", "location": "underground"},
    {"demolished:building": "yes"},
]


def feature(x, properties, side=10.0):
    return box(x, x + side, side, properties)


def box(x0, x1, depth, properties):
    points = np.array([[x0, 0], [x1, 0], [x1, depth], [x0, depth], [x0, 0]], float)
    enu = np.column_stack([points, np.zeros(5)])
    latitude, longitude, _ = np.degrees(FRAME.geodetic_from_enu(enu)).T
    ring = np.column_stack([longitude, latitude]).tolist()
    geometry = {"type": "Polygon", "coordinates": [ring]}
    return {"type": "Feature", "id": f"at {x0}", "properties": properties, "geometry": geometry}


@pytest.fixture
def write(tmp_path):
    def write(*features):
        path = tmp_path / "lu.geojson"
        path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
        return path

    return write


@pytest.fixture
def read(write):
    def read(*features):
        return read_outlines(write(*features), FRAME, rule=RULE)

    return read


def flat(tags):
    return {"name": "a", **tags}


def gdal(tags):
    """A column for each common key, the others as text."""
    columns = {key: tags.get(key) for key in ("name", "building", "natural", "landuse", "amenity")}
    others = {key: value for key, value in tags.items() if key not in columns}
    return {**columns, "other_tags": ",".join(f'"{k}"=>"{v}"' for k, v in others.items()) or None}


def osmtogeojson(tags):
    return {"type": "way", "id": 5, "tags": tags, "relations": [], "meta": {}}


def shapefile(tags):
    return {key.upper(): value for key, value in tags.items()}


@pytest.mark.parametrize("written", [flat, gdal, osmtogeojson, shapefile])
def test_only_buildings_of_an_export_of_openstreetmap_become_buildings(read, written):
    house = feature(0.0, written({"building": "yes", "height": "9"}))
    areas = [feature(20.0 * k, written(tags)) for k, tags in enumerate(AREAS, start=1)]
    (outline,), report = read(areas[0], house, *areas[1:])
    assert (outline.id, outline.height.height_m) == ("at 0.0", 9.0)
    assert report.summary() == (
        "lu.geojson: 1 building of 9 outlines; 8 are no buildings: natural, landuse, amenity, "
        "highway, building=no, ..."
    )
    assert [why for _, why in report.others[4:]] == [
        "building=no", "boundary", "underground", "without a tag building"]  # fmt: skip
    assert report.dropped == ()


@pytest.mark.parametrize(
    "tags",
    [
        {"building": "roof"},
        {"building": "construction"},
        {"building:part": "yes"},
        {"building": "no", "building:part": "yes"},
        {"building": "apartments", "amenity": "parking", "layer": "-1"},
        {"building": 1},
        {"building": True},
    ],
)
def test_buildings_of_every_kind(read, tags):
    outlines, report = read(feature(0.0, tags), feature(20.0, {"natural": "water"}))
    assert [o.id for o in outlines] == ["at 0.0"]
    assert report.others == (("at 20.0", "natural"),)


@pytest.mark.parametrize("value", ["no", "No ", False, 0, "demolished", "proposed", None, ""])
def test_what_is_not_there_is_no_building(read, value):
    outlines, report = read(feature(0.0, {"building": value}), feature(20.0, {"building": "yes"}))
    assert [o.id for o in outlines] == ["at 20.0"]
    assert len(report.others) == 1


def test_without_tags_of_openstreetmap_all_outlines_are_buildings(read):
    """Tables of footprints, and Overture Maps, which marks what is underground."""
    outlines, report = read(
        feature(0.0, {"height": 9, "landuse": "grass"}),
        feature(20.0, {"HEIGHT": 12, "BUILDING_ID": 7}),
        feature(40.0, None),
        feature(60.0, {"height": 9, "is_underground": True, "num_floors": 2}),
        feature(80.0, {"height": 9, "is_underground": False, "num_floors": 2}),
    )
    assert [o.height.height_m for o in outlines] == [9.0, 12.0, 10.0, 9.0]
    assert report.summary() == (
        "lu.geojson: 4 buildings of 5 outlines; 1 is no building: underground; 1 has no height "
        "and gets the default"
    )


def test_a_file_without_buildings_says_what_it_holds(read):
    with pytest.raises(DataFileError, match="no outline of a building; all 2 features are no build"
                       "ings: natural, landuse"):  # fmt: skip
        read(*(feature(20.0 * k, {"building": None, **AREAS[k]}) for k in range(2)))


def test_other_areas_do_not_move_the_middle(read):
    """A boundary far away has more corners than all buildings."""
    far = feature(0.0, {"boundary": "administrative"})
    far["geometry"]["coordinates"] = [[[10.0 + 0.001 * k, 50.0] for k in range(100)]]
    outlines, _ = read(feature(0.0, {"building": "yes"}), far)
    assert len(outlines) == 1


@pytest.mark.parametrize(
    ("tags", "low_m", "high_m"),
    [
        ({"height": 20, "min_height": "8 m"}, 8.0, 20.0),
        ({"height": 20, "building:levels": 5, "building:min_level": 2}, 8.0, 20.0),
        ({"building:levels": 5, "building:min_level": 2}, 6.0, 15.0),
        ({"HEIGHT": 20, "MIN_HEIGHT": 8}, 8.0, 20.0),
        ({"height": "40 ft", "min_height": "20 ft"}, 6.096, 12.192),
        ({"height": 20, "min_height": "0"}, -0.5, 20.0),
        ({"height": 20, "building:min_level": 0}, -0.5, 20.0),
    ],
)
def test_what_hangs_in_the_air_is_open_below(write, tags, low_m, high_m):
    terrain = Terrain.flat(400.0, GROUND_M, origin=(-200.0, -200.0))
    path = write(feature(0.0, {"building": "yes", **tags}))
    city = build_city(path, FRAME, terrain, heights=RULE)
    scene = Scene(terrain, None, solids=city.solids, cover=city.cover)
    hits = scene.cast([[5.0, 5.0, 100.0]], [[0.0, 0.0, -1.0]], 200.0)
    assert hits.distance[0] == pytest.approx(100.0 - GROUND_M - high_m, abs=1e-3)
    assert hits.material[0] == Material.ROOF
    below = scene.cast([[5.0, 5.0, GROUND_M + 1.0], [-20.0, 5.0, GROUND_M + 1.0]],
                       [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], 200.0)  # fmt: skip
    inside = scene.enclosing([[5.0, 5.0, GROUND_M + 1.0]])[0]
    scene.close()
    if low_m > 0.0:
        assert below.distance[0] == pytest.approx(low_m - 1.0, abs=1e-3)
        assert not below.distance[1] < 190.0  # the level ray passes under it
        assert inside == -1
    else:
        assert below.distance[1] == pytest.approx(20.0, abs=1e-3)
        assert inside >= 0


def test_a_lower_side_above_the_roof_is_reported(read):
    (outline,), report = read(feature(0.0, {"height": 6, "min_height": 8}))
    assert outline.height.base_m == 0.0
    assert report.guessed == (("at 0.0", "its lower side, 8 m, is not below its height, 6 m"),)
    (outline,), report = read(feature(0.0, {"height": 6, "min_height": "low"}))
    assert (outline.height.height_m, outline.height.base_m) == (6.0, 0.0)
    assert report.guessed == (("at 0.0", "min_height 'low' is no length in m"),)


def test_what_hangs_in_the_air_hides_nothing_below_it(read):
    """A building is hidden only in one that reaches as low and as high as it."""
    roof = {"building": "yes", "height": 20, "min_height": 10}
    outlines, report = read(feature(0.0, roof), feature(2.0, {"building": "yes", "height": 5}, 6.0))
    assert len(outlines) == 2
    outlines, report = read(feature(0.0, {"building": "yes", "height": 20}), feature(0.0, roof))
    assert [o.height.base_m for o in outlines] == [0.0]
    assert report.dropped == (("at 0.0", "hidden inside at 0.0, which is as tall"),)
    outlines, _ = read(feature(0.0, roof), feature(0.0, {"building": "yes", "height": 20}))
    assert [o.height.base_m for o in outlines] == [0.0]


def test_parts_stand_for_the_outline_that_they_fill(write):
    """A gate: two towers, and a storey between them; rays pass through it."""
    part = {"building:part": "yes"}
    path = write(
        feature(0.0, {"building": "yes", "height": 20}, 30.0),
        box(0.0, 10.0, 30.0, part),  # without a height
        box(10.0, 20.0, 30.0, {**part, "height": 15, "min_height": 9}),
        box(20.0, 30.0, 30.0, {**part, "height": 12}),
    )
    terrain = Terrain.flat(400.0, GROUND_M, origin=(-200.0, -200.0))
    city = build_city(path, FRAME, terrain, heights=RULE)
    assert [b.outline.height.height_m for b in city.buildings] == [20.0, 15.0, 12.0]
    assert city.report.dropped == (("at 0.0", "3 parts of it stand for it"),)
    scene = Scene(terrain, None, solids=city.solids, cover=city.cover)
    above = [[5.0, 15.0, 100.0], [15.0, 15.0, 100.0], [25.0, 15.0, 100.0]]
    hits = scene.cast([*above, [15.0, -20.0, GROUND_M + 5.0]],
                      [*[[0.0, 0.0, -1.0]] * 3, [0.0, 1.0, 0.0]], 150.0)  # fmt: skip
    scene.close()
    np.testing.assert_allclose(hits.distance[:3], [75.0, 80.0, 83.0], atol=1e-3)
    assert not hits.distance[3] < 150.0


def test_outlines_that_parts_do_not_fill_stay(read):
    outlines, report = read(
        feature(0.0, {"building": "yes", "height": 6}, 30.0),
        box(0.0, 10.0, 30.0, {"building:part": "yes", "height": 20}),
        box(30.0, 60.0, 30.0, {"building:part": "yes", "height": 9}),
        feature(100.0, {"building": "yes"}),
        box(100.0, 110.0, 10.0, {"building": "yes", "building:part": "yes", "height": 9}),
    )
    assert [o.height.height_m for o in outlines] == [6.0, 20.0, 9.0, 10.0]
    assert [why for _, why in report.dropped] == ["hidden inside at 100.0, which is as tall"]
