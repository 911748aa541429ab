"""Outlines are read, mended or refused; every one that needed something is reported by id."""

import json
import math

import numpy as np
import pytest
import shapely

from volery.core.errors import DataFileError
from volery.core.geodesy import LocalFrame
from volery.world.city.geojson import read_features
from volery.world.city.heights import HeightRule, height_of
from volery.world.city.outlines import MIN_AREA_M2, read_outlines
from volery.world.city.tags import tags_of

FRAME = LocalFrame.from_degrees(60.0, 25.0, 0.0)
RULE = HeightRule(storey_m=3.0, default_m=10.0)


def degrees(points):
    """Positions in degrees of points (x, y) in m near the origin."""
    enu = np.column_stack([np.asarray(points, float), np.zeros(len(points))])
    latitude, longitude, _ = np.degrees(FRAME.geodetic_from_enu(enu)).T
    return np.column_stack([longitude, latitude]).tolist()


def square(x=0.0, y=0.0, side=10.0):
    return [[x, y], [x + side, y], [x + side, y + side], [x, y + side], [x, y]]


def feature(*rings, own="b", **properties):
    geometry = {"type": "Polygon", "coordinates": [degrees(ring) for ring in rings]}
    return {"type": "Feature", "properties": {"id": own, **properties}, "geometry": geometry}


@pytest.fixture
def read(tmp_path):
    def write_and_read(*features, **options):
        path = tmp_path / "town.geojson"
        data = {"type": "FeatureCollection", "features": list(features)}
        path.write_text(json.dumps(data))
        return read_outlines(path, FRAME, rule=RULE, **options)

    return write_and_read


def test_a_square_becomes_itself(read):
    (outline,), report = read(feature(square(20.0, -30.0)))
    assert outline.footprint.area == pytest.approx(100.0, rel=1e-6)
    np.testing.assert_allclose(outline.footprint.bounds, (20, -30, 30, -20), atol=1e-6)
    summary = "town.geojson: 1 building of 1 outline; 1 has no height and gets the default"
    assert report.summary() == summary
    _, report = read(feature(square(20.0, -30.0), height=12))
    assert report.summary() == "town.geojson: 1 building of 1 outline"


def test_courtyards_stay_open(read):
    (outline,), _ = read(feature(square(side=30.0), square(10.0, 10.0)[::-1]))
    assert outline.footprint.area == pytest.approx(800.0, rel=1e-6)
    assert not outline.footprint.contains(shapely.Point(15.0, 15.0))


def test_several_polygons_are_one_building(read):
    two = feature(square(), own="two")
    two["geometry"] = {
        "type": "MultiPolygon",
        "coordinates": [[degrees(square())], [degrees(square(50.0))]],
    }
    (outline,), _ = read(two)
    assert len(shapely.get_parts(outline.footprint)) == 2
    assert outline.footprint.area == pytest.approx(200.0, rel=1e-6)


def test_open_and_crossed_outlines_are_repaired_and_reported(read):
    bow_tie = [[0, 0], [10, 10], [10, 0], [0, 10], [0, 0]]  # two triangles of 25 m2
    outlines, report = read(
        feature(square(100.0)[:-1], own="open"), feature(bow_tie, own="crossed")
    )
    assert [round(o.footprint.area, 3) for o in outlines] == [100.0, 50.0]
    repairs = dict(report.repaired)
    assert "closed" in repairs["open"]
    assert "self-intersection" in repairs["crossed"]
    assert "repaired crossed" in str(report)


def test_what_is_no_building_is_dropped_with_the_reason(read):
    line = feature(square(), own="line")
    line["geometry"] = {"type": "LineString", "coordinates": degrees(square())}
    nothing = {**feature(square(), own="nothing"), "geometry": None}
    outlines, report = read(
        feature(square(), own="whole"),
        feature(square(), own="twin"),
        feature(square(2.0, 2.0, 3.0), own="inside", height=5),
        feature(square(5.0, 5.0, 3.0), own="tower", height=50),
        feature(square(70.0, side=0.9 * math.sqrt(MIN_AREA_M2)), own="speck"),
        feature([[0, 0], [40, 0], [0, 0]], own="thread"),
        line,
        nothing,
    )
    assert [o.id for o in outlines] == ["whole", "tower"]
    why = dict(report.dropped)
    assert why["twin"] == "the same as whole"
    assert why["inside"] == "hidden inside whole, which is as tall"
    assert why["speck"] == why["thread"] == "no area of 1 m2"
    assert (why["line"], why["nothing"]) == (
        "LineString is no outline",
        "no geometry is no outline",
    )
    assert len(why) == 6


