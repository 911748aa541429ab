"""Maps of ROS' map_server: a `.yaml` beside an image, as map_saver and `volery slam` write them.

Keys and modes are those of nav2_map_server (and ROS 1): a pixel's darkness is compared with
`occupied_thresh` and `free_thresh`, unless `mode` is `raw`, where a pixel is an occupancy value. A
transparent pixel is unknown; the lightness of a colour is the mean of red, green and blue.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.text_files import read_text
from volery.world.grid_maps.image_files import read_image

_MAX_BYTES = 64_000
_MODES = ("trinary", "scale", "raw")
_FLAGS = {"no": 0.0, "off": 0.0, "false": 0.0, "yes": 1.0, "on": 1.0, "true": 1.0}
_BLOCKED_FROM = 50.0
"""Occupancy from which a cell is blocked, as of `nav_msgs/OccupancyGrid`."""


class MapServerFile(NamedTuple):
    """A map and its pose.

    blocked, unknown: (rows, columns), row 0 at the lowest y. cell_m: side of a cell, m. origin_m,
    yaw_rad: of the outer corner of the first cell, in the map.
    """

    blocked: NDArray[np.bool_]
    unknown: NDArray[np.bool_]
    cell_m: float
    origin_m: tuple[float, float]
    yaw_rad: float


def read_map_server(path: Path) -> MapServerFile:
    """Reads a `.yaml` file and its image; raises `DataFileError` with file and key."""
    settings = _settings(path)
    mode = str(settings.get("mode", "trinary")).lower()
    if mode not in _MODES:
        raise DataFileError(f"{path}: mode is '{mode[:20]}'; allowed are {', '.join(_MODES)}")
    occupied = _number(path, settings, "occupied_thresh", 0.65, 0.0, 1.0)
    free = _number(path, settings, "free_thresh", 0.25, 0.0, 1.0)
    if mode != "raw" and not free < occupied:
        raise DataFileError(
            f"{path}: free_thresh is {free:g}; it must be below occupied_thresh, {occupied:g}"
        )
    cell_m = _number(path, settings, "resolution", None, 0.001, 1000.0)
    x, y, yaw = _origin(path, settings)
    light, seen = read_image(_image(path, settings))
    unknown = ~seen
    if mode == "raw":
        value = np.round(light * 255.0)
        unknown |= value > 100.0
        blocked = (value >= _BLOCKED_FROM) & ~unknown
    else:
        negate = bool(_number(path, settings, "negate", 0.0, 0.0, 1.0, _FLAGS))
        dark = light if negate else 1.0 - light
        blocked = (dark > occupied) & seen
        if mode == "trinary":
            unknown |= (dark >= free) & ~blocked
        else:
            blocked = (np.round((dark - free) / (occupied - free) * 100.0) >= _BLOCKED_FROM) & seen
    return MapServerFile(
        np.ascontiguousarray(blocked[::-1]),
        np.ascontiguousarray(unknown[::-1]),
        cell_m,
        (x, y),
        yaw,
    )


def write_with_image(path: Path, image: str) -> None:
    """Rewrites a `.yaml` file so that it names another image; raises `DataFileError` with file."""
    settings = _settings(path) | {"image": image}
    path.write_text(json.dumps(settings, indent=1, default=str), encoding="utf-8")  # is YAML


def _settings(path: Path) -> dict[str, Any]:
    from ruamel.yaml import YAML

    try:
        if path.stat().st_size > _MAX_BYTES:
            raise DataFileError(f"{path}: too large for a map's .yaml")
        read = YAML(typ="safe", pure=True).load(read_text(path))
    except OSError as error:
        raise DataFileError(f"{path}: cannot be read: {error.strerror}") from None
    except DataFileError:
        raise
    except Exception as error:  # the parser raises any exception for broken text
        raise DataFileError(f"{path}: not YAML: {' '.join(str(error).split())[:200]}") from None
    if not isinstance(read, dict) or "image" not in read:
        raise DataFileError(f"{path}: a map of map_server has the keys image, resolution, origin")
    return read


def _number(
    path: Path,
    settings: dict[str, Any],
    key: str,
    default: float | None,
    minimum: float,
    maximum: float,
    words: Mapping[str, float] = MappingProxyType({}),
) -> float:
    """Returns a number, which may be in quotes; words: others that YAML 1.1 knows."""
    value = settings.get(key, default)
    if isinstance(value, str):
        with suppress(ValueError):  # is shown below
            value = words[value.lower()] if value.lower() in words else float(value)
    if not isinstance(value, int | float) or not minimum <= value <= maximum:
        shown = "missing" if value is None else f"{value!r}"[:40]
        raise DataFileError(f"{path}: {key} is {shown}; allowed are {minimum:g} to {maximum:g}")
    return float(value)


def _origin(path: Path, settings: dict[str, Any]) -> tuple[float, float, float]:
    value = settings.get("origin")
    numbers = value if isinstance(value, list) else []
    if len(numbers) not in (2, 3) or not all(
        isinstance(n, int | float) and math.isfinite(n) for n in numbers
    ):
        raise DataFileError(f"{path}: origin must be [x, y, yaw] in m and rad")
    x, y, yaw = (*map(float, numbers), 0.0)[:3]
    return x, y, yaw


def _image(path: Path, settings: dict[str, Any]) -> Path:
    """Returns the image in or below the folder; one that was saved elsewhere lies beside it."""
    name = str(settings["image"])
    folder = path.parent
    inside = (folder / name).resolve()
    if inside.is_relative_to(folder.resolve()) and inside.is_file():
        return inside
    beside = folder / PurePosixPath(name.replace("\\", "/")).name
    if beside.is_file():
        return beside
    raise DataFileError(f"{path}: no image '{name[:200]}' in its folder")
