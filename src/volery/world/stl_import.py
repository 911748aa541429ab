"""Reads the triangles of STL files, binary and text.

A binary file has a header of 80 bytes, the number of its triangles and 50 bytes for each (M. Burns,
Automated Fabrication, 1993, section 6.5). Programs add bytes after them, leave a number that stands
for an unknown one, or append one file to another: what is there is read, what is missing is an
error. Normals and colours are ignored.
"""

from __future__ import annotations

import re

import numpy as np

from volery.world.gltf_import import Part
from volery.world.polygons import triangulated

_HEAD = 84
_UNKNOWN_COUNTS = (0, 0x7FFFFFFF, 0xFFFFFFFF)
"""Numbers of triangles of programs that write the header first and do not return to it.

Any other number that is larger than the file is that of a file that is cut off.
"""
_MAX_WORDS = 5
_ENDS = (b"endloop", b"end", b"endfacet", b"facet", b"endsolid")
"""Statements that end a loop; some programs write `end loop`, or leave one out."""
_STATEMENT = re.compile(
    rb"\b(?:facet|outer|vertex|end\s*loop|end\s*facet|endsolid)\b", re.IGNORECASE
)
_PADDING = b"\0\x1a"
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes, max_triangles: int) -> list[Part]:
    """Returns the surface of a file's content; raises `ValueError` for damaged ones."""
    corners = _binary(data, max_triangles)
    if corners is None:
        if data.startswith(_UTF_16):
            raise ValueError("it is text in UTF-16; save it as UTF-8")
        text = data.rstrip(_PADDING)
        if b"\0" in text or (text != data and b"vertex" not in text.lower()):
            raise ValueError(_not_whole(data))
        return _text(text, max_triangles)
    return [Part(corners, np.arange(len(corners)).reshape(-1, 3), None)]


def _binary(data: bytes, max_triangles: int) -> np.ndarray | None:
    """Returns the corners (3 T, 3) of a binary file; None if it is none."""
    pieces: list[np.ndarray] = []
    begin, total = 0, 0
    while len(data) - begin >= _HEAD:
        count = int.from_bytes(data[begin + _HEAD - 4 : begin + _HEAD], "little")
        room, rest = divmod(len(data) - begin - _HEAD, _TRIANGLE.itemsize)
        is_unknown = count in _UNKNOWN_COUNTS and begin == 0 and rest == 0
        if is_unknown and b"\0" in data[_HEAD:]:
            count = room
        if not 0 < count <= room:
            break
        total += count
        if total > max_triangles:
            raise ValueError(f"it has {total:,} triangles; at most {max_triangles:,} are read")
        rows = np.frombuffer(data, _TRIANGLE, count, begin + _HEAD)
        pieces.append(rows["corners"].astype(np.float64).reshape(-1, 3))
        begin += _HEAD + count * _TRIANGLE.itemsize
    return np.concatenate(pieces) if pieces else None


def _not_whole(data: bytes) -> str:
    if len(data) < _HEAD:
        return f"it is no text, and {len(data)} bytes are too few for a binary STL"
    count = int.from_bytes(data[_HEAD - 4 : _HEAD], "little")
    if count in _UNKNOWN_COUNTS:
        if len(data) - _HEAD < _TRIANGLE.itemsize:
            return "it is a binary STL without a triangle"
        return "it is cut off: its triangles of 50 bytes each are not whole"
    need = _HEAD + count * _TRIANGLE.itemsize
    return (
        f"it is no text, and as a binary STL its header announces {count:,} triangles, "
        f"{need:,} bytes; it has {len(data):,}"
    )


def _text(data: bytes, max_triangles: int) -> list[Part]:
    points: list[tuple[float, float, float]] = []
    sizes: list[int] = []
    first = triangles = 0
    is_open, words = False, list[bytes]()
    for number, line in enumerate(data.splitlines(), 1):
        for words in filter(None, _statements(line)):
            key = words[0].lower()
            is_open = key == b"facet" or (is_open and not _is_end_of_facet(key, words))
            if key == b"vertex":
                points.append(_vertex(number, words))
            elif key in _ENDS and len(points) > first:
                size = len(points) - first
                if size < 3:
                    raise ValueError(f"line {number}: a facet of {size} corners; 3 are needed")
                sizes.append(size)
                triangles += size - 2
                first = len(points)
                if triangles > max_triangles:
                    raise ValueError(f"it has more than {max_triangles:,} triangles")
    if first < len(points):
        raise ValueError("it is cut off within a facet: 'endloop' is missing")
    if is_open:
        raise ValueError("it is cut off within a facet: 'endfacet' is missing")
    if not sizes:
        return []
    last = words[-1].lower()
    if b"facet".startswith(last) and words[0].lower() not in (b"solid", b"endsolid", b"end"):
        raise ValueError(f"it is cut off: its last word is '{last.decode()}'")
    vertices = np.array(points, dtype=np.float64)
    if not np.isfinite(vertices).all():  # reported with its vertex by the caller
        return [Part(vertices, np.array([[0, 1, 2]]), None)]
    rows, _ = triangulated(vertices, np.arange(len(vertices)), np.array(sizes))
    return [Part(vertices, rows, None)]


def _statements(line: bytes) -> list[list[bytes]]:
    """Returns the words of each statement: usually one a line, of at most five words."""
    words = line.split()
    if len(words) <= _MAX_WORDS:
        return [words]
    begins = [m.start() for m in _STATEMENT.finditer(line)]
    if words[0].lower() in (b"solid", b"endsolid") and len(begins) < _MAX_WORDS:
        return [words]  # words of a name
    begins = [0, *begins]
    return [line[a:b].split() for a, b in zip(begins, [*begins[1:], len(line)], strict=True)]


def _is_end_of_facet(key: bytes, words: list[bytes]) -> bool:
    if key == b"end":
        return b"".join(words[1:2]).lower() in (b"facet", b"solid")
    return key in (b"endfacet", b"endsolid")


def _vertex(number: int, words: list[bytes]) -> tuple[float, float, float]:
    try:
        x, y, z = map(float, words[1:])
    except ValueError:
        hint = " with decimal points" if any(b"," in word for word in words) else ""
        raise ValueError(f"line {number}: a vertex needs three numbers{hint}") from None
    return x, y, z
