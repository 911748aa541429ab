"""Points inside of solids, and what solids and the ground are made of."""

import numpy as np
import pytest
from plain_scene import PlainScene
from scene_samples import wall

from volery.world.ground_cover import GroundCover
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain


def cube(x=0.0, side=2.0):
    low, high = 0.0, side
    points = [
        [a + x, b, c]
        for c in (low, high)
        for a, b in ((low, low), (high, low), (high, high), (low, high))
    ]
    quads = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (3, 2, 1, 0), (4, 5, 6, 7)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return Mesh(np.array(points), np.array(faces))


def is_inside(points, x):
    in_yz = ((points[:, 1:] > 0.0) & (points[:, 1:] < 2.0)).all(axis=1)
    return in_yz & (points[:, 0] > x) & (points[:, 0] < x + 2.0)


@pytest.mark.parametrize("scene_class", [Scene, PlainScene])
def test_points_inside_of_closed_solids(scene_class):
    points = np.random.default_rng(5).uniform(-1.0, 8.0, (500, 3))
    sheet = Mesh(cube(6.0).vertices, cube(6.0).triangles[-2:])  # its lid alone
    meshes = [cube(), wall(3.0), cube(4.0), sheet]
    solids = [Solid(m, Material.WALL, "solid", is_shell=not m.is_closed) for m in meshes]
    scene = scene_class(None, None, solids=solids)
    wanted = np.full(500, -1)
    wanted[is_inside(points, 0.0)] = 1
    wanted[is_inside(points, 4.0)] = 3
    np.testing.assert_array_equal(scene.enclosing(points), wanted)
    assert (scene.clearance(points, 20.0).distance < 0.0).sum() == (wanted >= 0).sum()
    scene.close()


def test_what_is_closed():
    assert cube().is_closed
    loose = Mesh(cube().corners.reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert loose.is_closed
    assert not Mesh(cube().vertices, cube().triangles[1:]).is_closed
    assert not Mesh(
        cube().vertices, np.vstack([cube().triangles[:1, ::-1], cube().triangles[1:]])
    ).is_closed


@pytest.mark.parametrize("scene_class", [Scene, PlainScene])
def test_materials_of_tops_sides_and_ground(scene_class):
    cover = GroundCover(np.array([[Material.ASPHALT, Material.PAVING]], np.uint8), -5.0, -5.0, 5.0)
    solid = Solid(cube(), Material.FACADE, "cube", top=Material.ROOF)
    terrain = Terrain.flat(40.0, origin=(-20.0, -20.0))
    scene = scene_class(terrain, None, solids=[solid], cover=cover)
    origins = [
        [1.0, 0.7, 9.0],
        [-2.0, -2.0, 9.0],
        [3.0, -2.0, 9.0],
        [9.0, 9.0, 9.0],
        [-9.0, 1.0, 0.5],
    ]
    directions = [[0.0, 0.0, -1.0]] * 4 + [[1.0, 0.0, 0.0]]
    hits = scene.cast(origins, directions, 50.0)
    assert hits.material.tolist() == [
        Material.ROOF,
        Material.ASPHALT,
        Material.PAVING,
        Material.GROUND,
        Material.FACADE,
    ]
    np.testing.assert_allclose(hits.distance, [7.0, 9.0, 9.0, 9.0, 9.0], atol=1e-5)
    assert scene.enclosing([[1.0, 1.0, 1.0], [3.0, 0.0, 1.0]]).tolist() == [1, -1]
    scene.close()
