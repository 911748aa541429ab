"""glTF that moves its meshes: morph targets, hidden nodes, instances; content and suffix."""

import base64
import json

import numpy as np
import pytest
from scene_samples import cylinder

from volery.core.errors import DataFileError
from volery.sensors.cameras.light import base_colours
from volery.world import gltf_import
from volery.world.forest import procedural_forest
from volery.world.gltf import glb_of, instanced_glb_of
from volery.world.gltf_import import read_gltf
from volery.world.materials import Material
from volery.world.mesh_files import read_mesh
from volery.world.scene import Solid
from volery.world.terrain import Terrain
from volery.world.trees.model import DetailLevel

MANY = 10**6
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
UP, ASIDE = TRIANGLE * 0 + [0, 0, 2], TRIANGLE * [3, 0, 0]
CODES = {"f4": 5126, "i1": 5120, "i2": 5122, "u1": 5121, "u2": 5123}
HALF = np.sqrt(0.5)
TANK = Solid(cylinder(1.0, 3.0, 8), Material.METAL, "tank")


def moved(corners, *by):
    return np.asarray(corners) + np.array(by)


def document(*arrays, **mesh):
    """A .gltf whose accessors are these arrays; the first has the corners of its only mesh."""
    buffers, views, accessors = [], [], []
    for k, array in enumerate(np.ascontiguousarray(array) for array in arrays):
        code = base64.b64encode(array.tobytes()).decode()
        buffers.append({"byteLength": array.nbytes, "uri": f"data:a/b;base64,{code}"})
        views.append({"buffer": k, "byteLength": array.nbytes})
        accessors.append(
            {
                "bufferView": k,
                "componentType": CODES[array.dtype.str[1:]],
                "count": len(array),
                "type": "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}",
                "normalized": array.dtype.kind == "i",
            }
        )
    primitive = {"attributes": {"POSITION": 0}}
    if "targets" in mesh:
        primitive["targets"] = mesh.pop("targets")
    return {
        "asset": {"version": "2.0"},
        "buffers": buffers,
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [primitive], **mesh}],
        "nodes": [{"mesh": 0}],
    }


@pytest.fixture
def corners_of(tmp_path):
    """Corners (T, 3 corners, 3) of all parts of a document, in the file's axes."""

    def read(content):
        path = tmp_path / "a.gltf"
        path.write_text(json.dumps(content))
        parts = read_gltf(path, MANY, MANY)
        return np.concatenate([part.points[part.triangles] for part in parts])

    return read


# ------------------------------------------------------------------------------- morph targets


def morphed(**more):
    arrays = (TRIANGLE, UP.astype("<f4"), ASIDE.astype("<f4"))
    return document(*arrays, targets=[{"POSITION": 1}, {"POSITION": 2, "NORMAL": 1}], **more)


@pytest.mark.parametrize(
    ("mesh", "node", "expected"),
    [
        ({}, {}, TRIANGLE),
        ({"weights": [0.5, 0.0]}, {}, TRIANGLE + 0.5 * UP),
        ({"weights": [0.5, 1.0]}, {}, TRIANGLE + 0.5 * UP + ASIDE),
        ({"weights": [0.5, 1.0]}, {"weights": [0.0, -1]}, TRIANGLE - ASIDE),
        ({}, {"weights": [1, 0], "translation": [0, 7, 0]}, TRIANGLE + UP + [0, 7, 0]),
    ],
)
def test_morph_targets_have_their_default_weights(corners_of, mesh, node, expected):
    content = morphed(**mesh)
    content["nodes"][0] |= node
    np.testing.assert_allclose(corners_of(content), [expected], atol=1e-7)


