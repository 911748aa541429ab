"""Building outlines: GeoJSON as mappers, exporters and damage leave it, up to a city's solids."""

from __future__ import annotations

import contextlib
import json

import numpy as np
from scratch_files import path_of

from volery.core.errors import DataFileError
from volery.core.geodesy import LocalFrame
from volery.world.city import build_city
from volery.world.city.outlines import MAX_DISTANCE_M
from volery.world.terrain import Terrain

_LATITUDE, _LONGITUDE = 60.17, 24.94
_FRAME = LocalFrame.from_degrees(_LATITUDE, _LONGITUDE, 0.0)
_DEGREE_M = 111_320.0
_HALF_M = 60.0


def _ring(*corners):
    """Closed ring of corners in m from the origin, about."""
    wide = _DEGREE_M * np.cos(np.radians(_LATITUDE))
    points = [[_LONGITUDE + x / wide, _LATITUDE + y / _DEGREE_M] for x, y in corners]
    return [*points, points[0]]


def _feature(shape, coordinates, **properties):
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


_HOUSE = _ring((0, 0), (20, 0), (20, 10), (0, 10))
_YARD = _ring((5, 3), (5, 7), (9, 7), (9, 3))
_BOW = _ring((-30, -20), (-10, -5), (-10, -20), (-30, -5))
_TOWER = _ring((-30, 20), (-20, 20), (-20, 30), (-30, 30))
_COLLECTION = {
    "type": "FeatureCollection",
    "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}},
    "features": [
        _feature("Polygon", [_HOUSE, _YARD], id="w1", height="12.5 m"),
        _feature("Polygon", [_BOW], osm_id=2, **{"building:levels": "3;4"}),
        _feature("MultiPolygon", [[_TOWER], [_ring((5, 25), (25, 25), (15, 40))]], height=30),
        _feature("Polygon", [_TOWER[:-1]], levels=2),
        _feature("Point", _HOUSE[0]),
        {"type": "Feature", "properties": None, "geometry": None},
    ],
}
_EXPORT = {
    "type": "FeatureCollection",
    "features": [
        _feature(
            "Polygon", [_HOUSE, _YARD], building="yes", other_tags='"height"=>"9","min_height"=>"3"'
        ),
        _feature("Polygon", [_TOWER], tags={"building:part": "yes", "height": "20"}),
        _feature("Polygon", [_BOW], building=None, natural="water"),
        _feature("Polygon", [_TOWER], BUILDING="yes", HEIGHT_FT=30, other_tags='{"min_level": 2}'),
        {
            **_feature("GeometryCollection", None, building="roof"),
            "geometry": {
                "type": "GeometryCollection",
                "geometries": [{"type": "Polygon", "coordinates": [_HOUSE]}],
            },
        },
    ],
}
_FILES = [
    json.dumps(_COLLECTION).encode(),
    json.dumps({"type": "FeatureCollection", "features": _COLLECTION["features"][:2]}).encode(),
    json.dumps(_EXPORT).encode(),
    "".join(f"\x1e{json.dumps(feature)}\n" for feature in _EXPORT["features"]).encode(),
]


def outlines(mutator):
    """Files of outlines, changed as text or as values."""
    if mutator.chance(0.5):
        data = mutator.bytes(_FILES)
    else:
        text = json.dumps(mutator.plain(mutator.pick((_COLLECTION, _EXPORT))), default=repr)
        data = text.encode("utf-8", "surrogatepass")
    path = path_of("outlines.geojson")
    path.write_bytes(data)
    terrain = Terrain.flat(2.0 * _HALF_M, origin=(-_HALF_M, -_HALF_M))
    with contextlib.suppress(DataFileError):
        city = build_city(path, _FRAME, terrain, region=(-_HALF_M, -_HALF_M, _HALF_M, _HALF_M))
        str(city.report).encode()
        for solid in city.solids:
            assert np.isfinite(solid.mesh.vertices).all()
            assert np.abs(solid.mesh.vertices).max() < MAX_DISTANCE_M
            assert solid.mesh.area > 0.0
            solid.name.encode()
    return 1
