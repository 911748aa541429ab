"""Writer of binary glTF 2.0 files: nodes, meshes, materials, and their arrays.

Khronos Group, glTF 2.0 Specification, sections 3 (properties) and 4 (GLB); EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.frames import gltf_from_enu
from volery.world.ground_cover import GroundCover
from volery.world.ground_cover_image import cover_coordinates, cover_png
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene_content import PLAIN, Look

Colours = Mapping[Material, tuple[float, float, float]]

_FLOAT, _UINT8, _UINT16, _UINT32 = 5126, 5121, 5123, 5125
_VERTICES, _INDICES, _CLAMP = 34962, 34963, 33071
_NORMAL_STEPS = 128.0
"""Steps of a normal's components from 0 to 1: half a degree, finer than the smoothed triangles."""
_FEW_VERTICES = 65535
"""Maximum number of vertices for two-byte indices; 65535 restarts primitives in some systems."""
_SMOOTH = {Material.METAL: 0.5, Material.PAINTED: 0.6}
"""Roughness of materials other than 0.9."""
_INSTANCING = "EXT_mesh_gpu_instancing"


class Surface(NamedTuple):
    """A mesh in the map or its node's frame, with its material."""

    mesh: Mesh
    material: Material
    look: Look = PLAIN
    smooth: bool = False
    """Whether shading is smooth; otherwise every triangle is flat."""
    colours: NDArray[np.float64] | None = None
    """(V, 3) factors of the material's colour, 0 to 1; None: the look's."""
    storeys: NDArray[np.float32] | None = None
    """(V, 3) begin and height of storeys, m, and their number."""


class _Stretch(Enum):
    """Arrays that are stored together: bytes per element, and their target."""

    POINTS = (12, _VERTICES)
    NUMBERS = (4, _INDICES)
    SHORT_NUMBERS = (2, _INDICES)
    TEXTURE_COORDINATES = (8, _VERTICES)
    COLOURS = (4, _VERTICES)
    PLACINGS = (12, None)
    TURNS = (16, None)
    IMAGE = (1, None)