def test_targets_of_integers_sparse_ones_and_none(corners_of):
    offsets = np.array([[127, 0, 0], [0, -127, 0], [0, 0, 0]], np.int8)
    targets = [{"POSITION": 1}, {"NORMAL": 1}, {"POSITION": 3}]
    content = document(TRIANGLE, offsets, np.array([2], np.uint8), targets=targets)
    content["accessors"].append({"componentType": 5126, "count": 3, "type": "VEC3"})
    content["meshes"][0]["weights"] = [2.0, 1.0, 1.0]
    expected = moved(TRIANGLE, [2, 0, 0], [0, -2, 0], [0, 0, 0])
    np.testing.assert_allclose(corners_of(content), [expected])
    content["bufferViews"].append({"buffer": 0, "byteOffset": 12, "byteLength": 12})
    content["accessors"][3]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 3},
    }
    expected[2] += [1, 0, 0]
    np.testing.assert_allclose(corners_of(content), [expected])


@pytest.mark.parametrize(
    ("weights", "count", "message"),
    [
        ([1.0], 3, "1 weights for 2 morph targets"),
        ([1.0, "a"], 3, "'weights' needs finite numbers"),
        ([1.0, 0.0], 2, "a morph target has 2 corners, not 3"),
    ],
)
def test_targets_that_do_not_fit(corners_of, weights, count, message):
    content = morphed(weights=weights)
    content["accessors"][1]["count"] = count
    with pytest.raises(ValueError, match=message):
        corners_of(content)


def test_targets_count_for_the_limit(corners_of, monkeypatch):
    content = morphed(weights=[1.0, 1.0])
    monkeypatch.setitem(globals(), "MANY", 2)  # 6 corners
    with pytest.raises(ValueError, match="or corners of so many"):
        corners_of(content)


# ---------------------------------------------------------------------------- hidden and instanced


def test_hidden_nodes_and_their_children_are_left_out(corners_of):
    content = document(TRIANGLE)
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    shown = {"extensions": {"KHR_node_visibility": {"visible": True}}}
    content["nodes"] = [
        {"mesh": 0, "children": [1], **hidden},
        {"mesh": 0, **shown},
        {"mesh": 0, "translation": [0, 0, 5], **shown},
        {"mesh": 0, "translation": [0, 0, 6], "extensions": {"KHR_node_visibility": {}}},
    ]
    content["extensionsRequired"] = ["KHR_node_visibility", "KHR_animation_pointer"]
    heights = corners_of(content)[:, 0, 2]
    assert heights.tolist() == [5.0, 6.0]


