"""Reads building outlines from GeoJSON (RFC 7946) and validates the format.

Anything other than GeoJSON with WGS 84 coordinates raises a `DataFileError` that names file and
feature. Well-formed but invalid outlines (self-intersecting, too few corners) pass; `outlines`
repairs or drops them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError

MOST_BYTES = 256_000_000
"""Maximum file size: parsed larger files would need gigabytes."""
_WGS_84 = ("CRS84", "EPSG::4326", "EPSG:4326")
_ID_KEYS = ("id", "@id", "osm_id", "osm_way_id", "full_id", "fid", "OBJECTID", "gml_id")
"""Keys of ids, in the words of OpenStreetMap's and others' exporters."""
_SHAPES = ("Point", "MultiPoint", "LineString", "MultiLineString", "GeometryCollection")
"""Valid geometries that are not outlines."""

Ring = NDArray[np.float64]
"""(n, 2) longitude and latitude in degrees."""


@dataclass(frozen=True, eq=False)
class Feature:
    """One feature of a file.

    polygons: each with its outer ring first, then its holes; empty for other shapes or no geometry.
    """

    id: str
    shape: str
    polygons: tuple[tuple[Ring, ...], ...]
    properties: Mapping[str, Any]


def read_features(path: str | Path) -> tuple[Feature, ...]:
    """Returns all features of a file, in order; raises `DataFileError` for an invalid file."""
    path = Path(path)
    data = _load(path)
    kind = data.get("type") if isinstance(data, dict) else None
    if kind in ("Polygon", "MultiPolygon"):
        data = {"type": "Feature", "geometry": data, "crs": data.get("crs")}
    if kind in ("Feature", "Polygon", "MultiPolygon"):
        data = {"type": "FeatureCollection", "features": [data], "crs": data.get("crs")}
    elif kind != "FeatureCollection":
        raise DataFileError(
            f"{path}: outlines must be GeoJSON: a FeatureCollection, Feature, Polygon or "
            "MultiPolygon; this file has another 'type'"
        )
    _check_crs(path, data.get("crs"))
    features = data.get("features")
    if not isinstance(features, list):
        raise DataFileError(f"{path}: 'features' must be a list")
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


def _load(path: Path) -> Any:
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise DataFileError(
                f"{path} has {size / 1e6:.0f} MB; at most {MOST_BYTES / 1e6:.0f} MB are read"
            )
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise DataFileError(f"outlines {path} do not exist") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"outlines {path} cannot be read: {error}") from None
    except RecursionError:
        raise DataFileError(f"{path}: not GeoJSON: nested too deeply") from None
    except ValueError as error:  # of JSON, or of an integer with thousands of digits
        raise DataFileError(f"{path}: not valid JSON: {error}") from None


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
    for holder in (feature, properties or {}):
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
    properties = feature.get("properties") or {}
    if geometry is None:
        return Feature(own, "no geometry", (), properties)
    if not isinstance(geometry, dict):
        raise ValueError("'geometry' must be an object or null")
    shape = geometry.get("type")
    if shape in _SHAPES:
        return Feature(own, str(shape), (), properties)
    coordinates = geometry.get("coordinates")
    if shape == "Polygon":
        polygons = [coordinates]
    elif shape == "MultiPolygon":
        polygons = _list(coordinates, "'coordinates'")
    else:
        raise ValueError("its geometry has an unknown 'type'")
    read = tuple(
        tuple(_ring(ring) for ring in _list(rings, "'coordinates' of a polygon"))
        for rings in polygons
    )
    return Feature(own, str(shape), read, properties)


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
