"""Points inside closed meshes, and what solids and the ground are made of, by both backends."""

import numpy as np
import pytest
from scene_samples import wall

from volery.world.enclosure import enclosing, winding_number
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


def test_winding_numbers():
    assert winding_number(cube(), np.array([1.0, 1.0, 1.0])) == pytest.approx(1.0, abs=1e-9)
    assert winding_number(cube(), np.array([1.0, 1.0, 2.1])) == pytest.approx(0.0, abs=1e-9)
    inside_out = Mesh(cube().vertices, cube().triangles[:, ::-1])
    assert winding_number(inside_out, np.array([0.2, 1.9, 0.1])) == pytest.approx(-1.0, abs=1e-9)


def test_random_points_against_the_boxes():
    points = np.random.default_rng(5).uniform(-1.0, 8.0, (500, 3))
    meshes = [cube(), wall(3.0), cube(4.0)]
    boxes = np.array([mesh.bounds.ravel() for mesh in meshes])
    found = enclosing(meshes, boxes, points)
    in_yz = ((points[:, 1:] > 0.0) & (points[:, 1:] < 2.0)).all(axis=1)
    wanted = np.full(500, -1)
    wanted[in_yz & (points[:, 0] > 0.0) & (points[:, 0] < 2.0)] = 0
    wanted[in_yz & (points[:, 0] > 4.0) & (points[:, 0] < 6.0)] = 2
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("backend", ["embree", "embreex"])
def test_materials_of_tops_sides_and_ground(backend):
    cover = GroundCover(np.array([[Material.ASPHALT, Material.PAVING]], np.uint8), -5.0, -5.0, 5.0)
    solid = Solid(cube(), Material.FACADE, "cube", top=Material.ROOF)
    terrain = Terrain.flat(40.0, origin=(-20.0, -20.0))
    scene = Scene(terrain, None, solids=[solid], cover=cover, backend=backend)
    places = [
        [1.0, 0.7, 9.0],
        [-2.0, -2.0, 9.0],
        [3.0, -2.0, 9.0],
        [9.0, 9.0, 9.0],
        [-9.0, 1.0, 0.5],
    ]
    ways = [[0.0, 0.0, -1.0]] * 4 + [[1.0, 0.0, 0.0]]
    hits = scene.cast(places, ways, 50.0)
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