class GltfFile:
    """A file under construction; `content` returns its bytes.

    colours: linear (r, g, b) of each material.
    """

    def __init__(self, colours: Colours, extras: Mapping[str, Any] | None = None) -> None:
        self._colours = colours
        self._extras = dict(extras or {})
        self._nodes: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._material_numbers: dict[tuple[Material, tuple[float, float, float]], int] = {}
        self._stretches: dict[_Stretch, list[bytes]] = {}
        self._instanced = False

    # -------------------------------------------------------------------------------------- nodes

    def add_node(self, name: str, mesh: int | None, **properties: Any) -> None:
        """Adds a node for mesh number `mesh`; nodes without a mesh are left out."""
        if mesh is not None:
            self._nodes.append({"name": name, "mesh": mesh, **properties})

    def add_instances(
        self,
        name: str,
        mesh: int | None,
        positions: NDArray[np.floating],
        turns: NDArray[np.floating],
        scales: NDArray[np.floating],
    ) -> None:
        """Adds instances of a mesh: positions (N, 3), turns (N, 4), scales (N, 3), glTF's axes."""
        if mesh is None or not len(positions):
            return
        attributes = {
            "TRANSLATION": self._add_rows(_Stretch.PLACINGS, positions, _FLOAT, "VEC3"),
            "ROTATION": self._add_rows(_Stretch.TURNS, turns, _FLOAT, "VEC4"),
            "SCALE": self._add_rows(_Stretch.PLACINGS, scales, _FLOAT, "VEC3"),
        }
        self.add_node(name, mesh, extensions={_INSTANCING: {"attributes": attributes}})
        self._instanced = True

    # ------------------------------------------------------------------------------------- meshes

    def add_mesh(self, surfaces: Sequence[Surface]) -> int | None:
        """Adds a mesh and returns its number; None if it has no triangle."""
        primitives = [self._primitive(surface) for surface in surfaces if len(surface.mesh)]
        if not primitives:
            return None
        self._meshes.append({"primitives": primitives})
        return len(self._meshes) - 1

    def _primitive(self, surface: Surface) -> dict[str, Any]:
        mesh = surface.mesh
        attributes = {"POSITION": self._add_points(mesh)}
        if surface.smooth:
            normals = np.round(gltf_from_enu(mesh.vertex_normals) * _NORMAL_STEPS) / _NORMAL_STEPS
            attributes["NORMAL"] = self._add_rows(_Stretch.POINTS, normals, _FLOAT, "VEC3")
        if surface.colours is not None:
            factors = np.pad(surface.colours, ((0, 0), (0, 1)), constant_values=1.0)
            attributes["COLOR_0"] = self._add_rows(
                _Stretch.COLOURS, np.round(255.0 * factors.clip(0.0, 1.0)), _UINT8, "VEC4"
            )
            self._accessors[-1]["normalized"] = True
        if surface.storeys is not None:
            attributes["_STOREYS"] = self._add_rows(
                _Stretch.POINTS, surface.storeys, _FLOAT, "VEC3"
            )
        return {
            "attributes": attributes,
            "indices": self._add_triangles(mesh),
            "material": self._material(surface.material, surface.look),
        }

    def lay_over(self, number: int | None, mesh: Mesh, cover: GroundCover) -> None:
        """Textures mesh number `number`, made of `mesh`, with the ground's cover."""
        if number is None:
            return
        self._stretches[_Stretch.IMAGE] = [cover_png(cover, self._colours)]
        primitive = self._meshes[number]["primitives"][0]
        primitive["attributes"]["TEXCOORD_0"] = self._add_rows(
            _Stretch.TEXTURE_COORDINATES, cover_coordinates(cover, mesh.vertices), _FLOAT, "VEC2"
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

    # ------------------------------------------------------------------------------------ numbers

    def _add_points(self, mesh: Mesh) -> int:
        points = gltf_from_enu(mesh.vertices).astype(np.float32)
        number = self._add_rows(_Stretch.POINTS, points, _FLOAT, "VEC3")
        ends = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        self._accessors[number] |= ends
        return number

    def _add_triangles(self, mesh: Mesh) -> int:
        numbers = mesh.triangles.ravel()
        if len(mesh.vertices) <= _FEW_VERTICES:
            return self._add_rows(_Stretch.SHORT_NUMBERS, numbers, _UINT16, "SCALAR")
        return self._add_rows(_Stretch.NUMBERS, numbers, _UINT32, "SCALAR")

    def _add_rows(self, stretch: _Stretch, rows: NDArray[Any], component: int, kind: str) -> int:
        """Appends rows to a stretch and returns the number of their new accessor."""
        form = {_FLOAT: "<f4", _UINT8: "u1", _UINT16: "<u2", _UINT32: "<u4"}[component]
        pieces = self._stretches.setdefault(stretch, [])
        accessor = {
            "bufferView": stretch,  # its number is known in the end
            "byteOffset": sum(map(len, pieces)),
            "componentType": component,
            "count": len(rows),
            "type": kind,
        }
        pieces.append(np.asarray(rows).astype(form).tobytes())
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

    # ---------------------------------------------------------------------------------- the bytes

    def content(self) -> bytes:
        """Returns the file's bytes: header, JSON chunk, binary chunk."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "Volery"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(self._nodes)))} if self._nodes else {}],
        }
        if self._extras:
            document["asset"]["extras"] = self._extras
        chunks = b""
        if self._meshes:
            views, data = self._views()
            numbers = {stretch: number for number, stretch in enumerate(self._stretches)}
            accessors = [{**a, "bufferView": numbers[a["bufferView"]]} for a in self._accessors]
            document |= {
                "nodes": self._nodes,
                "meshes": self._meshes,
                "materials": self._materials,
                "accessors": accessors,
                "bufferViews": views,
                "buffers": [{"byteLength": len(data)}],
            }
            if _Stretch.IMAGE in numbers:
                image = numbers[_Stretch.IMAGE]
                document |= {
                    "images": [{"bufferView": image, "mimeType": "image/png"}],
                    "samplers": [{"wrapS": _CLAMP, "wrapT": _CLAMP}],
                    "textures": [{"sampler": 0, "source": 0}],
                }
            if self._instanced:
                document |= {"extensionsUsed": [_INSTANCING], "extensionsRequired": [_INSTANCING]}
            chunks = _chunk(b"BIN\0", data, b"\0")
        text = json.dumps(document, separators=(",", ":")).encode()
        chunks = _chunk(b"JSON", text, b" ") + chunks
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks

    def _views(self) -> tuple[list[dict[str, Any]], bytes]:
        """Returns a view for each stretch, aligned to four bytes, and all their bytes."""
        views, pieces, begin = [], [], 0
        for stretch, parts in self._stretches.items():
            size, target = stretch.value
            length = sum(map(len, parts))
            view = {"buffer": 0, "byteOffset": begin, "byteLength": length}
            if target is not None:
                view["target"] = target
            if target == _VERTICES:
                view["byteStride"] = size
            views.append(view)
            pieces += [*parts, b"\0" * (-length % 4)]
            begin += length + -length % 4
        return views, b"".join(pieces)


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    data += filler * (-len(data) % 4)
    return struct.pack("<I", len(data)) + kind + data
