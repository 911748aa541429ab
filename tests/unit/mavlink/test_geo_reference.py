"""The autopilot's own places on the earth against those of `core.geodesy`."""

import math

import numpy as np
import pytest

from volery.core.geodesy import LocalFrame
from volery.mavlink.autopilot.geo_reference import GeoReference

ORIGINS = [
    (47.397742, 8.545594, 488.0),
    (-33.9, 151.2, 20.0),
    (0.0, -179.99, 0.0),
    (78.2, 15.6, 3e3),
]


@pytest.mark.parametrize("origin", ORIGINS)
def test_it_agrees_with_the_geodesy_of_all_rooms(origin):
    earth, frame = GeoReference(*origin), LocalFrame.from_degrees(*origin)
    positions = np.random.default_rng(8).uniform(-20_000.0, 20_000.0, (200, 3)) * [1.0, 1.0, 0.05]
    for position, wanted in zip(positions, frame.geodetic_from_enu(positions), strict=True):
        latitude, longitude, altitude = earth.geodetic(tuple(position.tolist()))
        assert math.radians(latitude) == pytest.approx(wanted[0], abs=1e-11)
        turn = math.remainder(math.radians(longitude) - wanted[1], math.tau)
        assert turn == pytest.approx(0.0, abs=1e-11)
        assert altitude == pytest.approx(wanted[2], abs=1e-5)
        assert earth.map_position(latitude, longitude, altitude) == pytest.approx(
            position, abs=1e-4
        )
