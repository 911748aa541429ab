"""Worlds as binary glTF 2.0: what browsers, Blender and game engines read.

One node for the ground, for each tree and for each solid, named as in `Scene.instance_name`. Nodes
of trees share the meshes of their models, so a forest is little more than a list of places, and a
viewer can draw all trees of a mesh at once. Axes are glTF's (y up), see `core.frames`.

Khronos Group, glTF 2.0 Specification, sections 3 (properties) and 4 (GLB).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volery.core.frames import gltf_from_enu, q_gltf_from_enu
from volery.world.cover_picture import cover_places, cover_png
from volery.world.ground_cover import BARE_GROUND, GroundCover
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene_content import PLAIN, Look, Solid
from volery.world.terrain import Terrain
from volery.world.trees.model import DetailLevel

if TYPE_CHECKING:
    from volery.world.forest import Forest

Colours = Mapping[Material, tuple[float, float, float]]

_FLOAT, _UINT32 = 5126, 5125
_VERTICES, _INDICES, _CLAMP = 34962, 34963, 33071
_DIGITS = 5
"""Of places, m: a hundredth of a millimetre."""
_SMOOTH = {Material.METAL: 0.5, Material.PAINTED: 0.6}
"""Roughness below 0.9."""


def glb_of(
    terrain: Terrain | None,
    forest: Forest | None,
    solids: Sequence[Solid] = (),
    *,
    colours: Colours,
    cover: GroundCover = BARE_GROUND,
    detail: DetailLevel = DetailLevel.SENSING,
) -> bytes:
    """A world as the bytes of a .glb file; colours: linear (r, g, b) of each material."""
    file = _File(colours)
    if terrain is not None:
        ground = file.add_mesh([(terrain.mesh(), Material.GROUND, PLAIN)])
        if cover.material.size:
            file.lay_over(ground, terrain.mesh(), cover)
        file.add_node("ground", ground)
    if forest is not None:
        _add_trees(file, forest, detail)
    for solid in solids:
        file.add_node(solid.name, file.add_mesh(_parts_of(solid)))
    return file.content()


def _add_trees(file: _File, forest: Forest, detail: DetailLevel) -> None:
    meshes = []
    for model in forest.models:
        tree = model.levels[detail]
        parts = [(tree.wood, Material.WOOD, PLAIN), (tree.leaves, Material.LEAF, PLAIN)]
        meshes.append(file.add_mesh(parts))
    half = 0.5 * forest.yaw
    zero = np.zeros_like(half)
    places = gltf_from_enu(forest.position_map).round(_DIGITS).tolist()
    turns = q_gltf_from_enu(np.stack([zero, zero, np.sin(half), np.cos(half)], -1)).tolist()
    scales = np.abs(gltf_from_enu(forest.scale)).tolist()
    trees = zip(forest.model_index.tolist(), places, turns, scales, strict=True)
    for number, (model_index, place, turn, scale) in enumerate(trees, start=1):
        file.add_node(
            f"tree {number}", meshes[model_index], translation=place, rotation=turn, scale=scale
        )


def _parts_of(solid: Solid) -> list[tuple[Mesh, Material, Look]]:
    """A solid, its tops apart where they are of another material."""
    if solid.top is None or solid.top == solid.material:
        return [(solid.mesh, solid.material, solid.look)]
    normals = solid.mesh.face_normals
    up = (normals[:, 2] > 0.0) & (normals[:, 2] ** 2 > normals[:, 0] ** 2 + normals[:, 1] ** 2)
    return [
        (Mesh(solid.mesh.vertices, solid.mesh.triangles[~up]), solid.material, solid.look),
        (Mesh(solid.mesh.vertices, solid.mesh.triangles[up]), solid.top, PLAIN),
    ]


class _File:
    """A glTF document that grows, and its stretches of numbers."""

    def __init__(self, colours: Colours) -> None:
        self._colours = colours
        self._nodes: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._material_numbers: dict[tuple[Material, tuple[float, float, float]], int] = {}
        self._vertices: list[bytes] = []
        self._indices: list[bytes] = []
        self._vertex_bytes = self._index_bytes = 0
        self._places = self._picture = b""

    def add_node(self, name: str, mesh: int | None, **transform: list[float]) -> None:
        """Show mesh number `mesh`; nodes without a mesh are left out."""
        if mesh is not None:
            self._nodes.append({"name": name, "mesh": mesh, **transform})

    def add_mesh(self, parts: Sequence[tuple[Mesh, Material, Look]]) -> int | None:
        """Number of a new mesh; None where it has no triangle."""
        primitives = [
            {
                "attributes": {"POSITION": self._add_points(mesh)},
                "indices": self._add_triangles(mesh.triangles),
                "material": self._material(material, look),
            }
            for mesh, material, look in parts
            if len(mesh)
        ]
        if not primitives:
            return None
        self._meshes.append({"primitives": primitives})
        return len(self._meshes) - 1

    def lay_over(self, number: int | None, mesh: Mesh, cover: GroundCover) -> None:
        """Show a picture of the ground's cover on mesh `number`, made of `mesh`."""
        if number is None:
            return
        self._picture = cover_png(cover, self._colours)
        primitive = self._meshes[number]["primitives"][0]
        primitive["attributes"]["TEXCOORD_0"] = self._add_floats(
            cover_places(cover, mesh.vertices), "VEC2"
        )
        primitive["material"] = len(self._materials)
        self._materials.append(
            {
                "name": "ground_cover",
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": 0},
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.9,
                },
            }
        )

    def _add_points(self, mesh: Mesh) -> int:
        points = gltf_from_enu(mesh.vertices).astype(np.float32)
        number = self._add_floats(points, "VEC3")
        ends = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        self._accessors[number] |= ends
        return number

    def _add_floats(self, rows: NDArray[np.float32], kind: str) -> int:
        accessor = {
            "bufferView": 0 if kind == "VEC3" else 2,
            "byteOffset": self._vertex_bytes if kind == "VEC3" else 0,
            "componentType": _FLOAT,
            "count": len(rows),
            "type": kind,
        }
        content = rows.astype("<f4").tobytes()
        if kind == "VEC3":
            self._vertices.append(content)
            self._vertex_bytes += len(content)
        else:
            self._places = content
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def _add_triangles(self, triangles: NDArray[np.uint32]) -> int:
        numbers = triangles.astype("<u4")
        accessor = {
            "bufferView": 1,
            "byteOffset": self._index_bytes,
            "componentType": _UINT32,
            "count": numbers.size,
            "type": "SCALAR",
        }
        self._indices.append(numbers.tobytes())
        self._index_bytes += numbers.nbytes
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def _material(self, material: Material, look: Look) -> int:
        known = self._material_numbers.get((material, look.colour))
        if known is not None:
            return known
        base = np.multiply(self._colours[material], look.colour).clip(0.0, 1.0)
        self._materials.append(
            {
                "name": material.name.lower(),
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*base.round(4).tolist(), 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": _SMOOTH.get(material, 0.9),
                },
                "doubleSided": material == Material.LEAF,
            }
        )
        number = len(self._materials) - 1
        self._material_numbers[material, look.colour] = number
        return number

    def content(self) -> bytes:
        """The file's bytes: header, JSON chunk, binary chunk."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "Volery"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(self._nodes)))} if self._nodes else {}],
        }
        chunks = b""
        if self._meshes:
            pieces = [b"".join(self._vertices), b"".join(self._indices)]
            views = [{"target": _VERTICES}, {"target": _INDICES}]
            if self._picture:
                pieces += [self._places, self._picture]
                views += [{"target": _VERTICES}, {}]
                document |= {
                    "images": [{"bufferView": 3, "mimeType": "image/png"}],
                    "samplers": [{"wrapS": _CLAMP, "wrapT": _CLAMP}],
                    "textures": [{"sampler": 0, "source": 0}],
                }
            ends = np.cumsum([len(piece) for piece in pieces]).tolist()
            document |= {
                "nodes": self._nodes,
                "meshes": self._meshes,
                "materials": self._materials,
                "accessors": self._accessors,
                "bufferViews": [
                    {
                        "buffer": 0,
                        "byteOffset": end - len(piece),
                        "byteLength": len(piece),
                        **view,
                    }
                    for piece, end, view in zip(pieces, ends, views, strict=True)
                ],
                "buffers": [{"byteLength": ends[-1]}],
            }
            chunks = _chunk(b"BIN\0", b"".join(pieces), b"\0")
        text = json.dumps(document, separators=(",", ":")).encode()
        chunks = _chunk(b"JSON", text, b" ") + chunks
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    data += filler * (-len(data) % 4)
    return struct.pack("<I", len(data)) + kind + data