def test_a_building_mapped_a_thousand_times(read):
    """Its twins are found without comparing each with each; almost twins are compared."""
    many = [feature(square(), own=f"b{k}") for k in range(1000)]
    many += [feature(square(0.001 * k), own=f"c{k}") for k in range(1, 4)]
    outlines, report = read(*many)
    assert [o.id for o in outlines] == ["b0"]
    assert set(dict(report.dropped).values()) == {"the same as b0"}
    assert len(report.dropped) == 1002


def test_an_outline_that_crosses_itself_a_million_times_is_dropped(read):
    star = [[30.0 * math.cos(2.5 * k), 30.0 * math.sin(2.5 * k)] for k in range(1500)]
    outlines, report = read(feature(star, own="star"), feature(square(50.0)))
    assert [o.id for o in outlines] == ["b"]
    assert "1501 corners are too many to be mended" in dict(report.dropped)["star"]


def test_ids_can_be_shown(read):
    (outline,), report = read(feature(square()[:-1], own="a\n\x1b[31m\ud800b"))
    assert outline.id == "a??[31m?b"
    str(report).encode()


def test_a_region_crops(read):
    outlines, report = read(
        feature(square()), feature(square(90.0), own="far"), region=(-20.0, -20.0, 50.0, 50.0)
    )
    assert [o.id for o in outlines] == ["b"]
    assert report.outside == 1


@pytest.mark.parametrize(
    ("properties", "height_m", "storeys", "source"),
    [
        ({"height": 12.5}, 12.5, 4, "height"),
        ({"height": "12.13 m"}, 12.13, 4, "height"),
        ({"height": "40 ft"}, 12.192, 4, "height"),
        ({"height": "18'0\""}, 5.4864, 2, "height"),
        ({"height": "6'6\""}, 1.9812, 1, "height"),
        ({"height": "6' 6.5''"}, 1.9939, 1, "height"),
        ({"height": "20\u2032 3\u2033"}, 6.1722, 2, "height"),
        ({"height": "20\u2019"}, 6.096, 2, "height"),
        ({"height": "20'-3"}, 6.1722, 2, "height"),
        ({"height": "20 ft 6 in"}, 6.2484, 2, "height"),
        ({"height": '240"'}, 6.096, 2, "height"),
        ({"height": "12,5 m"}, 12.5, 4, "height"),
        ({"height": "1250 cm"}, 12.5, 4, "height"),
        ({"height": "12500 mm"}, 12.5, 4, "height"),
        ({"height": "10 yd"}, 9.144, 3, "height"),
        ({"height": " ", "est_height": "12.5"}, 12.5, 4, "height"),
        ({"height": math.nan, "building:levels": "", "levels": 6}, 18.0, 6, "levels"),
        ({"height": "", "building:levels": math.nan}, 10.0, 3, "default"),
        ({"height": "~12.5"}, 12.5, 4, "height"),
        ({"height": "ca. 12 Meter"}, 12.0, 4, "height"),
        ({"height": "9;12.5"}, 12.5, 4, "height"),
        ({"height": None, "building:height": "12.5"}, 12.5, 4, "height"),
        ({"est_height": 12.5}, 12.5, 4, "height"),
        ({"building:levels": "3,5"}, 10.5, 4, "levels"),
        ({"height": "18", "building:levels": "5"}, 18.0, 5, "height"),
        ({"building:levels": "3.5"}, 10.5, 4, "levels"),
        ({"building:levels": 6}, 18.0, 6, "levels"),
        ({"building:levels": "3;4"}, 12.0, 4, "levels"),
        ({"building:levels": "0"}, 10.0, 3, "default"),
        ({}, 10.0, 3, "default"),
        # GDAL, osmtogeojson, pyrosm; shapefiles; CityGML, Overture Maps, Microsoft
        ({"other_tags": '"height"=>"9","building:levels"=>"4"'}, 9.0, 4, "height"),
        ({"other_tags": '"name"=>"a \\"b\\", \\"height\\"=>\\"50\\"", "height" => "9"'}, 9.0, 3,
         "height"),
        ({"other_tags": '"height"=>NULL,"building:levels"=>"4"'}, 12.0, 4, "levels"),
        ({"type": "way", "id": 5, "tags": {"building": "yes", "height": "9"}}, 9.0, 3, "height"),
        ({"tags": '{"height": "9", "building:levels": 4}'}, 9.0, 4, "height"),
        ({"tags": "no tags", "all_tags": '"height"=>"9"', "height": None}, 9.0, 3, "height"),
        ({"height": 8, "other_tags": '"height"=>"9"'}, 8.0, 3, "height"),
        ({"HEIGHT": 9.0}, 9.0, 3, "height"),
        ({"Height_m": "9"}, 9.0, 3, "height"),
        ({"Height [m]": "9"}, 9.0, 3, "height"),
        ({"HEIGHT_FT": 30}, 9.144, 3, "height"),
        ({"height_ft": "9 m"}, 9.0, 3, "height"),
        ({"BUILDING_LEVELS": 4}, 12.0, 4, "levels"),
        ({"measuredHeight": 9.0}, 9.0, 3, "height"),
        ({"height": None, "num_floors": 4}, 12.0, 4, "levels"),
        ({"height": -1.0, "confidence": 0.9}, 10.0, 3, "default"),
        ({"HEIGHT": -9999, "levels": "-1"}, 10.0, 3, "default"),
    ],
)  # fmt: skip
def test_heights(properties, height_m, storeys, source):
    height = height_of(tags_of(properties), RULE)
    assert height.height_m == pytest.approx(height_m)
    assert (height.storeys, height.source, height.fault) == (storeys, source, "")


