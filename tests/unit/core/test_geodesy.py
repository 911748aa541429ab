"""Tests WGS-84 against the ellipsoid's definition, textbook lengths, and round trips."""

import numpy as np
import pytest

from volery.core import geodesy
from volery.core.geodesy import LocalFrame

A, B = 6_378_137.0, 6_356_752.314245
"""Semi-axes of WGS-84 (NIMA TR 8350.2)."""


def positions(count=2000, seed=5):
    rng = np.random.default_rng(seed)
    low, high = [-np.pi / 2, -np.pi, -5_000.0], [np.pi / 2, np.pi, 400_000.0]
    return rng.uniform(low, high, (count, 3))


def test_surface_points_lie_on_the_ellipsoid_with_the_stated_normal():
    """The latitude is the angle of the surface's normal, which is the gradient of its equation."""
    geodetic = positions()
    geodetic[:, 2] = 0.0
    x, y, z = geodesy.ecef_from_geodetic(geodetic).T
    np.testing.assert_allclose((x**2 + y**2) / A**2 + z**2 / B**2, 1.0, atol=1e-14)
    normal = np.stack([x / A**2, y / A**2, z / B**2], axis=-1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(np.arcsin(normal[:, 2]), geodetic[:, 0], atol=1e-7)
    np.testing.assert_allclose(np.arctan2(normal[:, 1], normal[:, 0]), geodetic[:, 1], atol=1e-12)
    high = geodetic + np.array([0.0, 0.0, 1234.5])
    climbed = geodesy.ecef_from_geodetic(high) - np.stack([x, y, z], axis=-1)
    np.testing.assert_allclose(climbed, 1234.5 * normal, atol=1e-8)


def test_known_points():
    ecef = geodesy.ecef_from_geodetic([[0, 0, 0], [np.pi / 2, 0, 0], [0, np.pi / 2, 100.0]])
    np.testing.assert_allclose(ecef, [[A, 0, 0], [0, 0, B], [0, A + 100.0, 0]], atol=1e-6)


def test_round_trip_is_exact_to_a_nanometre_scale():
    geodetic = positions()
    back = geodesy.geodetic_from_ecef(geodesy.ecef_from_geodetic(geodetic))
    np.testing.assert_allclose(back[:, :2], geodetic[:, :2], atol=1e-14)
    np.testing.assert_allclose(back[:, 2], geodetic[:, 2], atol=2e-8)


@pytest.mark.parametrize("latitude", [90.0, -90.0])
def test_poles(latitude):
    frame = LocalFrame.from_degrees(latitude, 0.0, 0.0)
    there = frame.geodetic_from_enu([0.0, 0.0, 50.0])
    assert np.degrees(there[0]) == pytest.approx(latitude)
    assert there[2] == pytest.approx(50.0, abs=1e-6)


def test_a_degree_has_the_length_of_the_tables():
    """On WGS-84 at 45 degrees: 111 131.7 m a degree of latitude, 78 846.8 m one of longitude."""
    frame = LocalFrame.from_degrees(45.0, 7.0, 0.0)
    step = 1e-4
    here = np.array([45.0, 7.0])
    for axis, length, direction in ((0, 111_131.7, [0, 1, 0]), (1, 78_846.8, [1, 0, 0])):
        there = here.copy()
        there[axis] += step
        enu = frame.enu_from_geodetic([*np.radians(there), 0.0])
        np.testing.assert_allclose(enu / step, np.multiply(length, direction), atol=0.2)


def test_local_frame_round_trip_and_axes():
    frame = LocalFrame.from_degrees(47.397742, 8.545594, 488.0)
    np.testing.assert_allclose(frame.geodetic_from_enu([0, 0, 0]), frame.origin_geodetic)
    np.testing.assert_allclose(np.linalg.det(frame.enu_from_ecef_matrix), 1.0)
    enu = np.random.default_rng(3).uniform(-5000.0, 5000.0, (500, 3))
    geodetic = frame.geodetic_from_enu(enu)
    np.testing.assert_allclose(frame.enu_from_geodetic(geodetic), enu, atol=1e-7)
    # East raises the longitude, north the latitude; a plane leaves the earth as d^2 / 2R.
    east, north = frame.geodetic_from_enu([[1000.0, 0, 0], [0, 1000.0, 0]])
    assert east[1] > frame.longitude_rad
    assert north[0] > frame.latitude_rad
    assert east[2] - 488.0 == pytest.approx(1000.0**2 / 2 / 6.39e6, rel=0.01)
