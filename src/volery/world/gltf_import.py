"""Reads the triangles of a glTF 2.0 scene, with the base colours of its materials.

Triangles, strips and fans are read; points, lines, textures, skins and animations are ignored.
Sizes and links are checked before memory is allocated. Khronos Group, glTF 2.0 Specification,
sections 3.5 (scenes), 3.7 (meshes) and 3.12 (extensions).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.world.gltf_container import Container, entry, field

MOST_PARTS = 100_000
"""Maximum number of meshes in nodes, each counted as often as used."""
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quant")
"""Prefixes of required extensions that do not affect the triangles."""


class Part(NamedTuple):
    """One part of a file's surface.

    points: (V, 3) in the file's axes and units. triangles: (T, 3) rows of `points`, not checked.
    colour: (3,) linear red, green, blue, or None.
    """

    points: Array
    triangles: NDArray[np.int64]
    colour: Array | None


class _Shown(NamedTuple):
    """A primitive of a mesh in a node; transform: (4, 4) scene from mesh."""

    primitive: dict[str, Any]
    transform: Array


def read_gltf(path: Path, most_bytes: int, most_triangles: int) -> list[Part]:
    """Returns all parts of the file's scene; raises `ValueError` without the file's name."""
    file = Container(path, most_bytes)
    required = field(file.document, "extensionsRequired", list, [])
    for name in required:
        if not str(name).startswith(_HARMLESS):
            raise ValueError(f"it needs the extension {str(name)[:60]}, which is not read")
    shown: list[_Shown] = []
    triangles = points = 0
    for part in _shown(file.document):
        shown.append(part)
        triangles += _triangle_count(file, part.primitive)
        points += file.count(_position(part.primitive))
        if triangles > most_triangles or points > 3 * most_triangles:
            raise ValueError(
                f"its nodes show more than {most_triangles:,} triangles, or corners of so many"
            )
        if len(shown) > MOST_PARTS:
            raise ValueError(f"its nodes show more than {MOST_PARTS:,} parts")
    return [_part(file, each) for each in shown]


# ---------------------------------------------------------------------------------------- the nodes


def _shown(document: dict[str, Any]) -> Iterator[_Shown]:
    """Yields primitives made of triangles in the order of the tree of nodes."""
    seen: set[int] = set()
    todo = [(number, np.eye(4)) for number in reversed(_roots(document))]
    while todo:
        number, above = todo.pop()
        node = entry(document, "nodes", number)
        if number in seen:
            raise ValueError(f"node {number} is reached twice: nodes must form a tree")
        seen.add(number)
        transform = above @ _transform(node)
        if "mesh" in node:
            mesh = entry(document, "meshes", node["mesh"])
            for k in range(len(field(mesh, "primitives", list))):
                primitive = entry(mesh, "primitives", k)
                if _mode(primitive) in (_TRIANGLES, _STRIP, _FAN):
                    yield _Shown(primitive, transform)
        children = field(node, "children", list, [])
        todo += [(child, transform) for child in reversed(children)]


def _roots(document: dict[str, Any]) -> Sequence[Any]:
    """Returns the root nodes of the scene: of the named one, else the first, else all roots."""
    if field(document, "scenes", list, []):
        scene = entry(document, "scenes", document.get("scene", 0))
        return list(field(scene, "nodes", list, []))
    nodes = field(document, "nodes", list, [])
    below = {
        child
        for number in range(len(nodes))
        for child in field(entry(document, "nodes", number), "children", list, [])
        if isinstance(child, int)
    }
    return [number for number in range(len(nodes)) if number not in below]


def _transform(node: dict[str, Any]) -> Array:
    """Returns the transform (4, 4), parent from node."""
    if "matrix" in node:
        return _numbers(node, "matrix", 16, ()).reshape(4, 4).T
    turn = _numbers(node, "rotation", 4, (0.0, 0.0, 0.0, 1.0))
    if not turn.any():
        raise ValueError("a node's 'rotation' is zero")
    transform = np.eye(4)
    transform[:3, :3] = rotations.matrix(rotations.normalize(turn)) * _numbers(
        node, "scale", 3, (1.0, 1.0, 1.0)
    )
    transform[:3, 3] = _numbers(node, "translation", 3, (0.0, 0.0, 0.0))
    return transform


def _numbers(holder: dict[str, Any], key: str, count: int, default: Sequence[float]) -> Array:
    values = field(holder, key, list, list(default))
    if len(values) != count or not all(
        isinstance(value, int | float) and abs(value) < 1e30 for value in values
    ):
        raise ValueError(f"'{key}' needs {count} finite numbers")
    return np.array(values, dtype=np.float64)


# ----------------------------------------------------------------------------------- the primitives


def _mode(primitive: dict[str, Any]) -> int:
    mode: int = field(primitive, "mode", int, _TRIANGLES)
    return mode


def _position(primitive: dict[str, Any]) -> int:
    number: int = field(field(primitive, "attributes", dict), "POSITION", int)
    return number


def _corner_count(file: Container, primitive: dict[str, Any]) -> int:
    return file.count(primitive.get("indices", _position(primitive)))


def _triangle_count(file: Container, primitive: dict[str, Any]) -> int:
    corners = _corner_count(file, primitive)
    return corners // 3 if _mode(primitive) == _TRIANGLES else max(corners - 2, 0)


def _part(file: Container, shown: _Shown) -> Part:
    primitive, transform = shown
    points = file.array(_position(primitive), "VEC3").astype(np.float64)
    if "indices" in primitive:
        corners = file.array(primitive["indices"], "SCALAR")[:, 0]
        if corners.dtype.kind != "u":
            raise ValueError("indices of corners must be unsigned integers")
        corners = corners.astype(np.int64)
    else:
        corners = np.arange(len(points))
    triangles = _triangles(corners, _mode(primitive))
    if np.linalg.det(transform[:3, :3]) < 0.0:
        triangles = triangles[:, ::-1]
    return Part(
        points @ transform[:3, :3].T + transform[:3, 3], triangles, _colour(file, primitive)
    )


def _triangles(corners: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Returns the corners (T, 3) of the triangles of a list, a strip or a fan."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if len(corners) < 3:
        return np.empty((0, 3), np.int64)
    if mode == _FAN:
        first = np.full(len(corners) - 2, corners[0])
        return np.stack([corners[1:-1], corners[2:], first], axis=1)
    odd = np.arange(len(corners) - 2) % 2 == 1  # every other triangle of a strip is reversed
    second, third = corners[1:-1], corners[2:]
    return np.stack(
        [corners[:-2], np.where(odd, third, second), np.where(odd, second, third)], axis=1
    )


def _colour(file: Container, primitive: dict[str, Any]) -> Array | None:
    if "material" not in primitive:
        return None
    material = entry(file.document, "materials", primitive["material"])
    surface = field(material, "pbrMetallicRoughness", dict, {})
    if "baseColorFactor" not in surface:
        return None
    return _numbers(surface, "baseColorFactor", 4, ())[:3]
