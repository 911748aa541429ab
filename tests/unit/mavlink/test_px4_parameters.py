"""Parameters that fit a PX4 to the airframe that it flies."""

import numpy as np
import pytest

from volery.cli.px4 import parameters_for
from volery.core.errors import BridgeError
from volery.mavlink.hil.px4_parameters import MAX_ROTORS, Px4Airframe, Px4Rotor, px4_parameters
from volery.vehicle.airframe import airframe_names, load_airframe, wrench_matrix


def test_the_iris_is_that_of_px4s_gazebo():
    found = parameters_for(load_airframe("iris"))
    assert found["CA_ROTOR_COUNT"] == 4
    positions = [(found[f"CA_ROTOR{i}_PX"], found[f"CA_ROTOR{i}_PY"]) for i in range(4)]
    assert positions == [(0.13, 0.22), (-0.13, -0.20), (0.13, -0.22), (-0.13, 0.20)]
    assert [found[f"CA_ROTOR{i}_KM"] for i in range(4)] == [0.06, 0.06, -0.06, -0.06]
    assert [found[f"PWM_MAIN_FUNC{i + 1}"] for i in range(4)] == [101, 102, 103, 104]


@pytest.mark.parametrize(
    ("name", "hover", "tilt"),
    [
        ("f450", 0.70, 45.0),
        ("iris", 0.73, 45.0),
        ("hummingbird", 0.54, 35.0),
        ("crazyflie", 0.67, 35.0),
    ],
)
def test_hover_throttle_and_tilt_are_the_airframes(name, hover, tilt):
    found = parameters_for(load_airframe(name))
    assert found["MPC_THR_HOVER"] == pytest.approx(hover, abs=0.005)
    assert found["MPC_TILTMAX_AIR"] == tilt


@pytest.mark.parametrize("name", airframe_names())
def test_px4s_allocation_has_the_airframes_effect(name):
    """The wrench of each rotor by PX4's formula, in FRD, is Volery's: T = KM on a ccw rotor."""
    airframe = load_airframe(name)
    found = parameters_for(airframe)
    for i, column in enumerate(wrench_matrix(airframe).T):
        axis = np.array([found[f"CA_ROTOR{i}_A{k}"] for k in "XYZ"])
        arm = np.array([found[f"CA_ROTOR{i}_P{k}"] for k in "XYZ"])
        torque = np.cross(arm, axis) - found[f"CA_ROTOR{i}_KM"] * axis
        flip = np.array([1.0, -1.0, -1.0])
        np.testing.assert_allclose(flip * column[:3], axis, atol=1e-5)
        np.testing.assert_allclose(flip * column[3:], torque, atol=1e-5)


def test_values_stay_in_px4s_ranges():
    rotor = Px4Rotor((0.1, 0.0, 0.0), (0.0, 0.0, 1.0), "cw")
    found = px4_parameters(Px4Airframe([rotor] * 4, 3.0, 0.95, 10.0))
    assert (found["MPC_THR_HOVER"], found["MPC_TILTMAX_AIR"]) == (0.8, 20.0)
    assert found["CA_ROTOR0_KM"] == -1.0
    assert "-0" not in {f"{value:g}" for value in found.values()}


def test_more_rotors_than_px4_can_have_are_refused():
    rotor = Px4Rotor((0.1, 0.0, 0.0), (0.0, 0.0, 1.0), "cw")
    with pytest.raises(BridgeError, match=f"{MAX_ROTORS + 1} rotors: PX4 can have at most"):
        px4_parameters(Px4Airframe([rotor] * (MAX_ROTORS + 1), 0.06, 0.5, 45.0))
