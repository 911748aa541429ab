"""Trees in two pieces: no triangle lost, less box than the whole, all hits as before."""

import numpy as np
import pytest
from plain_scene import PlainScene

from volery.world.forest import procedural_forest
from volery.world.materials import Material
from volery.world.mesh import EMPTY, Mesh, concatenate
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.tree_pieces import foot_and_crown
from volery.world.trees import DetailLevel
from volery.world.trees.model import TreeMesh


def forest(terrain, species):
    return procedural_forest(
        (0.0, 0.0, 30.0, 30.0), species=species, terrain=terrain, trees=18, seed=3
    )


def sorted_corners(*meshes):
    corners = concatenate(meshes).corners.reshape(-1, 9)
    return corners[np.lexsort(corners.T)]


def surface(*meshes):
    corners = concatenate(meshes).corners.reshape(-1, 3)
    x, y, z = np.ptp(corners, axis=0)
    return x * y + y * z + z * x


@pytest.mark.parametrize("species", ["beilschmiedia_pendula", "conifer"])
def test_pieces_hold_all_triangles_in_less_box(species):
    for model in forest(Terrain.flat(30.0), species).models:
        tree = model.levels[DetailLevel.SENSING]
        foot, crown = foot_and_crown(tree)
        for part in ("wood", "leaves"):
            whole, pieces = getattr(tree, part), [getattr(foot, part), getattr(crown, part)]
            np.testing.assert_array_equal(sorted_corners(whole), sorted_corners(*pieces))
        together = surface(foot.wood, foot.leaves) + surface(crown.wood, crown.leaves)
        assert together < surface(tree.wood, tree.leaves)


def test_what_has_no_foot_stays_whole():
    square = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [1, 0, 2], [0, 0, 2]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )
    foot, crown = foot_and_crown(TreeMesh(square, EMPTY))
    assert (len(foot.wood), len(crown.wood), len(crown.leaves)) == (2, 0, 0)
    foot, crown = foot_and_crown(TreeMesh(EMPTY, EMPTY))
    assert [len(piece.wood) + len(piece.leaves) for piece in (foot, crown)] == [0, 0]


@pytest.mark.parametrize("scene_class", [Scene, PlainScene])
def test_hits_name_tree_and_material_of_either_piece(scene_class):
    terrain = Terrain.flat(30.0)
    trees = forest(terrain, "beilschmiedia_pendula")
    scene = scene_class(terrain, trees)
    try:
        for row, transform in enumerate(trees.tree_transforms()):
            tree = trees.models[trees.model_index[row]].levels[DetailLevel.SENSING]
            for piece in foot_and_crown(tree):
                for material, mesh in (
                    (Material.WOOD, piece.wood),
                    (Material.LEAF, piece.leaves),
                ):
                    if not len(mesh):
                        continue
                    placed = mesh.transformed(transform)
                    target = placed.corners[0].mean(axis=0)
                    normal = placed.face_normals[0]
                    # From so near that nothing else lies between.
                    hits = scene.cast([target + 1e-3 * normal], [-normal], 0.1)
                    assert hits.instance[0] == 1 + row
                    assert hits.material[0] == material
                    assert hits.distance[0] == pytest.approx(1e-3, abs=1e-4)
                    nearest = scene.clearance([target], 1.0)
                    assert nearest.instance[0] == 1 + row
                    assert nearest.distance[0] == pytest.approx(0.0, abs=1e-5)
    finally:
        scene.close()
