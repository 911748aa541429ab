"""Kinds of uploaded files, and their limits."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import NamedTuple

from volery.server.bounded_process import ProcessBounds
from volery.server.replies import RefusedError

BOUNDS = ProcessBounds(memory_bytes=8 << 30, cpu_s=90, wall_s=300.0)
"""Of the checking process; Embree and the compiler reserve a gigabyte that they do not use."""


class Kind(NamedTuple):
    """One kind of upload. The readers of such files have limits of their own."""

    suffixes: tuple[str, ...]
    max_bytes: int
    what: str


SCENARIO = "scenario"
"""Kind of a whole scenario; the others are worlds to which the server adds UAVs."""
MAP_SERVER = ".yaml"
"""Suffix of a map of map_server, which comes together with its image."""
IMAGES = (".pgm", ".png")
"""Suffixes of such an image."""
KINDS = {
    "grid_map": Kind(
        (".csv", ".txt", ".png", ".map", MAP_SERVER), 8_000_000, "a matrix of 0 and 1"
    ),
    "city": Kind(
        (".geojson", ".json", ".geojsonl", ".geojsons"),
        32_000_000,
        "outlines of buildings as GeoJSON",
    ),
    "mesh": Kind((".glb", ".obj", ".stl"), 64_000_000, "a mesh in metres"),
    "forest": Kind((".csv",), 8_000_000, "trees: x_m, y_m[, dbh_cm, height_m, species]"),
    SCENARIO: Kind((".toml",), 256_000, "a scenario"),
}
MAX_UPLOADS = 200
"""Max number of scenarios in the folder."""
MAX_UAVS = 1_000
"""Max number in a scenario."""
MAX_CELLS = 1_000_000
MAX_TREES = 50_000
MAX_CORNERS = 100_000
"""Max number of corners of outlines."""
MAX_CROWDING = 10_000_000
"""Max sum of the squares of the numbers of walls in all squares of 16 m, half a street's width.

The time to find streets grows with it, up to about 12 s. Of the 559 outlines of central Helsinki it
is below 100,000.
"""
MAX_WALLS_M = 16_000_000.0
"""Max length of all walls."""
MAX_OVERLAPS = 200_000
"""Max number of pairs of outlines whose bounding boxes overlap."""
MAX_TRIANGLES = 2_000_000
MAX_DISTANCE_M = 5_000.0
"""Max distance from the map's origin."""


def kind_of_upload(name: str) -> Kind:
    """Returns a kind by its name. Raises RefusedError with the known kinds."""
    kind = KINDS.get(name)
    if kind is None:
        known = ", ".join(KINDS)
        raise RefusedError(400, f"kind must be one of {known}, not '{name[:40]}'")
    return kind


def suffix_of(file_name: str, kind: Kind) -> str:
    """Returns the suffix of a client's file name. Raises RefusedError if it is not supported."""
    suffix = _suffix(file_name)
    if suffix == ".pgm" and MAP_SERVER in kind.suffixes:
        raise RefusedError(415, "a .pgm comes together with its .yaml: choose both files")
    if suffix not in kind.suffixes:
        allowed = ", ".join(kind.suffixes)
        raise RefusedError(415, f"{kind.what} is read from {allowed}, not from '{suffix[:20]}'")
    return suffix


def image_suffix_of(file_name: str) -> str:
    """Returns the suffix of the image of a .yaml map. Raises RefusedError without an image."""
    suffix = _suffix(file_name)
    if suffix not in IMAGES:
        allowed = " or ".join(IMAGES)
        raise RefusedError(
            415, f"a .yaml comes together with its image, {allowed}: choose both files"
        )
    return suffix


def _suffix(file_name: str) -> str:
    suffix = PurePosixPath(file_name.replace("\\", "/")).suffix.lower()
    return MAP_SERVER if suffix == ".yml" else suffix
