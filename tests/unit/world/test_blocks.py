"""Blocks of grid maps: their volume, what rays and looks around meet, how many faces it takes."""

from __future__ import annotations

import contextlib
import ctypes
import math
import threading
import tracemalloc

import numpy as np
import pytest
from plain_scene import PlainScene

from volery.core.errors import CommandError
from volery.world import embree
from volery.world.grid_maps import GridMap, block_mesh
from volery.world.materials import Material
from volery.world.scene import Scene, Solid


def random_cells(seed=3, shape=(23, 31), fraction=0.4):
    return np.random.default_rng(seed).random(shape) < fraction


def grid_of(cells, cell=2.0, height=5.0, **options):
    return GridMap("g", cells, cell, height, **options)


def solid(grid, bottom=0.0):
    return Solid(block_mesh(grid, bottom, bottom + grid.block_height_m), Material.BLOCK, "block")


def volume(mesh):
    """Of a mesh without undersides at z = 0, by the divergence theorem."""
    a, b, c = np.moveaxis(mesh.corners.astype(np.float64), 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize("options", [{}, {"origin_m": (-7.0, 11.0), "yaw_rad": 0.7}])
def test_volume_and_walls_are_those_of_the_cells(options):
    cells = random_cells()
    grid = grid_of(cells, **options)
    mesh = block_mesh(grid, 0.0, 5.0)
    assert volume(mesh) == pytest.approx(cells.sum() * 4.0 * 5.0, rel=1e-5)
    normal, area = (
        mesh.face_normals,
        0.5
        * np.linalg.norm(
            np.cross(
                mesh.corners[:, 1] - mesh.corners[:, 0], mesh.corners[:, 2] - mesh.corners[:, 0]
            ),
            axis=1,
        ),
    )
    up = normal[:, 2] > 0.9
    assert area[up].sum() == pytest.approx(cells.sum() * 4.0, rel=1e-5)
    around = np.pad(cells, 1).astype(int)
    edges = np.abs(np.diff(around, axis=0)).sum() + np.abs(np.diff(around, axis=1)).sum()
    assert area[~up].sum() == pytest.approx(edges * 2.0 * 5.0, rel=1e-5)


def distance_by_cells(grid, origin, angle, max_range):
    """Range of a level ray through the cells, by stepping along it."""
    steps = np.arange(0.0, max_range, 2e-4)
    points = np.array(origin)[:2] + steps[:, None] * [math.cos(angle), math.sin(angle)]
    inside = (points - grid.origin_m) / grid.cell_size_m
    column, row = np.floor(inside).astype(int).T
    within = (column >= 0) & (row >= 0) & (column < grid.columns) & (row < grid.rows)
    hit = np.zeros(len(steps), bool)
    hit[within] = grid.blocked[row[within], column[within]]
    return steps[hit.argmax()] if hit.any() else np.inf


def test_rays_meet_the_cells_within_a_millimetre():
    cells = random_cells(fraction=0.15)
    cells[10:13, 14:17] = False
    grid = grid_of(cells, origin_m=(-30.0, -20.0))
    scene = Scene(None, None, solids=[solid(grid)])
    origin = (1.03, 3.07, 2.0)
    angles = np.linspace(-math.pi, math.pi, 90)
    rays = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(90)])
    hits = scene.cast(np.tile(origin, (90, 1)), rays, 40.0)
    want = np.array([distance_by_cells(grid, origin, a, 40.0) for a in angles])
    np.testing.assert_allclose(hits.distance, want, atol=1e-3)
    seen = np.isfinite(want)
    assert seen.sum() > 60
    assert (hits.material[seen] == Material.BLOCK).all()
    above = scene.cast([[origin[0], origin[1], 5.1]], rays[:1], 40.0)
    assert np.isinf(above.distance[0])
    scene.close()


@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_no_ray_slips_between_the_faces(yaw):
    """Straight down at every corner of every cell of one large block: where rectangles meet."""
    cells = np.ones((12, 12), bool)
    cells[3, 4] = cells[7, 2:9] = False  # several rectangles side by side
    grid = grid_of(cells, cell=1.0, yaw_rad=yaw)
    scene = Scene(None, None, solids=[solid(grid)])
    corner = np.array([[x, y] for x in range(1, 12) for y in range(1, 12)], float)
    beside = [cells[int(y) - 1 : int(y) + 1, int(x) - 1 : int(x) + 1].all() for x, y in corner]
    points = grid.map_from_cells(corner[beside])
    o = np.column_stack([points, np.full(len(points), 8.0)])
    hits = scene.cast(o, np.tile([0.0, 0.0, -1.0], (len(o), 1)), 20.0)
    np.testing.assert_allclose(hits.distance, 3.0, atol=1e-5)
    scene.close()


