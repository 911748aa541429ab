"""Reads user meshes: glTF, OBJ and STL, with validation.

Textures are ignored; the base colour of the file's largest part is used. All parts become one mesh
in the file's units, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.errors import DataFileError
from volery.core.frames import enu_from_gltf
from volery.core.plurals import counted
from volery.world.gltf_import import Part, read_gltf
from volery.world.mesh import Mesh
from volery.world.obj_import import read_obj
from volery.world.stl_import import read_stl

MAX_BYTES = 128_000_000
MAX_TRIANGLES = 5_000_000
"""Maximum number of triangles: 5 million take about 1 GB in the ray caster."""
MAX_DISTANCE_M = 100_000.0
"""Maximum distance of placed vertices, which larger scale errors exceed; beyond, 32-bit numbers are
coarser than 4 mm. A file's own coordinates may be larger."""
_LARGEST = 1e15
"""Maximum coordinate in a file's units; products of three of them fit 64-bit numbers."""
FORMATS = (".glb", ".gltf", ".obj", ".stl")
_GLTF = (".glb", ".gltf")
_MAX_MATERIAL_BYTES = 4_000_000
_GREY = (0.5, 0.5, 0.5)


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Content of a file: a surface, z up, in its units; linear (r, g, b) of its largest part.

    points: (V, 3) float64, so that projected coordinates keep their precision until the surface is
    placed near the map's origin. triangles: (T, 3) rows of `points`.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    colour: tuple[float, float, float]
    dropped: int
    """Number of omitted triangles without area."""

    @cached_property
    def mesh(self) -> Mesh:
        """The surface in the file's coordinates, rounded to single precision."""
        return Mesh(self.points.astype(np.float32), self.triangles)

    def placed(self, transform: ArrayLike) -> Mesh:
        """Returns the surface in another frame; `transform` as in `Mesh.transformed`."""
        matrix = np.asarray(transform, dtype=np.float64)[:3, :4]
        points = self.points @ matrix[:, :3].T + matrix[:, 3]
        mirrored = float(np.linalg.det(matrix[:, :3])) < 0.0
        return Mesh(
            points.astype(np.float32), self.triangles[:, ::-1] if mirrored else self.triangles
        )


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
    if size > MAX_BYTES:
        raise DataFileError(
            f"{path} has {size / 1e6:.0f} MB; at most {MAX_BYTES / 1e6:.0f} MB are read"
        )
    parts = _load(path, kind)
    count = sum(len(part.triangles) for part in parts)
    if not count:
        raise DataFileError(f"{path} has no triangle")
    is_y_up = (up or ("y" if kind in _GLTF else "z")) == "y"
    points, triangles = _joined(path, parts)
    points = enu_from_gltf(points) if is_y_up else points
    near = Mesh((points - points.min(axis=0)).astype(np.float32), triangles)
    flat = ~(near.face_normals != 0.0).any(axis=1)
    if flat.all():
        raise DataFileError(f"{path}: {counted(count, 'triangle')}, none of which has an area")
    return MeshFile(points, triangles[~flat], _colour_of_largest(near, parts), int(flat.sum()))


def _load(path: Path, kind: str) -> list[Part]:
    """Returns the file's parts in its own axes."""
    try:
        if kind in _GLTF:
            with np.errstate(all="ignore"):
                return read_gltf(path, MAX_BYTES, MAX_TRIANGLES)
        data = path.read_bytes()
        if kind == ".stl":
            return read_stl(data, MAX_TRIANGLES)
        return read_obj(data, _Materials(path.parent).get, MAX_TRIANGLES)
    except Exception as error:  # broken files raise any exception
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise DataFileError(f"{path} cannot be read as a mesh: {reason}") from None


class _Materials:
    """Files that an OBJ file may refer to: material files next to it, no images."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, name: str) -> bytes:
        """Returns the content of a material file; raises `OSError` for any other."""
        path = (self._folder / name.replace("\\", "/")).resolve()
        is_material = path.suffix.lower() == ".mtl" and path.is_file()
        if not (is_material and path.is_relative_to(self._folder.resolve())):
            raise FileNotFoundError(name)
        if path.stat().st_size > _MAX_MATERIAL_BYTES:
            raise OSError(f"{name} is too large")
        return path.read_bytes()


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
