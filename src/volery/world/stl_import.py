"""Reads the triangles of STL files, binary and text.

A binary file has a header of 80 bytes, the number of its triangles and 50 bytes for each (M. Burns,
Automated Fabrication, 1993, section 6.5). Programs add bytes after them, leave the number 0, or
append one file to another: what is there is read, what is missing is an error. Normals and colours
are ignored.
"""

from __future__ import annotations

import numpy as np

from volery.world.gltf_import import Part
from volery.world.polygons import triangulated

_HEAD = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes, most_triangles: int) -> list[Part]:
    """Returns the surface of a file's content; raises `ValueError` for damaged ones."""
    corners = _binary(data, most_triangles)
    if corners is None:
        if b"\0" in data:
            raise ValueError(_not_whole(data))
        return _text(data, most_triangles)
    return [Part(corners, np.arange(len(corners)).reshape(-1, 3), None)]


def _binary(data: bytes, most_triangles: int) -> np.ndarray | None:
    """Returns the corners (3 T, 3) of a binary file; None if it is none."""
    pieces: list[np.ndarray] = []
    begin, total = 0, 0
    while len(data) - begin >= _HEAD:
        count = int.from_bytes(data[begin + _HEAD - 4 : begin + _HEAD], "little")
        room, rest = divmod(len(data) - begin - _HEAD, _TRIANGLE.itemsize)
        if count == 0 and begin == 0 and rest == 0 and b"\0" in data[_HEAD:]:
            count = room  # written by a program that did not know the number at the beginning
        if not 0 < count <= room:
            break
        total += count
        if total > most_triangles:
            raise ValueError(f"it has {total:,} triangles; at most {most_triangles:,} are read")
        rows = np.frombuffer(data, _TRIANGLE, count, begin + _HEAD)
        pieces.append(rows["corners"].astype(np.float64).reshape(-1, 3))
        begin += _HEAD + count * _TRIANGLE.itemsize
    return np.concatenate(pieces) if pieces else None


def _not_whole(data: bytes) -> str:
    if len(data) < _HEAD:
        return f"it is no text, and {len(data)} bytes are too few for a binary STL"
    count = int.from_bytes(data[_HEAD - 4 : _HEAD], "little")
    if not count:
        return "it is a binary STL without a triangle"
    need = _HEAD + count * _TRIANGLE.itemsize
    return (
        f"it is no text, and as a binary STL its header announces {count:,} triangles, "
        f"{need:,} bytes; it has {len(data):,}"
    )


def _text(data: bytes, most_triangles: int) -> list[Part]:
    points: list[tuple[float, float, float]] = []
    sizes: list[int] = []
    first = triangles = 0
    for number, line in enumerate(data.splitlines(), 1):
        words = line.split()
        key = words[0].lower() if words else b""
        if key == b"vertex":
            try:
                x, y, z = map(float, words[1:])
            except ValueError:
                raise ValueError(f"line {number}: a vertex needs three numbers") from None
            points.append((x, y, z))
        elif key == b"endloop":
            size = len(points) - first
            if size < 3:
                raise ValueError(f"line {number}: a facet of {size} corners; 3 are needed")
            sizes.append(size)
            triangles += size - 2
            first = len(points)
            if triangles > most_triangles:
                raise ValueError(f"it has more than {most_triangles:,} triangles")
    if first < len(points):
        raise ValueError("it ends within a facet: 'endloop' is missing")
    if not sizes:
        return []
    places = np.array(points, dtype=np.float64)
    if not np.isfinite(places).all():  # told with its vertex by the caller
        return [Part(places, np.array([[0, 1, 2]]), None)]
    rows, _ = triangulated(places, np.arange(len(places)), np.array(sizes))
    return [Part(places, rows, None)]
