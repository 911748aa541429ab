"""Worlds as few nodes with many instances, held against the file with one node a tree."""

import json
import struct

import numpy as np
import pytest
import trimesh
from scene_samples import cylinder

from volery.core.frames import gltf_from_enu
from volery.sensors.cameras.light import base_colours
from volery.world.forest import procedural_forest
from volery.world.gltf import glb_of, instanced_glb_of
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene import Look, Solid
from volery.world.terrain import Terrain

FORMS = {5126: "<f4", 5121: "u1", 5123: "<u2", 5125: "<u4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Read:
    """A .glb file, read by the letter of the specification."""

    def __init__(self, content):
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size = struct.unpack_from("<I", content, 12)[0]
        self.json = json.loads(content[20 : 20 + size])
        self._data = content[28 + size :]

    def rows(self, number):
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        form, width = np.dtype(FORMS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        begin = view["byteOffset"] + accessor["byteOffset"]
        assert begin % form.itemsize == 0
        assert view.get("byteStride", form.itemsize * width) == form.itemsize * width
        assert (
            accessor["byteOffset"] + accessor["count"] * width * form.itemsize
            <= (view["byteLength"])
        )
        rows = np.frombuffer(self._data, form, accessor["count"] * width, begin)
        return rows.reshape(-1, width)

    def node(self, name):
        (found,) = [node for node in self.json["nodes"] if node["name"] == name]
        return found

    def primitives(self, node):
        return self.json["meshes"][node["mesh"]]["primitives"]


@pytest.fixture(scope="module")
def world():
    x = np.arange(31.0)
    terrain = Terrain.from_heights(np.tile(0.5 * x, (31, 1)), 2.0, origin=(-30.0, -30.0))
    forest = procedural_forest(
        (-25.0, -25.0, 25.0, 25.0),
        species=["broadleaf", "conifer"],
        trees=40,
        terrain=terrain,
        seed=2,
    )
    block = trimesh.creation.box((8.0, 6.0, 9.0))
    house = Mesh(np.asarray(block.vertices, np.float32), np.asarray(block.faces, np.uint32))
    solids = (
        Solid(cylinder(3.0, 12.0, 8, 5.0, -4.0), Material.PAINTED, "a", look=Look((0.8, 0.1, 0.2))),
        Solid(cylinder(2.0, 6.0, 8, -5.0, 9.0), Material.PAINTED, "b", look=Look((0.1, 0.4, 1.0))),
        Solid(
            house,
            Material.FACADE,
            "house",
            top=Material.ROOF,
            look=Look((1.0, 0.9, 0.8), 2.0, 3.0, 3),
        ),
    )
    return terrain, forest, solids


@pytest.fixture(scope="module")
def read(world):
    return Read(instanced_glb_of(*world, colours=base_colours(), extras={"kind": "forest"}))


def test_every_tree_stands_where_its_own_node_would(world, read):
    single = Read(glb_of(*world, colours=base_colours()))
    theirs = [
        (node["mesh"], *node["translation"], *node["rotation"], *node["scale"])
        for node in single.json["nodes"]
        if node["name"].startswith("tree ")
    ]
    ours = []
    for node in read.json["nodes"]:
        if not node["name"].startswith("trees "):
            continue
        attributes = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
        parts = [read.rows(attributes[name]) for name in ("TRANSLATION", "ROTATION", "SCALE")]
        ours += [(node["mesh"], *row) for row in np.hstack(parts).tolist()]
    assert len(ours) == 40
    np.testing.assert_allclose(sorted(ours), sorted(theirs), atol=1e-4)


def test_readers_without_instancing_are_refused(read):
    for key in ("extensionsUsed", "extensionsRequired"):
        assert read.json[key] == ["EXT_mesh_gpu_instancing"]
    assert read.json["asset"]["extras"] == {"kind": "forest"}


def test_the_meshes_of_the_models_are_the_same_but_for_their_grain(world, read):
    single = Read(glb_of(*world, colours=base_colours()))
    for number in range(1, 1 + len(world[1].models)):
        for ours, theirs in zip(
            read.json["meshes"][number]["primitives"],
            single.json["meshes"][number]["primitives"],
            strict=True,
        ):
            np.testing.assert_array_equal(
                read.rows(ours["indices"]), single.rows(theirs["indices"])
            )
            np.testing.assert_allclose(
                read.rows(ours["attributes"]["POSITION"]),
                single.rows(theirs["attributes"]["POSITION"]),
                atol=0.5 / 256.0 + 1e-6,
            )


def test_ground_and_wood_are_smooth_and_walls_are_not(read):
    (ground,) = read.primitives(read.node("ground"))
    normals = read.rows(ground["attributes"]["NORMAL"])
    # the ground rises by 0.25 m a metre towards the east
    slope = gltf_from_enu(np.array([-0.25, 0.0, 1.0]) / np.hypot(0.25, 1.0))
    np.testing.assert_allclose(normals, np.tile(slope, (len(normals), 1)), atol=0.01)
    tree = next(node for node in read.json["nodes"] if node["name"].startswith("trees "))
    materials = read.json["materials"]
    for primitive in read.primitives(tree):
        smooth = "NORMAL" in primitive["attributes"]
        assert smooth == (materials[primitive["material"]]["name"] == "wood")
        if smooth:
            lengths = np.linalg.norm(read.rows(primitive["attributes"]["NORMAL"]), axis=1)
            np.testing.assert_allclose(lengths, 1.0, atol=0.02)
    assert not any("NORMAL" in p["attributes"] for p in read.primitives(read.node("solids")))


def test_solids_are_one_node_that_remembers_their_looks(world, read):
    primitives = read.primitives(read.node("solids"))
    names = [read.json["materials"][p["material"]]["name"] for p in primitives]
    assert names == ["facade", "roof", "painted"]
    facade, roof, painted = primitives
    colours = read.rows(painted["attributes"]["COLOR_0"])
    assert {tuple(row) for row in colours.tolist()} == {(204, 26, 51, 255), (26, 102, 255, 255)}
    storeys = read.rows(facade["attributes"]["_STOREYS"])
    np.testing.assert_array_equal(storeys, np.tile([2.0, 3.0, 3.0], (len(storeys), 1)))
    assert "_STOREYS" not in roof["attributes"]
    triangles = sum(len(read.rows(p["indices"])) // 3 for p in primitives)
    assert triangles == sum(len(solid.mesh) for solid in world[2])


def test_all_of_a_large_forest_is_a_small_file(world):
    """A forest of 5,000 trees: each costs ten numbers."""
    terrain = Terrain.flat(600.0, origin=(-300.0, -300.0))
    few, many = (
        procedural_forest(
            (-250.0, -250.0, 250.0, 250.0),
            species=["conifer"],
            trees=trees,
            terrain=terrain,
            seed=4,
        )
        for trees in (1000, 3000)
    )
    sizes = [len(instanced_glb_of(terrain, each, colours=base_colours())) for each in (few, many)]
    assert sizes[1] - sizes[0] <= 2000 * 40 + 60_000  # and perhaps another model


def test_a_world_of_nothing_is_still_a_file():
    assert Read(instanced_glb_of(None, None, colours=base_colours())).json["scenes"] == [{}]