def instanced(*arrays, **attributes):
    content = document(TRIANGLE, *arrays)
    extension = {"attributes": attributes}
    content["nodes"] = [
        {"translation": [100, 0, 0], "children": [1]},
        {
            "mesh": 0,
            "scale": [2, 2, 2],
            "extensions": {"EXT_mesh_gpu_instancing": extension},
            "children": [2],
        },
        {"mesh": 0, "translation": [0, 0, 9]},
    ]
    content["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    return content


CHILD = TRIANGLE * 2 + [100, 0, 18]


def test_instances_have_their_positions_rotations_and_scales(corners_of):
    """Each is scaled, rotated and moved, then placed as the node; the child is no instance."""
    translations = np.array([[0, 0, 0], [10, 0, 0], [0, 20, 0]], "<f4")
    turns = np.array([[0, 0, 0, 1], [0, 0, HALF, HALF], [0, 0, 0, 1]], "<f4")
    scales = np.array([[1, 1, 1], [3, 3, 3], [-1, 1, 1]], "<f4")
    for turn in (turns, np.round(turns * 127).astype(np.int8)):
        content = instanced(translations, turn, scales, TRANSLATION=1, ROTATION=2, SCALE=3)
        turned = moved([[0, 0, 0], [0, 3, 0], [-3, 0, 0]], 10, 0, 0)
        mirrored = moved([[0, 1, 0], [-1, 0, 0], [0, 0, 0]], 0, 20, 0)
        expected = [TRIANGLE * 2, turned * 2, mirrored * 2]
        found = corners_of(content)
        expected = [*(moved(e, 100, 0, 0) for e in expected), CHILD]
        np.testing.assert_allclose(found, expected, atol=1e-5)
        normals = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
        assert (normals[:, 2] > 0).all()  # mirrored triangles are seen from the same side


def test_instances_of_one_attribute_and_none(corners_of):
    translations = np.array([[0, 0, 1], [0, 0, 2]], "<f4")
    found = corners_of(instanced(translations, TRANSLATION=1))
    assert found[:, 0, 2].tolist() == [2.0, 4.0, 18.0]
    found = corners_of(instanced(np.arange(4, dtype="<f4"), _ID=1))
    np.testing.assert_allclose(found, [*4 * [TRIANGLE * 2 + [100, 0, 0]], CHILD])
    assert len(corners_of(instanced(translations[:0], TRANSLATION=1))) == 1
    assert len(corners_of(instanced())) == 2


def test_instances_that_do_not_fit(corners_of, monkeypatch):
    translations, turns = np.zeros((2, 3), "<f4"), np.zeros((3, 4), "<f4")
    with pytest.raises(ValueError, match=r"have \[2, 3\] elements"):
        corners_of(instanced(translations, turns, TRANSLATION=1, ROTATION=2))
    with pytest.raises(ValueError, match="'rotation' is zero"):
        corners_of(instanced(translations, turns[:2], TRANSLATION=1, ROTATION=2))
    content = instanced(translations, TRANSLATION=1)
    content["accessors"][1]["count"] = 10**9
    with pytest.raises(ValueError, match="at most 1,000,000"):
        corners_of(content)
    monkeypatch.setattr(gltf_import, "MAX_INSTANCES", 2)
    with pytest.raises(ValueError, match="or 2 instances"):
        corners_of(instanced(translations, TRANSLATION=1))


def test_an_instance_has_no_vertices_of_the_next(corners_of):
    content = instanced(np.zeros((2, 3), "<f4"), np.array([0, 1, 4], "<u2"), TRANSLATION=1)
    content["meshes"][0]["primitives"][0]["indices"] = 2
    with pytest.raises(ValueError, match="a triangle has vertex 4; there are 3"):
        corners_of(content)


def test_the_own_exports_with_and_without_instances_agree(tmp_path):
    ground = Terrain.from_heights(np.zeros((5, 5)), 10.0, origin=(0.0, 0.0))
    forest = procedural_forest(
        (0.0, 0.0, 40.0, 40.0), species=["broadleaf"], trees=12, terrain=ground, seed=3
    )
    read = []
    for made in (glb_of, instanced_glb_of):
        path = tmp_path / f"{made.__name__}.glb"
        colours = base_colours()
        path.write_bytes(made(None, forest, (TANK,), colours=colours, detail=DetailLevel.COARSE))
        read.append(read_mesh(path))
    plain, few = read
    # vertices are rounded for rendering, which leaves some triangles without an area
    counts = [len(file.triangles) + file.dropped for file in read]
    assert counts[0] == counts[1] > 1000
    assert few.mesh.area == pytest.approx(plain.mesh.area, rel=1e-2)
    np.testing.assert_allclose(few.mesh.bounds, plain.mesh.bounds, atol=0.02)


# ------------------------------------------------------------------------------ content and suffix


@pytest.mark.parametrize("name", ["a.gltf", "a.glb", "A.GLB"])
@pytest.mark.parametrize("kind", ["text", "binary", "utf-8-sig", "utf-16"])
def test_the_content_distinguishes_text_from_binary(tmp_path, name, kind):
    path = tmp_path / name
    if kind == "binary":
        path.write_bytes(glb_of(None, None, (TANK,), colours=base_colours()))
        assert read_mesh(path).mesh.bounds[1, 2] == pytest.approx(3.0)
        return
    code = "utf-8" if kind == "text" else kind
    path.write_bytes(json.dumps(document(TRIANGLE)).encode(code))
    np.testing.assert_allclose(read_mesh(path).mesh.bounds, [[0, 0, 0], [1, 0, 1]])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\xa0\xff", r"it is neither binary glTF nor JSON \(no text\)"),
        (b"solid a", r"it is neither binary glTF nor JSON \(Expecting value: line 1"),
        (b"glTF\x01\0\0\0" + bytes(12), "it is binary glTF of version 1; version 2 is read"),
        (b"glTF\x02\0", "it ends within its head"),
    ],
)
@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_what_is_no_gltf_says_so(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(DataFileError, match=message):
        read_mesh(path)
