"""The earth's field against a published value, scipy's Legendre functions and a plain dipole."""

import math

import numpy as np
import pytest
from scipy.special import lpmv

from volery.core.geodesy import LocalFrame, ecef_from_geodetic
from volery.world import magnetic_field
from volery.world.magnetic_field import angles_of_field, field_enu, field_of_angles

RADIUS = 6_371_200.0
LOCATIONS = [
    (47.397742, 8.545594, 488.0),
    (-33.9, 151.2, 20.0),
    (71.0, -156.0, 0.0),
    (0.3, 100.0, 0.0),
]


def potential(ecef):
    """Scalar potential, T m, from the same coefficients by scipy's Legendre functions."""
    r = np.linalg.norm(ecef)
    longitude = math.atan2(ecef[1], ecef[0])
    total = 0.0
    for row in magnetic_field._coefficients():
        (n, m), (g, h) = row[:2].astype(int).tolist(), row[2:4]
        schmidt = math.sqrt((1 if m == 0 else 2) * math.factorial(n - m) / math.factorial(n + m))
        legendre = (-1) ** m * schmidt * lpmv(m, n, ecef[2] / r)
        wave = g * math.cos(m * longitude) + h * math.sin(m * longitude)
        total += RADIUS * (RADIUS / r) ** (n + 1) * wave * legendre * 1e-9
    return total


@pytest.mark.parametrize("location", LOCATIONS)
def test_field_is_the_gradient_of_the_series(location):
    frame = LocalFrame.from_degrees(*location)
    at = ecef_from_geodetic(frame.origin_geodetic)
    step = 200.0
    gradient = [(potential(at + d) - potential(at - d)) / (2 * step) for d in np.eye(3) * step]
    expected = -frame.enu_from_ecef_matrix @ gradient
    np.testing.assert_allclose(field_enu(frame), expected, atol=2e-12)


def test_dipole_alone_is_the_dipole(monkeypatch):
    table = magnetic_field._coefficients()[:2]
    monkeypatch.setattr(magnetic_field, "_coefficients", lambda: table)
    moment = np.array([-1410.3, 4545.5, -29350.0]) * 1e-9
    for location in LOCATIONS:
        frame = LocalFrame.from_degrees(*location)
        at = ecef_from_geodetic(frame.origin_geodetic)
        r = np.linalg.norm(at)
        out = at / r
        dipole = (RADIUS / r) ** 3 * (3.0 * (moment @ out) * out - moment)
        np.testing.assert_allclose(
            field_enu(frame), frame.enu_from_ecef_matrix @ dipole, atol=1e-15
        )


def test_field_is_that_of_the_world_magnetic_model():
    """WMM2025 at 65 N, 85 E, sea level, 2026.5: another model of the same field, within 20 nT."""
    field = field_enu(LocalFrame.from_degrees(65.0, 85.0, 0.0), 2026.5) * 1e9
    np.testing.assert_allclose(field, [2229.25, 8739.60, -60367.16], atol=20.0)


def test_angles_and_back():
    field = field_enu(LocalFrame.from_degrees(*LOCATIONS[0]))
    np.testing.assert_allclose(field_of_angles(*angles_of_field(field)), field, atol=1e-18)
    east_and_down = field_of_angles(math.radians(90.0), math.radians(30.0), 2.0)
    np.testing.assert_allclose(east_and_down, [2 * math.cos(math.pi / 6), 0, -1.0], atol=1e-15)


def test_poles_have_a_field():
    for latitude in (90.0, -90.0):
        assert 5e-5 < np.linalg.norm(field_enu(LocalFrame.from_degrees(latitude, 0, 0))) < 7e-5
