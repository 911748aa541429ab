"""Exported worlds, read back by trimesh: the same surfaces, axes, names and colours."""

import json
import struct

import numpy as np
import pytest
import trimesh
from scene_samples import cylinder

from volery.core.frames import enu_from_gltf, gltf_from_enu
from volery.sensors.cameras.light import base_colours
from volery.world.forest import procedural_forest
from volery.world.gltf import glb_of
from volery.world.ground_cover import GroundCover
from volery.world.materials import Material
from volery.world.scene import Look, Scene, Solid
from volery.world.terrain import Terrain
from volery.world.trees.model import DetailLevel


@pytest.fixture(scope="module")
def world():
    heights = np.add.outer(np.arange(11.0), np.sin(np.arange(11.0)))
    terrain = Terrain.from_heights(heights, 6.0, origin=(-30.0, -30.0))
    forest = procedural_forest(
        (-25.0, -25.0, 25.0, 25.0),
        species=["broadleaf", "conifer"],
        trees=25,
        terrain=terrain,
        seed=2,
    )
    red = Solid(
        cylinder(3.0, 12.0, 8, 5.0, -4.0), Material.PAINTED, "tank", look=Look((0.8, 0.1, 0.1))
    )
    return terrain, forest, (red,)


def loaded(content, tmp_path):
    path = tmp_path / "world.glb"
    path.write_bytes(content)
    return trimesh.load_scene(path)


def document(content):
    length = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + length])


def test_rays_in_the_file_agree_with_ours(world, tmp_path):
    """Random rays through ground, trees and a solid: the same distances, cast by trimesh."""
    terrain, forest, solids = world
    read = loaded(glb_of(terrain, forest, solids, colours=base_colours()), tmp_path).to_mesh()
    rng = np.random.default_rng(1)
    origins = np.column_stack([rng.uniform(-20, 20, (400, 2)), rng.uniform(20, 30, 400)])
    directions = rng.normal(size=(400, 3)) * [1.0, 1.0, 0.3] - [0.0, 0.0, 0.4]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    scene = Scene(terrain, forest, solids=solids, detail=DetailLevel.SENSING)
    ours = scene.cast(origins, directions, 200.0).distance.astype(float)
    scene.close()
    theirs = np.full(400, np.inf)
    points, rays, _ = read.ray.intersects_location(
        gltf_from_enu(origins), gltf_from_enu(directions), multiple_hits=False
    )
    theirs[rays] = np.linalg.norm(enu_from_gltf(points) - origins[rays], axis=1)
    hit = np.isfinite(ours)
    assert hit.sum() > 100
    same = np.isclose(ours[hit], theirs[hit], atol=2e-3)
    assert same.mean() > 0.995  # rays along a leaf's very edge may pass it


def test_trees_share_the_meshes_of_their_models(world):
    terrain, forest, solids = world
    content = document(glb_of(terrain, forest, solids, colours=base_colours()))
    assert len(content["nodes"]) == 1 + 25 + 1
    assert len(content["meshes"]) == 1 + len(forest.models) + 1
    names = [node["name"] for node in content["nodes"]]
    assert names == ["ground", *(f"tree {k}" for k in range(1, 26)), "tank"]


def test_materials_and_their_colours(world, tmp_path):
    terrain, forest, solids = world
    content = glb_of(terrain, forest, solids, colours=base_colours())
    colours = {
        m["name"]: m["pbrMetallicRoughness"]["baseColorFactor"]
        for m in document(content)["materials"]
    }
    assert set(colours) == {"ground", "wood", "leaf", "painted"}
    assert colours["painted"][0] > 5.0 * colours["painted"][1]
    tank = loaded(content, tmp_path).geometry
    assert any(mesh.visual.material.name == "painted" for mesh in tank.values())


def test_north_is_minus_z_and_up_is_y(world, tmp_path):
    terrain, _, _ = world
    bounds = loaded(glb_of(terrain, None, colours=base_colours()), tmp_path).bounds
    low, high = bounds
    np.testing.assert_allclose((low[0], high[0]), (-30.0, 30.0))
    np.testing.assert_allclose((low[2], high[2]), (-30.0, 30.0))
    assert high[1] == pytest.approx(float(np.asarray(terrain.grid.heights).max()), abs=1e-4)


def test_streets_lie_over_the_ground_as_an_image(world, tmp_path):
    """A point of the ground has, in the image, the colour of its cell, and earth beyond."""
    terrain, _, _ = world
    cells = np.array([[Material.ASPHALT, Material.PAVING], [Material.PAVING, Material.ASPHALT]])
    cover = GroundCover(cells.astype(np.uint8), -10.0, -20.0, 10.0)
    content = glb_of(terrain, None, colours=base_colours(), cover=cover)
    (mesh,) = loaded(content, tmp_path).geometry.values()
    image = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"), float)
    uv = np.asarray(mesh.visual.uv)
    points = enu_from_gltf(mesh.vertices)
    for x, y, wanted in (
        (-6.0, -12.0, Material.ASPHALT),
        (6.0, -12.0, Material.PAVING),
        (-6.0, -6.0, Material.PAVING),
        (18.0, 6.0, Material.GROUND),
    ):
        row = np.argmin(np.linalg.norm(points[:, :2] - (x, y), axis=1))
        u, v = uv[row].clip(0.0, 0.999)  # trimesh counts v from below
        pixel = image[int((1.0 - v) * len(image)), int(u * image.shape[1])] / 255.0
        linear = np.where(pixel <= 0.04045, pixel / 12.92, ((pixel + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(linear, base_colours()[wanted], atol=0.01)


def test_a_world_of_nothing_is_still_a_file():
    content = glb_of(None, None, colours=base_colours())
    assert struct.unpack_from("<4sII", content) == (b"glTF", 2, len(content))
    assert document(content)["scenes"] == [{}]
