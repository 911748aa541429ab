"""glTF scenes as triangles, beside trimesh's reading of the same files, and files that lie."""

import base64
import json
import struct

import numpy as np
import pytest
import trimesh

from volery.core.errors import DataFileError
from volery.world import gltf_import
from volery.world.gltf_import import read_gltf
from volery.world.mesh_files import read_mesh

MANY = 10**6


def document(points, corners=None, mode=4, **more):
    """A .gltf with one primitive; its buffer holds the points, then the corners' numbers."""
    points = np.asarray(points, "<f4")
    data = points.tobytes() + (b"" if corners is None else np.asarray(corners, "<u2").tobytes())
    code = base64.b64encode(data).decode()
    size = points.nbytes
    views = [{"buffer": 0, "byteLength": size}]
    accessors = [{"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3"}]
    primitive = {"attributes": {"POSITION": 0}, "mode": mode}
    if corners is not None:
        views.append({"buffer": 0, "byteOffset": size, "byteLength": len(data) - size})
        count = len(corners)
        accessors.append({"bufferView": 1, "componentType": 5123, "count": count, "type": "SCALAR"})
        primitive["indices"] = 1
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": f"data:a/b;base64,{code}"}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [primitive]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        **more,
    }


@pytest.fixture
def parts_of(tmp_path):
    def read(content):
        path = tmp_path / "a.gltf"
        path.write_text(json.dumps(content))
        return read_gltf(path, MANY, MANY)

    return read


SQUARE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]


def test_a_tree_of_nodes_as_trimesh_reads_it(tmp_path):
    scene = trimesh.Scene()
    rng = np.random.default_rng(3)
    above = None
    for k, scale in enumerate((1.0, 2.0, -0.5)):
        transform = trimesh.transformations.random_rotation_matrix(rng.random(3)) * scale
        transform[3, 3] = 1.0
        transform[:3, 3] = rng.normal(size=3)
        above = scene.add_geometry(
            trimesh.creation.icosphere(1),
            node_name=f"n{k}",
            parent_node_name=above,
            transform=transform,
        )
    path = tmp_path / "a.glb"
    path.write_bytes(scene.export(file_type="glb"))
    parts = read_gltf(path, MANY, MANY)
    others = trimesh.load_scene(path, process=False).dump()
    assert len(parts) == len(others) == 3
    for part in parts:
        corners = part.points[part.triangles]
        volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
        twin = min(others, key=lambda o, c=corners: np.abs(o.triangles - c).max())
        # a mirrored triangle may begin at another corner
        np.testing.assert_allclose(np.sort(corners, axis=1), np.sort(twin.triangles, axis=1))
        assert volume == pytest.approx(abs(twin.volume))


def test_lists_strips_and_fans(parts_of):
    """A square each: two triangles that face up, its corners in the order that the mode wants."""
    for mode, corners in ((4, [0, 1, 2, 1, 3, 2]), (5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])):
        (part,) = parts_of(document(SQUARE, corners, mode))
        a, b, c = np.moveaxis(part.points[part.triangles], 1, 0)
        np.testing.assert_allclose(0.5 * np.cross(b - a, c - a), [[0, 0, 0.5]] * 2)
        assert part.points[part.triangles].mean(axis=(0, 1)) == pytest.approx([0.5, 0.5, 0.0])
    assert parts_of(document(SQUARE, mode=1)) == []  # lines are no surface
    (part,) = parts_of(document(SQUARE[:3]))
    assert part.triangles.tolist() == [[0, 1, 2]]


def test_sparse_strided_and_integer_positions(parts_of):
    """KHR_mesh_quantization's shares, four bytes apart; then one of them replaced."""
    data = np.array([[0, 0, 0, 9], [127, 0, 0, 9], [0, -127, 0, 9], [1, 2, 3, 9]], np.int8)
    content = document(SQUARE[:3])
    content["buffers"] = [
        {"uri": f"data:;base64,{base64.b64encode(data.tobytes()).decode()}", "byteLength": 16}
    ]
    content["bufferViews"] = [
        {"buffer": 0, "byteLength": 12, "byteStride": 4},
        {"buffer": 0, "byteOffset": 12, "byteLength": 4},
    ]
    accessor = {"bufferView": 0, "componentType": 5120, "count": 3, "type": "VEC3"}
    content["accessors"] = [accessor]
    assert parts_of(content)[0].points.tolist() == [[0, 0, 0], [127, 0, 0], [0, -127, 0]]
    accessor["sparse"] = {
        "count": 1,
        "indices": {"bufferView": 0, "byteOffset": 0, "componentType": 5121},
        "values": {"bufferView": 1},
    }
    assert parts_of(content)[0].points.tolist() == [[1, 2, 3], [127, 0, 0], [0, -127, 0]]
    accessor["normalized"] = True
    np.testing.assert_allclose(parts_of(content)[0].points[1:], [[1, 0, 0], [0, -1, 0]])