@pytest.mark.parametrize("scene_class", [Scene, PlainScene])
def test_inside_of_a_block_the_distance_is_below_zero(scene_class):
    cells = np.zeros((9, 9), bool)
    cells[2:7, 2:7] = True
    scene = scene_class(None, None, solids=[solid(grid_of(cells, cell=1.0, height=4.0))])
    points = [[4.5, 4.5, 3.0], [2.25, 4.0, 2.0], [1.5, 4.0, 2.0], [4.5, 4.5, 5.0], [5.0, 5.0, 1.0]]
    found = scene.clearance(points, 20.0, include_terrain=False)
    np.testing.assert_allclose(found.distance, [-1.0, -0.25, 0.5, 1.0, -2.0], atol=1e-6)
    assert found.instance.tolist() == [1] * 5
    near = scene.clearance(points[:1], 0.3, include_terrain=False)
    assert (near.distance[0], near.instance[0]) == (-0.3, 1)
    scene.close()


def test_degenerate_maps():
    assert len(block_mesh(grid_of(np.zeros((1, 1), bool)), 0.0, 1.0)) == 0
    one = block_mesh(grid_of(np.ones((1, 1), bool), cell=1.0), 0.0, 1.0)
    assert len(one) == 10  # a top and four walls
    assert volume(one) == pytest.approx(1.0)
    full = block_mesh(grid_of(np.ones((4096, 4096), bool), cell=0.1), 0.0, 1.0)
    assert len(full) == 10
    assert volume(full) == pytest.approx(409.6**2, rel=1e-5)
    ragged = np.indices((4096, 4096)).sum(axis=0) % 2 == 0
    with pytest.raises(CommandError, match=r"too irregular.* faces, more than"):
        block_mesh(grid_of(ragged, cell=0.1), 0.0, 1.0)


def test_blocks_replace_each_other_and_leave_the_rest():
    wall = Solid(
        block_mesh(grid_of(np.ones((1, 1), bool), origin_m=(50, 0)), 0, 9), Material.WALL, "w"
    )
    first, second = (grid_of(random_cells(seed), origin_m=(0.0, 10.0)) for seed in (1, 2))
    for scene_class in (Scene, PlainScene):
        scene = scene_class(None, None, solids=[wall, solid(first)])
        fresh = scene_class(None, None, solids=[wall, solid(second)])
        rng = np.random.default_rng(0)
        o = rng.uniform([0, 5, 0.5], [60, 60, 8], (3000, 3))
        d = rng.normal(size=(3000, 3))
        d /= np.linalg.norm(d, axis=1)[:, None]
        before = scene.cast(o, d, 60.0)
        offset = scene.moving_offset
        assert scene.replace_solids([wall, solid(second)]) == 2
        after, want = scene.cast(o, d, 60.0), fresh.cast(o, d, 60.0)
        assert not np.array_equal(before.distance, after.distance)
        for mine, theirs in zip(after, want, strict=True):
            np.testing.assert_array_equal(mine, theirs)
        points = rng.uniform([0, 5, 0.5], [60, 60, 8], (200, 3))
        near, other = scene.clearance(points, 5.0), fresh.clearance(points, 5.0)
        np.testing.assert_array_equal(near.distance, other.distance)
        assert scene.moving_offset == offset
        assert scene.replace_solids([wall]) == 2
        assert scene.moving_offset == offset - 1
        assert scene.instance_name(1) == "w"
        assert (scene.cast(o, d, 60.0).instance <= 1).all()
        scene.close()
        fresh.close()


def test_replacing_many_times_does_not_grow():
    grid = grid_of(random_cells(shape=(300, 300)), cell=1.0)
    blocks = solid(grid)
    scene = Scene(None, None, solids=[blocks])

    def replace(times):
        """How much more Embree and NumPy hold afterwards, in the meshes' sizes."""
        before = embree_bytes(), tracemalloc.get_traced_memory()[0]
        for _ in range(times):
            scene.replace_solids([Solid(blocks.mesh, Material.BLOCK, "block")])
        after = embree_bytes(), tracemalloc.get_traced_memory()[0]
        size = blocks.mesh.vertices.nbytes + blocks.mesh.triangles.nbytes
        return [(b - a) / size for a, b in zip(before, after, strict=True)]

    with counted() as embree_bytes:
        first = replace(1)  # with the tree of the first, which Embree holds until the next commit
        assert max(replace(20)) < 0.1, first
    scene.close()


@contextlib.contextmanager
def counted():
    """Count bytes in Embree, by its own report of each allocation, and in Python's arrays."""
    held, lock = [0], threading.Lock()

    def count(_, size, _is_done):
        with lock:  # it comes from Embree's threads
            held[0] += size
        return True

    library = embree.load()
    watch = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_bool)
    set_monitor = library.rtcSetDeviceMemoryMonitorFunction
    callback = watch(count)
    tracemalloc.start()
    set_monitor(ctypes.c_void_p(embree._device()), callback, None)
    try:
        yield lambda: held[0]
    finally:
        set_monitor(ctypes.c_void_p(embree._device()), None, None)
        tracemalloc.stop()
