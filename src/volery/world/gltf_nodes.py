"""Walks the nodes of a glTF 2.0 scene: which primitives they show, at which poses and weights.

Khronos Group, glTF 2.0 Specification, sections 3.5 (scenes) and 3.7.2.2 (weights of morph targets);
extensions KHR_node_visibility and EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.world.gltf_container import Container, entry, field, numbers

READ_EXTENSIONS = ("KHR_node_visibility", "EXT_mesh_gpu_instancing")
"""Extensions of nodes that are applied."""
MAX_INSTANCES = 1_000_000
"""Maximum number of instances of one node."""
_VISIBILITY, _INSTANCING = READ_EXTENSIONS


class ShownPrimitive(NamedTuple):
    """A primitive of a mesh in a node.

    transforms: (N, 4, 4) scene from mesh, of each instance. weights: of its morph targets.
    """

    primitive: dict[str, Any]
    transforms: Array
    weights: Array


def shown_primitives(file: Container) -> Iterator[ShownPrimitive]:
    """Yields the primitives of the visible nodes in the order of the tree of nodes."""
    document = file.document
    seen: set[int] = set()
    todo = [(number, np.eye(4)) for number in reversed(_roots(document))]
    while todo:
        number, above = todo.pop()
        node = entry(document, "nodes", number)
        if number in seen:
            raise ValueError(f"node {number} is reached twice: nodes must form a tree")
        seen.add(number)
        if _extension(node, _VISIBILITY).get("visible") is False:
            continue
        transform = above @ _transform(node)
        if "mesh" in node:
            mesh = entry(document, "meshes", node["mesh"])
            weights = numbers(node if "weights" in node else mesh, "weights", None, ())
            transforms = transform @ _instances(file, node)
            for k in range(len(field(mesh, "primitives", list))):
                yield ShownPrimitive(entry(mesh, "primitives", k), transforms, weights)
        children = field(node, "children", list, [])
        todo += [(child, transform) for child in reversed(children)]


def _extension(node: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = field(field(node, "extensions", dict, {}), name, dict, {})
    return found


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
        return numbers(node, "matrix", 16, ()).reshape(4, 4).T
    return _composed(
        numbers(node, "translation", 3, (0.0, 0.0, 0.0)),
        numbers(node, "rotation", 4, (0.0, 0.0, 0.0, 1.0)),
        numbers(node, "scale", 3, (1.0, 1.0, 1.0)),
    )


def _instances(file: Container, node: dict[str, Any]) -> Array:
    """Returns the transforms (N, 4, 4), node from mesh, of the instances; one without any."""
    attributes = field(_extension(node, _INSTANCING), "attributes", dict, {})
    counts = {file.count(number) for number in attributes.values()}
    if not counts:
        return np.eye(4)[None]
    if len(counts) > 1 or max(counts) > MAX_INSTANCES:
        raise ValueError(
            f"attributes of a node's instances have {sorted(counts)} elements; they need one "
            f"number of at most {MAX_INSTANCES:,}"
        )

    def rows(name: str, form: str, default: Sequence[float]) -> Array:
        if name not in attributes:
            return np.broadcast_to(np.array(default), (*counts, len(default)))
        return file.array(attributes[name], form).astype(np.float64)

    return _composed(
        rows("TRANSLATION", "VEC3", (0.0, 0.0, 0.0)),
        rows("ROTATION", "VEC4", (0.0, 0.0, 0.0, 1.0)),
        rows("SCALE", "VEC3", (1.0, 1.0, 1.0)),
    )


def _composed(translation: Array, rotation: Array, scale: Array) -> Array:
    """Returns transforms (..., 4, 4) of translations, quaternions x y z w, and scales."""
    if not rotation.any(axis=-1).all():
        raise ValueError("a node's 'rotation' is zero")
    transforms = np.zeros((*translation.shape[:-1], 4, 4))
    matrices = rotations.matrix(rotations.normalize(rotation))
    transforms[..., :3, :3] = matrices * scale[..., None, :]
    transforms[..., :3, 3] = translation
    transforms[..., 3, 3] = 1.0
    return transforms
