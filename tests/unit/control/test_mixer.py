import numpy as np
import pytest
from flights import F450, ring
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.control.gains import gains_of
from volery.control.mixer import mix
from volery.control.setpoints import new_control_states
from volery.vehicle.airframe import wrench_matrix
from volery.vehicle.compiled import fused_kernel

FRAMES = {"f450": F450, "six": ring(6), "eight": ring(8)}
GAINS = {name: gains_of(frame, 1e-3) for name, frame in FRAMES.items()}


@fused_kernel
def _mix(gains, control_states, thrust, ax, ay, az):
    mix(gains[0], thrust, ax, ay, az, control_states[0])


def mixed(name, thrust, torque):
    """Rotor thrusts, and the thrust and torque (4,) that they make."""
    frame, control_states = FRAMES[name], new_control_states(np.array([[0.0, 0.0, 0.0, 1.0]]))
    control_states["full_thrust"] = frame.max_rotor_thrust
    acceleration = np.array(torque) / frame.body.inertia_kg_m2
    _mix(GAINS[name], control_states, float(thrust), *map(float, acceleration))
    speeds = control_states["rotor_reference"][0, : len(frame.rotors.places)]
    assert not control_states["rotor_reference"][0, len(frame.rotors.places) :].any()
    forces = frame.rotors.thrust_n_s2 * speeds**2
    return forces, wrench_matrix(frame)[2:] @ forces


names = st.sampled_from(sorted(FRAMES))
thrusts = st.floats(0.0, 120.0)
torques = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-5, 5))


@settings(max_examples=300)
@given(names, thrusts, torques)
def test_every_rotor_stays_in_range(name, thrust, torque):
    forces, _ = mixed(name, thrust, torque)
    gains = GAINS[name]
    assert (forces >= gains["idle_thrust"][0] * (1 - 1e-9)).all()
    assert (forces <= FRAMES[name].max_rotor_thrust * (1 + 1e-9)).all()


@settings(max_examples=300)
@given(names, st.floats(0.5, 1.3), st.tuples(*[st.floats(-0.3, 0.3)] * 2, st.floats(-0.1, 0.1)))
def test_what_fits_is_given_exactly(name, weights, torque):
    thrust = weights * FRAMES[name].weight
    _, made = mixed(name, thrust, torque)
    np.testing.assert_allclose(made, [thrust, *torque], atol=1e-9)


@settings(max_examples=300)
@given(names, thrusts, torques)
def test_roll_and_pitch_never_change_their_direction_or_grow(name, thrust, torque):
    _, made = mixed(name, thrust, torque)
    wanted = np.array(torque[:2])
    size = np.linalg.norm(wanted)
    if size > 1e-6:
        share = made[1:3] @ wanted / size**2
        assert -1e-9 <= share <= 1 + 1e-9
        np.testing.assert_allclose(made[1:3], share * wanted, atol=1e-6)
    assert made[3] * torque[2] >= -1e-9
    assert abs(made[3]) <= abs(torque[2]) + 1e-9


@pytest.mark.parametrize("name", FRAMES)
@pytest.mark.parametrize("thrust", [0.0, 1e3])
def test_attitude_goes_before_thrust(name, thrust):
    """At no thrust and at full thrust, moderate roll and pitch are still given in full."""
    _, made = mixed(name, thrust, (0.8, -0.5, 0.0))
    np.testing.assert_allclose(made[1:3], (0.8, -0.5), atol=1e-9)


def test_yaw_gives_way_to_roll():
    _, alone = mixed("f450", F450.weight, (0.0, 0.0, 5.0))
    _, both = mixed("f450", F450.weight, (2.5, 0.0, 5.0))
    assert both[1] == pytest.approx(2.5)
    assert 0.0 < both[3] < alone[3]