def test_buffers_beside_the_file_and_nowhere_else(tmp_path, parts_of):
    content = document(SQUARE[:3])
    data = np.asarray(SQUARE[:3], "<f4").tobytes()
    (tmp_path / "a b.bin").write_bytes(data)
    (tmp_path.parent / "outside.bin").write_bytes(data)
    content["buffers"][0]["uri"] = "a%20b.bin"
    assert len(parts_of(content)) == 1
    for uri in ("../outside.bin", str(tmp_path.parent / "outside.bin")):
        content["buffers"][0]["uri"] = uri
        with pytest.raises(ValueError, match="outside of the file's folder"):
            parts_of(content)
    (tmp_path / "a b.bin").write_bytes(bytes(MANY + 1))
    content["buffers"][0]["uri"] = "a%20b.bin"
    with pytest.raises(ValueError, match="too many"):
        parts_of(content)


def lie(content, key, number, **lies):
    content[key][number].update(lies)
    return content


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lie(document(SQUARE), "accessors", 0, count=10**5), "too few for 100000"),
        (lie(document(SQUARE), "accessors", 0, count=10**12), "more than 1,000,000 triangles"),
        (lie(document(SQUARE), "accessors", 0, count=-1), "has -1 elements"),
        (lie(document(SQUARE), "accessors", 0, count=True), "'count' is 'True', not an integer"),
        (lie(document(SQUARE), "accessors", 0, byteOffset=-4), "is invalid"),
        (lie(document(SQUARE), "accessors", 0, type="VEC2"), "'VEC2', not VEC3"),
        (lie(document(SQUARE), "accessors", 0, bufferView=7), "there is none of number 7"),
        (lie(document(SQUARE), "accessors", 0, componentType=1), "component type 1 is none"),
        (lie(document(SQUARE), "bufferViews", 0, byteLength=10), "has 10 bytes: too few for 4"),
        (lie(document(SQUARE), "bufferViews", 0, byteStride=1), "stride or an offset"),
        (lie(document(SQUARE), "buffers", 0, uri="data:a/b;base64,A"), "not base64"),
        (lie(document(SQUARE), "buffers", 0, uri="none.bin"), "cannot be read: No such file"),
        (lie(document(SQUARE), "nodes", 0, children=[0]), "node 0 is reached twice"),
        (lie(document(SQUARE), "nodes", 0, rotation=[0, 0, 0, 0]), "'rotation' is zero"),
        (lie(document(SQUARE), "nodes", 0, scale=[1, 1]), "'scale' needs 3 finite numbers"),
        (document(SQUARE, extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco"),
        (document(SQUARE, asset={"version": "1.0"}), "glTF 2 is read"),
    ],
)
def test_wrong_declarations_are_reported(parts_of, content, message):
    with pytest.raises(ValueError, match=message):
        parts_of(content)


def test_shapes_shown_too_often(tmp_path, parts_of, monkeypatch):
    monkeypatch.setattr(gltf_import, "MAX_PARTS", 10)
    content = document(SQUARE[:3])
    content["nodes"] = [{"mesh": 0}] * 11
    content["scenes"] = [{"nodes": list(range(11))}]
    with pytest.raises(ValueError, match="more than 10 parts"):
        parts_of(content)
    deep = document(SQUARE[:3])
    deep["nodes"] = [{"children": [k + 1]} for k in range(5000)] + [{"mesh": 0}]
    assert len(parts_of(deep)) == 1


def test_images_are_never_opened(tmp_path):
    """A PNG that says it has 4,295 million pixels does not matter: textures are left out."""
    size = struct.pack(">II", 65535, 65535)
    bomb = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4s", 13, b"IHDR") + size + bytes(9)
    (tmp_path / "bomb.png").write_bytes(bomb)
    content = document(SQUARE[:3], images=[{"uri": "bomb.png"}], textures=[{"source": 0}])
    content["materials"] = [
        {
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": 0},
                "baseColorFactor": [1, 0, 0, 1],
            }
        }
    ]
    content["meshes"][0]["primitives"][0]["material"] = 0
    (tmp_path / "a.gltf").write_text(json.dumps(content))
    assert read_mesh(tmp_path / "a.gltf").colour == (1.0, 0.0, 0.0)
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\nmap_Kd bomb.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n")
    assert read_mesh(tmp_path / "a.obj").colour == (1.0, 0.0, 0.0)


def test_broken_ones_have_one_error(tmp_path):
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(lie(document(SQUARE), "accessors", 0, count=10**12)))
    with pytest.raises(DataFileError, match=r"a\.gltf cannot be read as a mesh: its nodes show"):
        read_mesh(path)
