"""Limits of batches of UAVs with different airframes."""

from types import SimpleNamespace

import numpy as np
import pytest

from volery.control.batch_limits import BatchLimits
from volery.core.errors import CommandError
from volery.vehicle.airframe import load_airframe
from volery.vehicle.plant_types import RigidBody


@pytest.fixture
def limits():
    """Limits of a tricopter and a Crazyflie."""
    three = SimpleNamespace(
        rotors=SimpleNamespace(places=(1, 2, 3), max_speed_rad_s=100.0),
        limits=SimpleNamespace(rate_deg_s=90.0),
        max_rotor_thrust=2.0,
    )
    airframes = (three, load_airframe("crazyflie"))
    return BatchLimits(airframes, (RigidBody(), RigidBody()), ("tri", "crazyflie"))


def test_columns_beyond_the_rotors_of_a_uav_are_ignored(limits):
    assert limits.num_rotors == 4
    speeds = limits.rotor_speeds(np.array([[1.0, 2.0, 3.0, np.nan], [1.0, 2.0, 3.0, 2000.0]]))
    np.testing.assert_array_equal(speeds, [[1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 3.0, 2000.0]])


def test_each_uav_has_its_own_limit(limits):
    with pytest.raises(CommandError, match=r"of tri is out of range; .* 0 to 100 are allowed"):
        limits.rotor_speeds(np.full((2, 4), 101.0))
    np.testing.assert_array_equal(limits.thrusts(np.array([6.0, 0.1])), [6.0, 0.1])
    with pytest.raises(CommandError, match=r"thrust = 6.0 of crazyflie is out of range"):
        limits.thrusts(np.array([6.0, 6.0]))
    four_turns = 4.0 * np.radians(90.0)
    with pytest.raises(
        CommandError, match=rf"of tri .* from -{four_turns:.6g} to {four_turns:.6g}"
    ):
        limits.rates(np.array([[7.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))


def test_attitudes_are_normalised(limits):
    found = limits.attitudes(np.array([[0.0, 0.0, 0.0, 0.95], [0.0, 0.0, 1.0, 0.0]]))
    np.testing.assert_allclose(found, [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
