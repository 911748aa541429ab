"""Reads user meshes: glTF, OBJ and STL, with validation.

Textures are ignored; the base colour of the file's largest part is used. All parts become one mesh
in the file's units, z up.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.frames import enu_from_gltf
from volery.core.plurals import counted
from volery.world.gltf_import import Part, read_gltf
from volery.world.mesh import Mesh

MOST_BYTES = 128_000_000
MOST_TRIANGLES = 5_000_000
"""Maximum number of triangles: 5 million take about 1 GB in the ray caster."""
FARTHEST_M = 100_000.0
"""Maximum distance of vertices, which larger scale errors exceed; beyond, 32-bit numbers are
coarser than 4 mm."""
_LARGEST = 1e15
"""Maximum coordinate in a file's units; products of three of them fit 64-bit numbers."""
FORMATS = (".glb", ".gltf", ".obj", ".stl")
_GLTF = (".glb", ".gltf")
_MOST_MATERIAL_BYTES = 4_000_000
_STL_HEAD, _STL_TRIANGLE = 84, 50
"""Bytes of a binary STL: a header with the number of triangles, then each of them."""
_GREY = (0.5, 0.5, 0.5)


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Content of a file: a mesh, z up, in its units; linear (r, g, b) of its largest part."""

    mesh: Mesh
    colour: tuple[float, float, float]
    dropped: int
    """Number of omitted triangles without area."""


def read_mesh(path: str | Path, *, up: Literal["y", "z"] | None = None) -> MeshFile:
    """Reads the mesh of a .glb, .gltf, .obj or .stl file.

    up: the file's vertical axis; None: y for glTF, else z. Raises `DataFileError` for an invalid
    file.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise DataFileError(f"{path}: meshes are read from {', '.join(FORMATS)} files")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise DataFileError(f"mesh {path} cannot be read: {error.strerror}") from None
    if size > MOST_BYTES:
        raise DataFileError(
            f"{path} has {size / 1e6:.0f} MB; at most {MOST_BYTES / 1e6:.0f} MB are read"
        )
    parts = _load(path, kind)
    count = sum(len(part.triangles) for part in parts)
    if not count:
        raise DataFileError(f"{path} has no triangle")
    is_y_up = (up or ("y" if kind in _GLTF else "z")) == "y"
    points, triangles = _joined(path, parts)
    mesh = Mesh((enu_from_gltf(points) if is_y_up else points).astype(np.float32), triangles)
    flat = ~(mesh.face_normals != 0.0).any(axis=1)
    if flat.all():
        raise DataFileError(f"{path}: {counted(count, 'triangle')}, none of which has an area")
    colour = _colour_of_largest(mesh, parts)
    return MeshFile(Mesh(mesh.vertices, mesh.triangles[~flat]), colour, int(flat.sum()))


def _load(path: Path, kind: str) -> list[Part]:
    """Returns the file's parts in its own axes."""
    try:
        if kind in _GLTF:
            with np.errstate(all="ignore"):
                return read_gltf(path, MOST_BYTES, MOST_TRIANGLES)
        with _quiet():
            return _read_other(path)
    except Exception as error:  # the parsers raise any exception for a broken file
        told = " ".join(str(error).split())[:200] or type(error).__name__
        raise DataFileError(f"{path} cannot be read as a mesh: {told}") from None


def _read_other(path: Path) -> list[Part]:
    """Reads OBJ and STL, by trimesh."""
    import trimesh

    _check_text(path)
    materials: Any = _Materials(path.parent)
    scene = trimesh.load_scene(path, process=False, resolver=materials)
    meshes = [part for part in scene.geometry.values() if isinstance(part, trimesh.Trimesh)]
    count = sum(len(part.faces) for part in meshes)
    if count > MOST_TRIANGLES:
        raise ValueError(f"it has {count:,} triangles; at most {MOST_TRIANGLES:,} are read")
    return [
        Part(
            np.asarray(part.vertices, dtype=np.float64),
            np.asarray(part.faces, dtype=np.int64),
            _colour_of(part),
        )
        for part in meshes
        if len(part.faces)
    ]


@contextmanager
def _quiet() -> Iterator[None]:
    """Disables trimesh's log: problems are raised as errors."""
    log = logging.getLogger("trimesh.util")
    was_off, log.disabled = log.disabled, True
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        log.disabled = was_off


class _Materials:
    """Files that an OBJ file may refer to: material files next to it, no images."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def get(self, name: str) -> bytes:
        """Returns the content of a material file; raises `OSError` for any other."""
        path = (self._folder / name).resolve()
        is_material = path.suffix.lower() == ".mtl" and path.is_file()
        if not (is_material and path.is_relative_to(self._folder.resolve())):
            raise FileNotFoundError(name)
        if path.stat().st_size > _MOST_MATERIAL_BYTES:
            raise OSError(f"{name} is too large")
        return path.read_bytes().decode("utf-8", "replace").encode()


def _check_text(path: Path) -> None:
    """Raises `ValueError` for an OBJ or STL file that is neither text nor a complete binary STL.

    trimesh would guess the encoding of such a file.
    """
    data = path.read_bytes()
    if path.suffix.lower() == ".stl" and len(data) >= _STL_HEAD:
        triangles = int.from_bytes(data[_STL_HEAD - 4 : _STL_HEAD], "little")
        if len(data) == _STL_HEAD + _STL_TRIANGLE * triangles:
            return
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        binary = ", and no binary STL of its size" if path.suffix.lower() == ".stl" else ""
        raise ValueError(f"it is no text in UTF-8{binary} (byte {error.start})") from None


def _joined(path: Path, parts: list[Part]) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Returns all parts' vertices and triangles, checked."""
    triangles, first = [], 0
    for points, own, _ in parts:
        if points.shape[1:] != (3,) or own.shape[1:] != (3,):
            raise DataFileError(f"{path}: corners or triangles do not have three numbers each")
        if len(own) and (own.min() < 0 or own.max() >= len(points)):
            raise DataFileError(
                f"{path}: a triangle has vertex {own.max()}; there are {len(points)}"
            )
        triangles.append(own + first)
        first += len(points)
    corners = np.concatenate([part.points for part in parts])
    wrong = np.flatnonzero(~(np.abs(corners) < _LARGEST).all(axis=1))
    if len(wrong):
        raise DataFileError(
            f"{path}: vertices that are not finite numbers below {_LARGEST:g}: {len(wrong)} of "
            f"{len(corners)}; vertex {wrong[0]} is the first"
        )
    return corners, np.concatenate(triangles).astype(np.uint32)


def _colour_of_largest(mesh: Mesh, parts: list[Part]) -> tuple[float, float, float]:
    """Returns the colour of the part with the largest area; grey without a colour."""
    owner = np.repeat(np.arange(len(parts)), [len(part.triangles) for part in parts])
    largest = parts[int(np.argmax(np.bincount(owner, mesh.areas)))].colour
    if largest is None or largest.shape != (3,) or not np.isfinite(largest).all():
        return _GREY
    r, g, b = largest.clip(0.0, 1.0).tolist()
    return r, g, b


def _colour_of(part: Any) -> NDArray[np.float64] | None:
    """Returns the linear diffuse colour of a trimesh material, which is coded as sRGB."""
    main = getattr(getattr(part.visual, "material", None), "main_color", None)
    if main is None:
        return None
    coded = np.asarray(main, dtype=np.float64)[:3] / 255.0
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
