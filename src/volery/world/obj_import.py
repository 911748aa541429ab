"""Reads the faces of Wavefront OBJ files, with the diffuse colours of their materials.

Wavefront, "Appendix B1. Object Files (.obj)" and "Appendix B2. Material Library File (.mtl)":
indices count from 1, negative ones back from the latest vertex above the face; a backslash joins a
line to the next. Faces may have any number of corners and be concave. Points, lines, curves,
normals, textures and groups are ignored.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.world.gltf_import import Part
from volery.world.polygons import triangulated

_SHOWN = 40
"""Maximum characters of a line that an error shows."""
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class _Faces:
    """Content of a file as it is read."""

    def __init__(self) -> None:
        self.points: list[tuple[float, float, float]] = []
        self.corners: list[int] = []
        self.sizes: list[int] = []
        self.lines: list[int] = []
        self.materials: list[int] = []
        self.names: dict[bytes, int] = {b"": 0}
        self.libraries: list[bytes] = []
        self.triangles = 0


def read_obj(data: bytes, material_file: Callable[[str], bytes], max_triangles: int) -> list[Part]:
    """Returns a part for each material of a file's content, in the order of their first use.

    material_file: returns the content of a file of materials; an `OSError` means that there is
    none. Raises `ValueError` with the line for broken content.
    """
    if b"\0" in data:
        is_utf_16 = data.startswith((b"\xff\xfe", b"\xfe\xff"))
        raise ValueError("it is text in UTF-16; save it as UTF-8" if is_utf_16 else "it is no text")
    faces = _Faces()
    material = 0
    for number, line in _lines(data):
        words = line.split()
        key = words[0] if words else b""
        if key == b"v":
            faces.points.append(_point(number, words))
        elif key in (b"f", b"fo"):
            _add_face(faces, number, words[1:], material)
            if faces.triangles > max_triangles:
                raise ValueError(f"it has more than {max_triangles:,} triangles")
        elif key == b"usemtl":
            name = line.split(None, 1)[1].strip() if len(words) > 1 else b""
            material = faces.names.setdefault(name, len(faces.names))
        elif key == b"mtllib" and len(words) > 1:
            faces.libraries.append(line.split(None, 1)[1].strip())
    return _parts(faces, material_file)


def _lines(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yields lines with their numbers; continued ones are joined under the number of the first."""
    begun, joined = 0, b""
    for number, line in enumerate(data.removeprefix(_BYTE_ORDER_MARK).splitlines(), 1):
        if line.rstrip().endswith(b"\\") and not line.lstrip().startswith(b"#"):
            begun, joined = begun or number, joined + line.rstrip()[:-1] + b" "
            continue
        yield (begun, joined + line) if begun else (number, line)
        begun, joined = 0, b""
    if begun:
        yield begun, joined


def _point(number: int, words: list[bytes]) -> tuple[float, float, float]:
    """Returns the position; weights and colours after it are ignored."""
    try:
        return float(words[1]), float(words[2]), float(words[3])
    except (ValueError, IndexError):
        hint = " with decimal points" if any(b"," in word for word in words) else ""
        raise ValueError(
            f"line {number}: '{_shown(words)}'; a vertex needs three numbers{hint}"
        ) from None


def _add_face(faces: _Faces, number: int, words: list[bytes], material: int) -> None:
    size, known = 0, len(faces.points)
    try:
        for word in words:
            if word.startswith(b"#"):
                break
            index = int(word.partition(b"/")[0])
            row = index - 1 if index > 0 else known + index
            if index == 0 or row < 0:
                raise ValueError
            faces.corners.append(row)
            size += 1
    except ValueError:
        raise ValueError(
            f"line {number}: 'f {_shown(words)}'; corners are whole numbers, from 1 or back "
            f"to {-known}"
        ) from None
    if not size:
        return
    for _ in range(3 - size):  # a point or a line: without an area, dropped and counted later
        faces.corners.append(faces.corners[-1])
    size = max(size, 3)
    faces.sizes.append(size)
    faces.lines.append(number)
    faces.materials.append(material)
    faces.triangles += size - 2


def _parts(faces: _Faces, material_file: Callable[[str], bytes]) -> list[Part]:
    if not faces.sizes:
        return []
    points = np.array(faces.points, dtype=np.float64).reshape(-1, 3)
    corners, sizes = np.array(faces.corners), np.array(faces.sizes)
    _check(corners, sizes, faces)
    with np.errstate(all="ignore"):  # vertices that are not finite are reported by the caller
        triangles, owner = triangulated(points, corners, sizes)
    material = np.array(faces.materials)[owner]
    colours = _colours(faces.libraries, material_file)
    parts = []
    for name, code in faces.names.items():
        own = triangles[material == code]
        if len(own):
            rows, compact = np.unique(own, return_inverse=True)
            parts.append(Part(points[rows], compact.reshape(-1, 3), colours.get(name)))
    return parts


def _check(corners: NDArray[np.int64], sizes: NDArray[np.int64], faces: _Faces) -> None:
    """Raises `ValueError` for corners beyond the last vertex; those below a face are allowed."""
    wrong = np.flatnonzero(corners >= len(faces.points))
    if len(wrong):
        line = faces.lines[int(np.searchsorted(np.cumsum(sizes), wrong[0], side="right"))]
        raise ValueError(
            f"line {line}: a face has vertex {corners[wrong[0]] + 1}; the file has "
            f"{len(faces.points)}"
        )


def _colours(libraries: list[bytes], material_file: Callable[[str], bytes]) -> dict[bytes, Array]:
    """Returns the linear diffuse colours of the materials in a file's libraries."""
    colours: dict[bytes, Array] = {}
    for names in libraries:
        for name in dict.fromkeys([names, *names.split()]):  # names may contain blanks
            try:
                content = material_file(name.decode("utf-8", "replace"))
            except (OSError, ValueError):
                continue
            _add_colours(colours, content)
    return colours


def _add_colours(colours: dict[bytes, Array], content: bytes) -> None:
    material = b""
    for line in content.removeprefix(_BYTE_ORDER_MARK).splitlines():
        words = line.split()
        if len(words) > 1 and words[0] == b"newmtl":
            material = line.split(None, 1)[1].strip()
        elif len(words) > 3 and words[0] == b"Kd":
            try:
                kd = np.array([float(word) for word in words[1:4]])
            except ValueError:  # of a spectral file, or CIE XYZ
                continue
            if np.isfinite(kd).all():
                colours[material] = _linear(np.round(kd.clip(0.0, 1.0) * 255.0) / 255.0)


def _linear(coded: Array) -> Array:
    """Returns linear values of colours coded as sRGB."""
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def _shown(words: list[bytes]) -> str:
    text = b" ".join(words).decode("latin-1")
    return "".join(c if c.isprintable() else "?" for c in text[:_SHOWN])
