"""Lenses: there and back, against OpenCV's formula where it is installed, and at the edge."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.sensors.cameras.lens import distort, undistort
from volery.sensors.cameras.model import CameraModel

MILD = st.tuples(
    st.floats(-0.3, 0.3),
    st.floats(-0.1, 0.1),
    *[st.floats(-0.01, 0.01)] * 2,
    st.floats(-0.02, 0.02),
)
POINTS = st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6))


@given(MILD, POINTS)
def test_undistort_is_the_inverse(coefficients, point_in_image):
    there = distort(point_in_image, coefficients)
    np.testing.assert_allclose(undistort(there, coefficients), point_in_image, atol=1e-9)


@given(MILD, POINTS)
def test_formula_term_by_term(coefficients, point_in_image):
    k1, k2, p1, p2, k3 = coefficients
    x, y = point_in_image
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    wanted = [
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2),
        y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y,
    ]
    np.testing.assert_allclose(distort(point_in_image, coefficients), wanted, atol=1e-12)


def test_beyond_the_fold_nothing_is_seen():
    """With k1 = -.5 the image reaches to 2/3 of 1 / sqrt(1.5) and folds there."""
    barrel = (-0.5, 0.0, 0.0, 0.0, 0.0)
    edge = (2.0 / 3.0) * np.sqrt(1.0 / 1.5)
    assert np.isfinite(undistort([edge - 1e-3, 0.0], barrel)).all()
    assert np.isnan(undistort([edge + 1e-3, 0.0], barrel)).all()


@given(MILD, POINTS, st.floats(0.5, 50.0))
def test_pixels_of_points_look_at_them(coefficients, point_in_image, depth):
    """The ray of the pixel that a point is projected to goes through the point."""
    model = CameraModel(distortion=coefficients, horizontal_fov_deg=70.0)
    point = np.array([point_in_image[0] * depth, point_in_image[1] * depth, depth])
    pixel = model.project(point)
    ideal = undistort((pixel - model.centre_px) / model.focal_px, coefficients)
    np.testing.assert_allclose(ideal, point_in_image, atol=1e-8)


def test_points_behind_have_no_pixel():
    assert np.isnan(CameraModel().project([0.0, 0.0, -1.0])).all()


def test_the_matrix_is_that_of_the_field_of_view():
    model = CameraModel(width=640, height=480, horizontal_fov_deg=60.0)
    assert model.focal_px == pytest.approx(554.256, abs=1e-3)
    left = model.project([-np.tan(np.radians(30.0)), 0.0, 1.0])
    assert left[0] == pytest.approx(-0.5)  # the outer edge of the first pixel


@pytest.mark.parametrize(
    "numbers",
    [
        {"width": 0},
        {"width": 8193},
        {"horizontal_fov_deg": 180.0},
        {"near_m": 5.0, "far_m": 5.0},
        {"samples": 3},
        {"exposure": 0.0},
        {"readout_s": -0.1},
    ],
)
def test_impossible_cameras_are_refused(numbers):
    with pytest.raises(ValueError, match=next(iter(numbers))):
        CameraModel(**numbers)
