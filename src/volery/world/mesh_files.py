"""Meshes of the user's own: glTF, OBJ and STL through trimesh, checked before anything uses them.

Textures are left out; the base colour of the file's largest part is kept. All parts become one mesh
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
from volery.world.mesh import Mesh

MOST_BYTES = 128_000_000
MOST_TRIANGLES = 5_000_000
"""Larger meshes are refused: 5 million triangles take about 1 GB in the ray caster."""
FARTHEST_M = 100_000.0
"""Vertices beyond this are slips of scale; 32-bit numbers are then coarser than 4 mm."""
_LARGEST = 1e15
"""Of a coordinate in a file's own units; products of three of them fit 64-bit numbers well."""
FORMATS = (".glb", ".gltf", ".obj", ".stl")
_GREY = (0.5, 0.5, 0.5)


@dataclass(frozen=True, eq=False)
class MeshFile:
    """What a file holds: a mesh, z up, in its units; linear (r, g, b) of its largest part."""

    mesh: Mesh
    colour: tuple[float, float, float]
    dropped: int
    """Triangles without area that were left out."""


def read_mesh(path: str | Path, *, up: Literal["y", "z"] | None = None) -> MeshFile:
    """Mesh of a .glb, .gltf, .obj or .stl file.

    up: which of the file's axes points up; None: y for glTF, else z. Raises `DataFileError`.
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
    parts = _load(path)
    count = sum(len(part.faces) for part in parts)
    if not count:
        raise DataFileError(f"{path} has no triangle")
    is_y_up = (up or ("y" if kind in (".glb", ".gltf") else "z")) == "y"
    points, triangles = _joined(path, parts)
    mesh = Mesh((enu_from_gltf(points) if is_y_up else points).astype(np.float32), triangles)
    flat = ~(mesh.face_normals != 0.0).any(axis=1)
    if flat.all():
        raise DataFileError(f"{path}: none of its {count} triangles has an area")
    largest = max(parts, key=lambda part: float(part.area))
    return MeshFile(Mesh(mesh.vertices, mesh.triangles[~flat]), _colour(largest), int(flat.sum()))


def _load(path: Path) -> list[Any]:
    """The file's meshes in its world frame."""
    import trimesh

    try:
        with _quiet():
            scene = trimesh.load_scene(path, process=False)
            # counted before parts that stand many times are copied
            drawn = (scene.graph[node][1] for node in scene.graph.nodes_geometry)
            count = sum(len(getattr(scene.geometry[name], "faces", ())) for name in drawn)
            if count > MOST_TRIANGLES:
                raise DataFileError(
                    f"{path} has {count:,} triangles; at most {MOST_TRIANGLES:,} are read"
                )
            return [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    except DataFileError:
        raise
    except Exception as error:  # the parsers raise whatever a broken file makes them stumble over
        told = " ".join(str(error).split())[:200] or type(error).__name__
        raise DataFileError(f"{path} is no sound {path.suffix[1:]} file: {told}") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Without trimesh's log: what matters comes as an error."""
    log = logging.getLogger("trimesh")
    was_off, log.disabled = log.disabled, True
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        log.disabled = was_off


def _joined(path: Path, parts: list[Any]) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """All parts' vertices and triangles, checked."""
    points, triangles, first = [], [], 0
    for part in parts:
        corners = np.asarray(part.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(part.faces, dtype=np.int64).reshape(-1, 3)
        if len(faces) and (faces.min() < 0 or faces.max() >= len(corners)):
            raise DataFileError(
                f"{path}: a triangle names vertex {faces.max()}; there are {len(corners)}"
            )
        points.append(corners)
        triangles.append(faces + first)
        first += len(corners)
    corners = np.concatenate(points)
    wrong = np.flatnonzero(~(np.abs(corners) < _LARGEST).all(axis=1))
    if len(wrong):
        raise DataFileError(
            f"{path}: {len(wrong)} of its {len(corners)} vertices are not finite numbers below "
            f"{_LARGEST:g}; vertex {wrong[0]} is the first"
        )
    return corners, np.concatenate(triangles).astype(np.uint32)


def _colour(part: Any) -> tuple[float, float, float]:
    """Base colour of a part; glTF's is linear already, others are coded as sRGB."""
    material = getattr(part.visual, "material", None)
    factor = getattr(material, "baseColorFactor", None)
    try:
        if factor is not None:
            rgb = np.asarray(factor, dtype=np.float64)[:3]
            rgb = rgb / 255.0 if np.asarray(factor).dtype.kind in "iu" else rgb
            return _checked(rgb)
        main = getattr(material, "main_color", None)
        if main is None:
            return _GREY
        coded = np.asarray(main, dtype=np.float64)[:3] / 255.0
        return _checked(np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4))
    except (TypeError, ValueError):
        return _GREY


def _checked(rgb: NDArray[np.float64]) -> tuple[float, float, float]:
    if rgb.shape != (3,) or not np.isfinite(rgb).all():
        return _GREY
    r, g, b = rgb.clip(0.0, 1.0).tolist()
    return r, g, b
