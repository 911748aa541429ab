import numpy as np
import pytest

from volery.core.errors import DataFileError
from volery.world.terrain import Terrain

HEIGHTS = [[0.0, 1.0, 4.0], [2.0, 3.0, 0.0]]


@pytest.fixture
def terrain() -> Terrain:
    return Terrain.from_heights(HEIGHTS, 2.0, (10.0, -4.0))


def test_heights_at_the_grid_points(terrain):
    x, y = np.meshgrid([10.0, 12.0, 14.0], [-4.0, -2.0])
    np.testing.assert_allclose(terrain.height(x, y), HEIGHTS)
    assert terrain.bounds == (10.0, -4.0, 14.0, -2.0)


def test_cells_are_split_from_lower_left_to_upper_right(terrain):
    # the middle of the right-hand cell lies on the edge between 1 (lower left) and 0 (upper right)
    assert terrain.height(13.0, -3.0) == pytest.approx(0.5)


def test_outside_counts_the_nearest_edge_point(terrain):
    assert terrain.height(1e6, 0.0) == pytest.approx(0.0)
    assert terrain.height(0.0, -4.0) == pytest.approx(0.0)
    assert terrain.normal(9.0, -3.0)[0] == 0.0
    np.testing.assert_allclose(terrain.normal(1e6, 1e6), [0.0, 0.0, 1.0])


def test_mesh_carries_the_same_surface(terrain):
    mesh = terrain.mesh()
    assert len(mesh) == 4
    centres = mesh.corners.mean(axis=1)
    x, y, z = centres.T
    np.testing.assert_allclose(terrain.height(x, y), z, atol=1e-5)
    np.testing.assert_allclose(terrain.normal(x, y), mesh.face_normals, atol=1e-6)
    assert (mesh.face_normals[:, 2] > 0).all()


def test_the_steepest_slope_is_that_of_a_triangle(terrain):
    mesh = terrain.mesh()
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles].astype(float), 1, 0)
    normals = np.cross(b - a, c - a)
    slopes = np.hypot(normals[:, 0], normals[:, 1]) / normals[:, 2]
    assert terrain.steepest == pytest.approx(slopes.max(), rel=1e-5)
    assert Terrain.flat(10.0, 3.0).steepest == 0.0


def test_flat_ground():
    flat = Terrain.flat(100.0, 2.5)
    assert flat.height(50.0, 20.0) == 2.5
    assert len(flat.mesh()) == 2


def test_scalars_and_grids_broadcast(terrain):
    assert terrain.height(11.0, -3.0).shape == ()
    assert terrain.height(np.zeros((3, 1)), np.zeros(4)).shape == (3, 4)
    assert terrain.normal(np.zeros((3, 1)), np.zeros(4)).shape == (3, 4, 3)


def test_reads_the_barro_colorado_grid(forest_data):
    terrain = Terrain.from_csv(forest_data / "bei_elevation.csv", 5.0)
    assert terrain.bounds == (0.0, 0.0, 1000.0, 500.0)
    assert terrain.height(5.0, 0.0) == pytest.approx(121.94)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2\n3,nan\n", "row 2, column 2: nan marks a place"),
        ("1,2\n3,inf\n", "row 2, column 2: not finite"),
        ("1,2\n3\n", "row 2 has 1 value, the first row 2"),
        ("1,2\n3,x\n1,2,3\n", "row 2, column 2: not a number; row 3 has 3 values"),
        ("1,2\n", "at least 2 x 2"),
        ("", "at least 2 x 2"),
    ],
)
def test_broken_grids_name_file_and_row(tmp_path, text, message):
    path = tmp_path / "grid.csv"
    path.write_text(text)
    with pytest.raises(DataFileError) as caught:
        Terrain.from_csv(path, 1.0)
    assert message in str(caught.value)
    assert "grid.csv" in str(caught.value)


def test_a_missing_grid_is_named(tmp_path):
    with pytest.raises(DataFileError, match=r"none\.csv does not exist"):
        Terrain.from_csv(tmp_path / "none.csv", 1.0)


@pytest.mark.parametrize(
    ("heights", "spacing"), [([[1.0, 2.0]], 1.0), ([[1.0, np.nan], [0, 0]], 1.0), (HEIGHTS, 0.0)]
)
def test_impossible_grids_are_refused(heights, spacing):
    with pytest.raises(ValueError, match="terrain"):
        Terrain.from_heights(heights, spacing)
