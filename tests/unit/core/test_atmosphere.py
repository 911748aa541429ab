"""Tests the standard atmosphere against the tables of ISO 2533."""

import numpy as np

from volery.core import atmosphere


def test_pressure_and_temperature_are_those_of_the_tables():
    altitude = [-1000.0, 0.0, 500.0, 1000.0, 2000.0, 5000.0, 11_000.0]
    pressure = [113_929.0, 101_325.0, 95_460.8, 89_874.6, 79_495.2, 54_019.9, 22_632.0]
    temperature = [294.65, 288.15, 284.90, 281.65, 275.15, 255.65, 216.65]
    np.testing.assert_allclose(atmosphere.pressure(altitude), pressure, rtol=1e-5)
    np.testing.assert_allclose(atmosphere.temperature(altitude), temperature, atol=1e-9)


def test_pressure_falls_as_the_weight_of_the_air():
    """Hydrostatics: dp/dh = -rho g with the density of an ideal gas."""
    h = np.linspace(0.0, 3000.0, 7)
    slope = (atmosphere.pressure(h + 0.5) - atmosphere.pressure(h - 0.5)) / 1.0
    density = atmosphere.pressure(h) / (287.05287 * atmosphere.temperature(h))
    np.testing.assert_allclose(slope, -density * 9.80665, rtol=1e-6)
