"""Builds a scenario around a file: flat ground, and two F450s beside the obstacles.

text = toml_of("grid_map", Path("map.png"), "yard", "yard.png")
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import DataFileError
from volery.core.geodesy import LocalFrame
from volery.core.plurals import counted
from volery.server.uploads.kinds import (
    IMAGES,
    MAP_SERVER,
    MAX_CELLS,
    MAX_CORNERS,
    MAX_CROWDING,
    MAX_DISTANCE_M,
    MAX_OVERLAPS,
    MAX_TREES,
    MAX_TRIANGLES,
    MAX_WALLS_M,
)
from volery.world.city.geojson import read_features
from volery.world.city.selection import select_buildings
from volery.world.grid_maps.map_server import read_map_server, write_with_image
from volery.world.grid_maps.parsing import read_cells
from volery.world.inventory import read_inventory
from volery.world.mesh_files import read_mesh

_CELL_M, _BLOCK_M = 2.0, 5.0
"""Cell size with room for an F450 (0.5 m wide) between blocks, and height above its usual
flight.
"""
_MARGIN_M = 30.0
"""Margin of ground around the obstacles."""
_BESIDE_M = 5.0
_MIN_EXTENT_M = 150.0
_CITY_HALF_WIDTH_M = 2_000.0
"""Half the side of the part of a city that is used."""
_NEAR_M = 16.0
_ROWS = 64
"""Outlines that are compared with all others at once."""


class _Part(NamedTuple):
    """The part of a scenario that a file defines."""

    world: str
    """TOML of the world."""
    extent_m: float
    """Max distance of obstacles from the origin."""
    first_m: tuple[float, float]
    last_m: tuple[float, float]
    """Start positions of the UAVs."""


def toml_of(kind: str, path: Path, name: str, called: str) -> str:
    """Returns the TOML of a scenario `name` around the file `path` in the same folder.

    called: the client's file name, for messages. Raises DataFileError for a file that cannot be
    read, or is too large to show in a browser.
    """
    part = _MAKERS[kind](path)
    if not part.extent_m <= MAX_DISTANCE_M:
        raise DataFileError(
            f"{path} reaches {part.extent_m:.0f} m from the origin; at most {MAX_DISTANCE_M:.0f} m "
            "are allowed: are its coordinates metres from a nearby origin?"
        )
    extent = max(_MIN_EXTENT_M, math.ceil(part.extent_m + _MARGIN_M))
    shown = "".join(c if c.isascii() and c.isprintable() else "?" for c in called)[:80]
    template = Path(__file__).with_name("scenario_template.txt").read_text(encoding="utf-8")
    return template.format(
        name=name,
        description=json.dumps(f"Two F450s and the content of {shown}."),
        extent=float(extent),
        world=part.world,
        first=_numbers(part.first_m),
        last=_numbers(part.last_m),
    )


def _grid_map(path: Path) -> _Part:
    if path.suffix == MAP_SERVER:
        return _map_server(path)
    rows, columns = read_cells(path).shape
    _check_cells(path, rows, columns)
    width, height = columns * _CELL_M, rows * _CELL_M
    corner = (-width / 2.0, -height / 2.0)
    world = (
        "[world.grid_map]\n"
        f'maps = [{{ file = {json.dumps(path.name)}, name = "uploaded" }}]\n'
        f"cell_size_m = {_CELL_M}\nblock_height_m = {_BLOCK_M}\n"
        f"origin_m = {_numbers(corner)}\n"
    )
    return _Part(world, max(width, height) / 2.0, *_beside(corner[0]))


def _map_server(path: Path) -> _Part:
    """The image lies beside the file, under the same name with its own suffix."""
    image = next(path.with_suffix(s) for s in IMAGES if path.with_suffix(s).is_file())
    write_with_image(path, image.name)
    file = read_map_server(path)
    rows, columns = file.blocked.shape
    _check_cells(path, rows, columns)
    across, up = columns * file.cell_m, rows * file.cell_m
    cos, sin = math.cos(file.yaw_rad), math.sin(file.yaw_rad)
    corners = np.array([(0.0, 0.0), (across, 0.0), (0.0, up), (across, up)])
    corners = corners @ np.array([[cos, sin], [-sin, cos]]) + file.origin_m
    world = (
        "[world.grid_map]\n"
        f'maps = [{{ file = {json.dumps(path.name)}, name = "uploaded" }}]\n'
        f"block_height_m = {_BLOCK_M}\n"
    )
    (west, south), (_, north) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return _Part(world, float(np.abs(corners).max()), *_beside(west, (south + north) / 2.0))


def _city(path: Path) -> _Part:
    features = select_buildings(read_features(path)).buildings
    rings = [ring for feature in features for polygon in feature.polygons for ring in polygon]
    if not any(len(ring) for ring in rings):
        raise DataFileError(f"{path}: the file holds no outline of a building")
    corners = np.concatenate(rings)
    longitude, latitude = ((corners.min(axis=0) + corners.max(axis=0)) / 2.0).tolist()
    frame = LocalFrame.from_degrees(latitude, longitude, 0.0)
    radians = np.radians(corners[:, ::-1])
    positions = frame.enu_from_geodetic(np.pad(radians, ((0, 0), (0, 1))))
    ends = np.cumsum([len(ring) for ring in rings])[:-1]
    _check_outlines(path, [ring for ring in np.split(positions[:, :2], ends) if len(ring)])
    half_width_m = min(float(np.abs(positions[:, :2]).max()) + 1.0, _CITY_HALF_WIDTH_M)
    world = (
        f"[world.origin]\nlatitude_deg = {latitude!r}\nlongitude_deg = {longitude!r}\n"
        f"altitude_m = 0.0\n[world.city]\nfile = {json.dumps(path.name)}\n"
        f"region_m = {_numbers((-half_width_m, -half_width_m, half_width_m, half_width_m))}\n"
    )
    return _Part(world, half_width_m + _MARGIN_M, (0.0, 0.0), (5.0, 0.0))


def _check_outlines(path: Path, rings: list[Array]) -> None:
    """Raises DataFileError for outlines, as rings (n, 2) in m, that would take minutes to build."""
    low = np.array([ring.min(axis=0) for ring in rings])
    high = np.array([ring.max(axis=0) for ring in rings])
    used = (np.abs(low + high) / 2.0 <= _CITY_HALF_WIDTH_M).all(axis=1)
    rings = [ring for ring, is_used in zip(rings, used.tolist(), strict=True) if is_used]
    count = sum(len(ring) for ring in rings)
    if count > MAX_CORNERS:
        raise DataFileError(f"{path}: {count} corners; at most {MAX_CORNERS} are allowed")
    if rings:
        _check_walls(path, rings)
        _check_overlaps(path, low[used], high[used])


def _check_walls(path: Path, rings: list[Array]) -> None:
    """Raises DataFileError for walls that are too long, or too many in one place."""
    start = np.concatenate([ring[:-1] for ring in rings])
    vectors = np.concatenate([np.diff(ring, axis=0) for ring in rings])
    length = np.hypot(vectors[:, 0], vectors[:, 1])
    if length.sum() > MAX_WALLS_M:
        raise DataFileError(f"{path}: its walls are too long: {length.sum() / 1000.0:.0f} km")
    pieces = np.maximum(np.ceil(2.0 * length / _NEAR_M), 1.0).astype(np.int64)
    wall = np.repeat(np.arange(len(pieces)), pieces)
    number = np.arange(len(wall)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    middle = start[wall] + vectors[wall] * ((number + 0.5) / pieces[wall])[:, None]
    cell = np.floor(middle / _NEAR_M).astype(np.int64)
    _, there = np.unique(cell[:, 0] * (1 << 32) + cell[:, 1], return_counts=True)
    if float((there.astype(np.float64) ** 2).sum()) > MAX_CROWDING:
        raise DataFileError(f"{path}: its walls are too dense: simplify the outlines")


def _check_overlaps(path: Path, low: Array, high: Array) -> None:
    """Raises DataFileError for too many boxes (N, 2) that overlap, which are compared in pairs."""
    overlaps = 0
    for first in range(0, len(low), _ROWS):
        rows = slice(first, first + _ROWS)
        apart = (low[rows, None] > high[None]) | (low[None] > high[rows, None])
        overlaps += int((~apart.any(axis=2)).sum())
        if overlaps - len(low) > 2 * MAX_OVERLAPS:
            raise DataFileError(f"{path}: more than {MAX_OVERLAPS} pairs of outlines overlap")


def _mesh(path: Path) -> _Part:
    file = read_mesh(path)
    count = len(file.triangles)
    if count > MAX_TRIANGLES:
        raise DataFileError(f"{path}: {count} triangles; at most {MAX_TRIANGLES} are allowed")
    low, high = file.points.min(axis=0), file.points.max(axis=0)
    middle = (low + high) / 2.0
    position = (-float(middle[0]), -float(middle[1]), -float(low[2]))
    half = float((high - low)[:2].max()) / 2.0
    world = (
        f'[[world.meshes]]\nfile = {json.dumps(path.name)}\nname = "uploaded"\n'
        f"position_m = {_numbers(position)}\n"
    )
    return _Part(world, half, *_beside(-half))


def _forest(path: Path) -> _Part:
    inventory = read_inventory(path)
    if not 0 < len(inventory) <= MAX_TREES:
        raise DataFileError(
            f"{path}: {counted(len(inventory), 'tree')}; allowed are 1 to {MAX_TREES}"
        )
    low, high = inventory.position.min(axis=0), inventory.position.max(axis=0)
    world = (
        f'[world.forest]\nkind = "inventory"\nfile = {json.dumps(path.name)}\n'
        'species = "broadleaf"\n'
    )
    if float(np.abs([low, high]).max()) > MAX_DISTANCE_M:  # projected coordinates
        middle = np.round((low + high) / 2.0)
        low, high = low - middle, high - middle
        world += f"position_m = {_numbers((-float(middle[0]), -float(middle[1])))}\n"
    y = float(low[1] + high[1]) / 2.0
    extent = float(np.abs([low, high]).max()) + _BESIDE_M
    return _Part(world, extent, *_beside(float(low[0]), y))


def _check_cells(path: Path, rows: int, columns: int) -> None:
    if rows * columns > MAX_CELLS:
        raise DataFileError(f"{path}: {columns} x {rows} cells; at most {MAX_CELLS} are allowed")


def _beside(x: float, y: float = 0.0) -> tuple[tuple[float, float], tuple[float, float]]:
    """Returns two positions west of x, around y."""
    return (x - _BESIDE_M, y - _BESIDE_M), (x - _BESIDE_M, y + _BESIDE_M)


def _numbers(values: tuple[float, ...]) -> str:
    return f"[{', '.join(repr(round(float(value), 6)) for value in values)}]"


_MAKERS: dict[str, Callable[[Path], _Part]] = {
    "grid_map": _grid_map,
    "city": _city,
    "mesh": _mesh,
    "forest": _forest,
}