@pytest.mark.parametrize(
    "height",
    [
        "tall",
        -3,
        0,
        1e9,
        True,
        [3],
        "nan",
        "12 parsecs",
        "'",
        "12;tall",
        "6'6'",
        "-5'",
        '-5"',
        "12-14",
    ],
)
def test_heights_not_understood_are_reported(read, height):
    (outline,), report = read(feature(square(), height=height))
    assert outline.height.height_m == 10.0
    assert "is no length" in dict(report.guessed)["b"]


@pytest.mark.parametrize(
    ("properties", "own"),
    [
        ({"@id": "way/7"}, "way/7"),
        ({"osm_id": None, "osm_way_id": "7"}, "7"),
        ({"osm_id": 7.0}, "7"),
        ({"full_id": "w7", "osm_type": "way"}, "w7"),
        ({"OBJECTID": 12}, "12"),
        ({"OSM_ID": "7", "HEIGHT": 9.0}, "7"),
        ({"fid": 3}, "3"),
        ({}, "#1"),
    ],
)
def test_the_report_has_the_ids_of_the_file(read, properties, own):
    data = feature(square(), own=None, height="tall", **properties)
    _, report = read(data)
    assert [name for name, _ in report.guessed] == [own]


def spoilt(change):
    data = {"type": "FeatureCollection", "features": [feature(square(), own="way/7")]}
    change(data)
    return json.dumps(data)


def _set(key, value):
    def change(data):
        data["features"][0]["geometry"][key] = value

    return change


def test_a_feature_or_a_geometry_alone_is_geojson_as_well(tmp_path):
    """RFC 7946, section 2."""
    path = tmp_path / "one.geojson"
    alone = feature(square(), own="way/7")
    path.write_text(json.dumps(alone))
    (found,) = read_features(path)
    assert found.id == "way/7"
    path.write_text(json.dumps(alone["geometry"]))
    (bare,) = read_features(path)
    assert [ring.tolist() for ring in bare.polygons[0]] == [
        ring.tolist() for ring in found.polygons[0]
    ]
    path.write_text(
        json.dumps({**alone["geometry"], "crs": {"properties": {"name": "EPSG:32632"}}})
    )
    with pytest.raises(DataFileError, match="WGS 84"):
        read_features(path)


def sequence(features):
    """A GeoJSON text sequence, RFC 8142."""
    return "".join(f"\x1e{json.dumps(feature)}\n" for feature in features)


def lines(features):
    return "\r\n".join(map(json.dumps, features))


def printed(features):
    return "\n".join(json.dumps(feature, indent=2) for feature in features)


def collections(features):
    parts = [{"type": "FeatureCollection", "features": features[k::2]} for k in (0, 1)]
    return lines(parts) + "\n\n"


@pytest.mark.parametrize("text_of", [sequence, lines, printed, collections])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_sequences_of_features(tmp_path, text_of, encoding):
    features = [feature(square(20.0 * k), own=f"b{k}", height=10.0 + k) for k in range(3)]
    path = tmp_path / "town.geojsonl"
    path.write_text(text_of(features), encoding=encoding, newline="")
    outlines, report = read_outlines(path, FRAME, rule=RULE)
    found = {o.id: (o.height.height_m, round(o.footprint.bounds[0])) for o in outlines}
    assert found == {"b0": (10.0, 0), "b1": (11.0, 20), "b2": (12.0, 40)}
    assert report.summary() == "town.geojsonl: 3 buildings of 3 outlines"


