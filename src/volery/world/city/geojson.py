"""Reads outlines from GeoJSON (RFC 7946) and validates the format.

A file holds one GeoJSON object, or several: one a line, or a text sequence (RFC 8142). Anything
other than GeoJSON with WGS 84 coordinates raises a `DataFileError` that names file and feature.
Well-formed but invalid outlines (self-intersecting, too few corners) pass; `outlines` repairs or
drops them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.text_files import decode_text
from volery.world.city.tags import Tags, tags_of

MAX_BYTES = 256_000_000
"""Maximum file size: parsed larger files would need gigabytes."""
_WGS_84 = ("CRS84", "EPSG::4326", "EPSG:4326")
_BINARY = (b"PK\x03\x04", b"\x1f\x8b", b"SQLite format 3\0", b"\0\0\x27\x0a")
"""First bytes of ZIP, gzip, GeoPackage and shapefile."""
_ID_KEYS = ("id", "@id", "osm_id", "osm_way_id", "full_id", "fid", "objectid", "gml_id")
"""Keys of ids in lower case, in the words of OpenStreetMap's and others' exporters."""
_SHAPES = ("Point", "MultiPoint", "LineString", "MultiLineString")
"""Valid geometries that are not outlines."""
_GEOMETRIES = ("Polygon", "MultiPolygon", "GeometryCollection")
_BETWEEN = re.compile(r"[ \t\n\r\x1e]*")
"""White space of JSON, and the record separator of RFC 8142."""

Ring = NDArray[np.float64]
"""(n, 2) longitude and latitude in degrees."""


@dataclass(frozen=True, eq=False)
class Feature:
    """One feature of a file.

    polygons: each with its outer ring first, then its holes; empty for other shapes or no geometry.
    tags: by plain names, see `tags`.
    """

    id: str
    shape: str
    polygons: tuple[tuple[Ring, ...], ...]
    tags: Tags


def read_features(path: str | Path) -> tuple[Feature, ...]:
    """Returns all features of a file, in order; raises `DataFileError` for an invalid file."""
    path = Path(path)
    features = [feature for data in _load(path) for feature in _features_in(path, data)]
    read = []
    for number, feature in enumerate(features, start=1):
        name = f"feature {number}"
        try:
            if not isinstance(feature, dict) or feature.get("type") != "Feature":
                raise ValueError("it must be an object of type Feature")
            own = _id_of(feature, number)
            name += f" (id {own})"
            read.append(_read(feature, own))
        except ValueError as error:
            raise DataFileError(f"{path}: {name}: {error}") from None
    return tuple(read)


def _features_in(path: Path, data: Any) -> list[Any]:
    """Returns the features of one GeoJSON object."""
    kind = data.get("type") if isinstance(data, dict) else None
    if kind in _GEOMETRIES:
        data = {"type": "Feature", "geometry": data, "crs": data.get("crs")}
    if kind in ("Feature", *_GEOMETRIES):
        data = {"type": "FeatureCollection", "features": [data], "crs": data.get("crs")}
    elif kind != "FeatureCollection":
        raise DataFileError(
            f"{path}: outlines must be GeoJSON: a FeatureCollection, Feature, Polygon, "
            "MultiPolygon or GeometryCollection; this file has another 'type'"
        )
    _check_crs(path, data.get("crs"))
    features = data.get("features")
    if not isinstance(features, list):
        raise DataFileError(f"{path}: 'features' must be a list")
    return features


def _load(path: Path) -> list[Any]:
    """Returns the JSON values of a file, at least one."""
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise DataFileError(
                f"{path} has {size / 1e6:.0f} MB; at most {MAX_BYTES / 1e6:.0f} MB are read"
            )
        data = path.read_bytes()
        if data.startswith(_BINARY):
            raise DataFileError(
                f"outlines {path} are no GeoJSON but a binary file; `ogr2ogr OUT.geojson IN` "
                "converts geographic formats"
            )
        return list(_values(decode_text(data)))
    except FileNotFoundError:
        raise DataFileError(f"outlines {path} do not exist") from None
    except UnicodeDecodeError:
        raise DataFileError(f"outlines {path} are not UTF-8; save the file as UTF-8") from None
    except OSError as error:
        raise DataFileError(f"outlines {path} cannot be read: {error}") from None
    except RecursionError:
        raise DataFileError(f"{path}: not GeoJSON: nested too deeply") from None
    except ValueError as error:  # of JSON, or of an integer with thousands of digits
        raise DataFileError(f"{path}: not valid JSON: {error}") from None


def _values(text: str) -> Iterator[Any]:
    """Returns the JSON values that follow each other in a text."""
    decoder = json.JSONDecoder()
    start = _BETWEEN.match(text).end()  # type: ignore[union-attr]  # it matches no character, too
    while True:
        value, end = decoder.raw_decode(text, start)
        yield value
        start = _BETWEEN.match(text, end).end()  # type: ignore[union-attr]
        if start == len(text):
            return


def _check_crs(path: Path, crs: Any) -> None:
    """Rejects coordinates other than WGS 84, which GeoJSON before RFC 7946 could name."""
    if crs is None:
        return
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not (isinstance(name, str) and name.endswith(_WGS_84)):
        raise DataFileError(f"{path}: coordinates must be WGS 84 in degrees; 'crs' names others")


def _id_of(feature: Mapping[str, Any], number: int) -> str:
    properties = feature.get("properties")
    if not isinstance(properties, dict | None):
        raise ValueError("'properties' must be an object or null")
    for holder in (feature, {key.lower(): own for key, own in (properties or {}).items()}):
        for key in _ID_KEYS:
            own = holder.get(key)
            if isinstance(own, float) and own.is_integer():  # of a table with gaps
                own = int(own)
            if isinstance(own, str | int) and not isinstance(own, bool) and str(own).strip():
                shown = str(own).strip()[:80]  # also in messages and on terminals
                return "".join(c if c.isprintable() else "?" for c in shown)
    return f"#{number}"


def _read(feature: Mapping[str, Any], own: str) -> Feature:
    geometry = feature.get("geometry")
    tags = tags_of(feature.get("properties") or {})
    if geometry is None:
        return Feature(own, "no geometry", (), tags)
    polygons = tuple(
        tuple(_ring(ring) for ring in _list(rings, "'coordinates' of a polygon"))
        for rings in _polygons_of(geometry)
    )
    return Feature(own, str(geometry["type"]), polygons, tags)


def _polygons_of(geometry: Any) -> list[Any]:
    """Returns the coordinates of the polygons of a geometry; a collection may hold some."""
    polygons: list[Any] = []
    todo = [geometry]
    for part in todo:
        if not isinstance(part, dict):
            raise ValueError("'geometry' must be an object or null")
        shape, coordinates = part.get("type"), part.get("coordinates")
        if shape == "GeometryCollection":
            todo += _list(part.get("geometries"), "'geometries'")
        elif shape == "Polygon":
            polygons.append(coordinates)
        elif shape == "MultiPolygon":
            polygons += _list(coordinates, "'coordinates'")
        elif shape not in _SHAPES:
            raise ValueError("its geometry has an unknown 'type'")
    return polygons


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{what} must be a list, not {type(value).__name__}")
    return value


def _ring(ring: Any) -> Ring:
    points = np.empty((len(_list(ring, "a ring")), 2))
    for k, position in enumerate(ring):
        if not isinstance(position, list) or len(position) < 2:
            raise ValueError(f"a position is [longitude, latitude], not {position!r}"[:200])
        for j, (number, limit) in enumerate(zip(position, (180.0, 90.0), strict=False)):
            is_number = isinstance(number, int | float) and not isinstance(number, bool)
            if not is_number or not abs(number) <= limit:  # nor is it nan
                raise ValueError(
                    f"longitude and latitude are degrees within 180 and 90, not {position!r}"[:200]
                )
            points[k, j] = number
    return points
