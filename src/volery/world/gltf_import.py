"""Reads the triangles of a glTF 2.0 scene, with the base colours of its materials.

Triangles, strips and fans are read, with morph targets at their default weights; points, lines,
textures, skins and animations are ignored. Sizes and links are checked before memory is allocated.
Khronos Group, glTF 2.0 Specification, sections 3.7 (meshes) and 3.12 (extensions).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.world.gltf_container import Container, entry, field, numbers
from volery.world.gltf_nodes import (
    MAX_INSTANCES,
    READ_EXTENSIONS,
    ShownPrimitive,
    shown_primitives,
)

MAX_PARTS = 100_000
"""Maximum number of meshes in nodes, each counted as often as used."""
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_mesh_quant",
    "KHR_animation_pointer",
    "KHR_node_selectability",
    "KHR_node_hoverability",
)
"""Prefixes of required extensions that do not affect the triangles at rest."""


class Part(NamedTuple):
    """One part of a file's surface.

    points: (V, 3) in the file's axes and units. triangles: (T, 3) rows of `points`, not checked.
    colour: (3,) linear red, green, blue, or None.
    """

    points: Array
    triangles: NDArray[np.int64]
    colour: Array | None


def read_gltf(path: Path, max_bytes: int, max_triangles: int) -> list[Part]:
    """Returns all parts of the file's scene; raises `ValueError` without the file's name."""
    file = Container(path, max_bytes)
    required = field(file.document, "extensionsRequired", list, [])
    for name in required:
        if not str(name).startswith(_HARMLESS) and name not in READ_EXTENSIONS:
            raise ValueError(f"it needs the extension {str(name)[:60]}, which is not read")
    shown: list[ShownPrimitive] = []
    triangles = points = instances = 0
    for part in shown_primitives(file):
        primitive, transforms, weights = part
        if _mode(primitive) not in (_TRIANGLES, _STRIP, _FAN):
            continue
        shown.append(part)
        corners = file.count(_position(primitive))
        triangles += _triangle_count(file, primitive) * len(transforms)
        points += corners * (len(transforms) + int(np.count_nonzero(weights)))
        instances += len(transforms)
        if triangles > max_triangles or points > 3 * max_triangles:
            raise ValueError(
                f"its nodes show more than {max_triangles:,} triangles, or corners of so many"
            )
        if len(shown) > MAX_PARTS or instances > MAX_INSTANCES:
            raise ValueError(
                f"its nodes show more than {MAX_PARTS:,} parts, or {MAX_INSTANCES:,} instances"
            )
    return [_part(file, each) for each in shown]


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


def _part(file: Container, shown: ShownPrimitive) -> Part:
    """Returns a primitive in the scene, as often as its node has instances."""
    primitive, transforms, weights = shown
    points = _points(file, primitive, weights)
    if "indices" in primitive:
        corners = file.array(primitive["indices"], "SCALAR")[:, 0]
        if corners.dtype.kind != "u":
            raise ValueError("indices of corners must be unsigned integers")
        corners = corners.astype(np.int64)
    else:
        corners = np.arange(len(points))
    if len(corners) and corners.max() >= len(points):
        raise ValueError(f"a triangle has vertex {corners.max()}; there are {len(points)}")
    triangles = _triangles(corners, _mode(primitive))
    linear = transforms[:, :3, :3]
    placed = points @ linear.transpose(0, 2, 1) + transforms[:, None, :3, 3]
    mirrored = np.linalg.det(linear) < 0.0
    turned = np.where(mirrored[:, None, None], triangles[:, ::-1], triangles)
    turned += (np.arange(len(transforms)) * len(points))[:, None, None]
    return Part(placed.reshape(-1, 3), turned.reshape(-1, 3), _colour(file, primitive))


def _points(file: Container, primitive: dict[str, Any], weights: Array) -> Array:
    """Returns the corners (V, 3) of a primitive, moved by its morph targets."""
    points = file.array(_position(primitive), "VEC3").astype(np.float64)
    targets = field(primitive, "targets", list, [])
    if targets and len(weights) not in (0, len(targets)):
        raise ValueError(f"a mesh has {len(weights)} weights for {len(targets)} morph targets")
    for k in np.flatnonzero(weights[: len(targets)]).tolist():
        target = entry(primitive, "targets", k)
        if "POSITION" not in target or file.is_zero(target["POSITION"]):
            continue
        number = field(target, "POSITION", int)
        if file.count(number) != len(points):
            raise ValueError(f"a morph target has {file.count(number)} corners, not {len(points)}")
        points += weights[k] * file.array(number, "VEC3")
    return points


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
    return numbers(surface, "baseColorFactor", 4, ())[:3]
