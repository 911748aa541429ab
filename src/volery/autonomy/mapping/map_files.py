"""Reads and writes OctoMap's files `.bt`: a head in plain text, then a binary stream."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.octomap_stream import Voxels, decode_binary
from volery.core.errors import DataFileError
from volery.core.plurals import counted
from volery.core.whole_files import write_whole

Bytes = NDArray[np.uint8]

_FIRST = b"# Octomap OcTree binary file"
_DATA = b"\ndata\n"
_HEAD_BYTES = 4096
"""Max length of a head."""


class MapFile(NamedTuple):
    """Content of a `.bt` file."""

    resolution_m: float
    data: Bytes
    """Binary stream."""
    voxels: Voxels


class MapLimits(NamedTuple):
    """Limits of the maps that a node accepts."""

    resolution_m: float
    extent_m: float
    """Max width, along each axis."""
    cubes: int
    """Max number of known cubes."""


def write_map(path: Path, data: Bytes, resolution_m: float) -> None:
    """Writes a binary stream as `.bt`. Raises DataFileError if the file cannot be written."""
    head = f"{_FIRST.decode()}\n# written by Volery\nid OcTree\nsize {node_count(data)}\n"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, f"{head}res {resolution_m:g}".encode() + _DATA + data.tobytes())
    except OSError as error:
        raise DataFileError(f"{path}: the map cannot be written: {error.strerror}") from None


def read_map(path: Path, limits: MapLimits) -> MapFile:
    """Reads a `.bt` file. Raises DataFileError if it is invalid or beyond the limits."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise DataFileError(f"{path}: the map cannot be read: {error.strerror}") from None
    end = content.find(_DATA, 0, _HEAD_BYTES)
    if not content.startswith(_FIRST) or end < 0:
        raise DataFileError(f"{path}: not a map: a .bt file begins with '{_FIRST.decode()}'")
    head = dict(
        line.split(maxsplit=1)
        for line in content[:end].decode("ascii", "replace").splitlines()
        if not line.startswith("#") and len(line.split()) > 1
    )
    if head.get("id") != "OcTree":
        raise DataFileError(f"{path}: a map of kind '{head.get('id')}'; only OcTree is allowed")
    resolution = _number(path, head, "res")
    if abs(resolution - limits.resolution_m) > 1e-6:
        raise DataFileError(
            f"{path}: the map's cells are {resolution:g} m wide; this node works with "
            f"{limits.resolution_m:g} m (parameter resolution_m)"
        )
    data = np.frombuffer(content[end + len(_DATA) :], np.uint8)
    try:
        voxels = decode_binary(data)
    except DataFileError as error:
        raise DataFileError(f"{path}: {error}") from None
    said, found = int(_number(path, head, "size")), node_count(data)
    if said != found:
        raise DataFileError(
            f"{path}: the head declares {counted(said, 'node')}, the file has {found}"
        )
    _check_size(path, voxels, limits)
    return MapFile(resolution, data, voxels)


def node_count(data: Bytes) -> int:
    """Returns the number of tree nodes of a binary stream."""
    if len(data) == 0:
        return 0
    kinds = np.stack([(data >> shift) & 3 for shift in (0, 2, 4, 6)])
    return 1 + int(np.count_nonzero(kinds))


def _check_size(path: Path, voxels: Voxels, limits: MapLimits) -> None:
    if voxels.size > limits.cubes:
        raise DataFileError(
            f"{path}: the map has {voxels.size} cubes; at most {limits.cubes} are allowed"
        )
    if voxels.size == 0:
        return
    low = voxels.corner.min(axis=0)
    high = (voxels.corner + voxels.side[:, None]).max(axis=0)
    extent = float((high - low).max()) * limits.resolution_m
    if extent > limits.extent_m:
        raise DataFileError(
            f"{path}: the map is {extent:g} m wide; at most {limits.extent_m:g} m are allowed "
            "(parameter extent_m)"
        )


def _number(path: Path, head: dict[str, str], key: str) -> float:
    try:
        return float(head[key])
    except (KeyError, ValueError):
        raise DataFileError(f"{path}: the head of the map lacks a number '{key}'") from None
