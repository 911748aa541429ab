import numpy as np
import pytest

from volery.world.mesh import EMPTY, Mesh, concatenate


@pytest.fixture
def square() -> Mesh:
    corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]
    return Mesh(np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


def test_area_bounds_and_normals(square):
    assert square.area == pytest.approx(2.0)
    assert square.bounds.tolist() == [[0, 0, 0], [2, 1, 0]]
    assert square.face_normals.tolist() == [[0, 0, 1], [0, 0, 1]]


def test_arrays_are_read_only(square):
    with pytest.raises(ValueError, match="read-only"):
        square.vertices[0] = 1.0


def test_a_triangle_without_a_vertex_is_refused():
    with pytest.raises(ValueError, match="has vertex 3"):
        Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 3]], np.uint32))


def test_transform_moves_points_and_mirroring_keeps_outsides_out(square):
    shift = np.hstack([np.eye(3), [[1.0], [2.0], [3.0]]])
    assert square.transformed(shift).bounds[0].tolist() == [1, 2, 3]
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    assert square.transformed(mirror).face_normals.tolist() == [[0, 0, 1], [0, 0, 1]]


def test_concatenate_keeps_every_triangle(square):
    both = concatenate([square, EMPTY, square.transformed(2.0 * np.eye(4))])
    assert len(both) == 4
    assert both.area == pytest.approx(2.0 + 8.0)
    assert len(concatenate([])) == 0


def test_a_triangle_without_area_has_no_normal():
    flat = Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32))
    assert flat.face_normals.tolist() == [[0, 0, 0]]
