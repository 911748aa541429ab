"""Meshes of the user's own: glTF, GLB, OBJ and STL files whose sizes, indices and links may lie."""

from __future__ import annotations

import base64
import contextlib
import json
import struct
from functools import cache

import numpy as np
import trimesh
from PIL import Image
from scratch_files import path_of

from volery.core.errors import DataFileError
from volery.world.mesh_files import MAX_TRIANGLES, read_mesh

_GLB_HEAD = struct.Struct("<4sIIII")
"""Magic, version, length of the file; length and name of the first chunk."""


@cache
def _box():
    """A box with a texture, and one more that stands turned."""
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    image = Image.fromarray((np.indices((4, 4)).sum(axis=0) * 30).astype(np.uint8))
    paint = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[0.8, 0.1, 0.1, 1.0], baseColorTexture=image
    )
    box.visual = trimesh.visual.TextureVisuals(uv=box.vertices[:, :2], material=paint)
    scene = trimesh.Scene()
    parent = scene.add_geometry(box, node_name="a", geom_name="box")
    turn = trimesh.transformations.rotation_matrix(0.5, [0, 0, 1], [1, 2, 3])
    scene.add_geometry(box, node_name="b", geom_name="box", parent_node_name=parent, transform=turn)
    return scene


@cache
def _glb_seeds():
    seeds = [bytes(_box().export(file_type="glb"))]
    return [*seeds, bytes(trimesh.creation.icosphere(0).export(file_type="glb"))]


@cache
def _document():
    """JSON of a .gltf whose buffers are in it."""
    parts = _box().export(file_type="gltf")
    document = json.loads(parts["model.gltf"])
    for buffer in document["buffers"]:
        code = base64.b64encode(parts[buffer["uri"]]).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{code}"
    position = document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    for mesh in document["meshes"]:
        mesh["weights"] = [0.5]
        for primitive in mesh["primitives"]:
            primitive["targets"] = [{"POSITION": position}]
    for node in document["nodes"]:
        attributes = {"TRANSLATION": position, "SCALE": position}
        node["extensions"] = {
            "EXT_mesh_gpu_instancing": {"attributes": attributes},
            "KHR_node_visibility": {"visible": True},
        }
    return document


@cache
def _obj_seeds():
    path_of("paint.mtl").write_text("newmtl red\nKd 0.8 0.1 0.1\nmap_Kd paint.png\n")
    Image.new("RGB", (4, 4)).save(path_of("paint.png"))
    quads = "mtllib paint.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nvt 0 0\nvn 0 0 1\n"
    quads += "usemtl red\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1 -2 -3\ng b\nf 1//1 3//1 4//1\n"
    return [quads.encode(), trimesh.creation.box().export(file_type="obj").encode()]


@cache
def _stl_seeds():
    box = trimesh.creation.box()
    return [box.export(file_type="stl"), box.export(file_type="stl_ascii").encode()]


def glb(mutator):
    """Binary glTF; changes of bytes, or of the values of its JSON."""
    data = mutator.pick(_glb_seeds())
    if mutator.chance(0.4):
        return _read(mutator.bytes(_glb_seeds()), "x.glb")
    magic, version, _, length, name = _GLB_HEAD.unpack_from(data)
    document = json.loads(data[_GLB_HEAD.size : _GLB_HEAD.size + length])
    text = _json(mutator.plain(document, changes=mutator.random.randrange(1, 4)))
    rest = data[_GLB_HEAD.size + length :]
    head = _GLB_HEAD.pack(magic, version, _GLB_HEAD.size + len(text) + len(rest), len(text), name)
    return _read(head + text + rest, "x.glb")


def gltf(mutator):
    """The JSON of glTF with its buffers in it."""
    if mutator.chance(0.2):
        return _read(mutator.bytes([_json(_document())]), "x.gltf")
    return _read(
        _json(mutator.plain(_document(), changes=mutator.random.randrange(1, 4))), "x.gltf"
    )


def obj(mutator):
    """OBJ text and its materials."""
    return _read(mutator.bytes(_obj_seeds()), "x.obj")


def stl(mutator):
    """STL, binary and text."""
    return _read(mutator.bytes(_stl_seeds()), "x.stl")


def _json(value):
    text = json.dumps(value, default=repr).encode("utf-8", "surrogatepass")
    return text + b" " * (-len(text) % 4)


def _read(data, name):
    path = path_of(name)
    path.write_bytes(data)
    with contextlib.suppress(DataFileError):
        file = read_mesh(path)
        assert 0 < len(file.triangles) <= MAX_TRIANGLES
        assert np.isfinite(file.mesh.vertices).all()
        moved = np.column_stack([np.eye(3), -file.points.min(axis=0)])  # to the origin
        assert file.placed(moved).area > 0.0
        assert all(0.0 <= part <= 1.0 for part in file.colour)
    return 1