def test_sequences_of_geometries_and_their_faults(tmp_path):
    path = tmp_path / "town.geojsonl"
    path.write_text(lines([feature(square(20.0 * k))["geometry"] for k in range(2)]))
    assert [f.id for f in read_features(path)] == ["#1", "#2"]
    for text, message in (
        (lines([feature(square()), 3]), "this file has another 'type'"),
        (lines([feature(square())]) + "\n{", "not valid JSON: .*line 2"),
        (
            lines([feature(square()), {**feature(square()), "geometry": 3}]),
            r"feature 2 \(id b\): 'geometry' must be an object",
        ),
        (
            lines([feature(square()), {**feature(square()), "crs": {"properties": {"name": "x"}}}]),
            "WGS 84",
        ),
    ):
        path.write_text(text)
        with pytest.raises(DataFileError, match=message):
            read_features(path)


def test_polygons_of_a_collection_are_outlines(read):
    """PostGIS' ST_MakeValid returns polygons together with lines."""
    mixed = feature(square(), own="mixed")
    line = {"type": "LineString", "coordinates": degrees([[0, 0], [50, 50]])}
    inner = {"type": "GeometryCollection", "geometries": [feature(square(50.0))["geometry"]]}
    parts = [line, mixed["geometry"], inner]
    mixed["geometry"] = {"type": "GeometryCollection", "geometries": parts}
    alone = {**feature(square(), own="line"), "geometry": {**mixed["geometry"]}}
    alone["geometry"]["geometries"] = [line]
    (outline,), report = read(mixed, alone)
    assert outline.footprint.area == pytest.approx(200.0, rel=1e-6)
    assert report.dropped == (("line", "GeometryCollection is no outline"),)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not valid JSON"),
        ("[" * 100_000, "nested too deeply"),
        ("9" * 5000, "not valid JSON"),
        ("[]", "FeatureCollection"),
        ('{"type": "FeatureCollection"}', "'features' must be a list"),
        (spoilt(lambda d: d.update(features=[3])), "feature 1: it must be an object"),
        (spoilt(lambda d: d.update(features=[])), "no outline of a building"),
        (spoilt(lambda d: d.update(crs={"properties": {"name": "EPSG:3879"}})), "WGS 84"),
        (
            spoilt(_set("type", "Blob")),
            r"feature 1 \(id way/7\): its geometry has an unknown 'type'",
        ),
        (spoilt(_set("coordinates", "x")), r"\(id way/7\): 'coordinates' of a polygon must be a"),
        (spoilt(_set("coordinates", [[["a", 1.0]]])), r"\(id way/7\): longitude and latitude"),
        (spoilt(_set("coordinates", [[[200.0, 1.0]]])), r"\(id way/7\): longitude and latitude"),
        (spoilt(_set("coordinates", [[[math.nan, 1.0]]])), r"\(id way/7\): longitude and lat"),
        (spoilt(_set("coordinates", [[[10**400, 1.0]]])), r"\(id way/7\): longitude and latitude"),
        (spoilt(_set("coordinates", [[1.0, 2.0]])), r"\(id way/7\): a position is"),
        (spoilt(_set("coordinates", [[[0.0, 0.0]]])), r"km from the map's origin"),
    ],
)
def test_what_is_no_geojson_is_one_clear_error(tmp_path, text, message):
    path = tmp_path / "town.geojson"
    path.write_text(text)
    with pytest.raises(DataFileError, match=message) as caught:
        read_outlines(path, FRAME, rule=RULE)
    assert "town.geojson" in str(caught.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(DataFileError, match="do not exist"):
        read_outlines(tmp_path / "none.geojson", FRAME, rule=RULE)
    for data in (b"PK\x03\x04\xff", b"\x1f\x8b\x08", b"SQLite format 3\0", b"\0\0\x27\x0a\0"):
        (tmp_path / "b.geojson").write_bytes(data)
        with pytest.raises(DataFileError, match="are no GeoJSON but a binary file; `ogr2ogr OUT"):
            read_outlines(tmp_path / "b.geojson", FRAME, rule=RULE)
    for data in (b"\xff\xfe\x00", '{"type": "F\u00e9"}'.encode("latin-1")):
        (tmp_path / "b.geojson").write_bytes(data)
        with pytest.raises(DataFileError, match="are not UTF-8; save the file as UTF-8"):
            read_outlines(tmp_path / "b.geojson", FRAME, rule=RULE)
