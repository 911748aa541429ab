"""The outer loop's law against its closed form, and the reference that it tracks."""

import numpy as np
import pytest
from flights import F450, FLAT, in_air
from scipy.linalg import expm

from volery.control.gains import gains_of
from volery.control.outer_loop import track
from volery.control.reference import lead_height, lead_level, move_on
from volery.control.rpt import tracking_gains
from volery.control.setpoints import new_control_states
from volery.vehicle.airframe import GRAVITY, Airframe
from volery.vehicle.compiled import fused_kernel
from volery.vehicle.drag import drag_acceleration
from volery.vehicle.fleet import new_bodies
from volery.world.weather import Weather

UP = np.array([[0.0, 0.0, 0.0, 1.0]])


@fused_kernel
def _track(control_states, bodies, gains, fx, fy, fz):
    track(control_states[0], bodies[0], gains[0], True, True, fx, fy, fz)


@fused_kernel
def _lead(control_states, bodies, gains):
    move_on(control_states[0], gains[0])
    lead_level(control_states[0], bodies[0], gains[0], gains[0].speed)
    lead_height(control_states[0], bodies[0], gains[0], gains[0].climb, gains[0].descent)


def fine_gains(airframe=F450, tick=1e-3):
    gains = gains_of(airframe, 1e-3)
    gains["tick"], gains["inverse_tick"] = tick, 1 / tick
    return gains


def asked(control_state, gains):
    """Acceleration (3,) that attitude and thrust setpoints ask of a level vehicle."""
    x, y, z, w = control_state["attitude"]
    axis = np.array([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])
    upwards = control_state["thrust"] / gains["mass"]
    return axis * upwards / axis[2] - [0, 0, GRAVITY]


def double_integrator(seconds, position, velocity=(0, 0, 0), push=(0, 0, 0), tick=1e-3, law=None):
    """Errors (K, 3) and integrals (K, 3) of p'' = a + push under the kernel's law."""
    gains = fine_gains(tick=tick) if law is None else law
    control_states, bodies = new_control_states(UP), new_bodies(np.array([position], float), UP)
    bodies["velocity_map"] = velocity
    errors, integrals = [], []
    for _ in range(round(seconds / tick)):
        errors.append(bodies["position_map"][0].copy())
        integrals.append(control_states["velocity_integral"][0].copy())
        _track(control_states, bodies, gains, 0.0, 0.0, 0.0)
        a = asked(control_states[0], gains[0]) + push
        bodies["position_map"] += tick * bodies["velocity_map"] + 0.5 * tick**2 * a
        bodies["velocity_map"] += tick * a
    return np.array(errors), np.array(integrals)


@pytest.mark.parametrize(("wn", "zeta", "ki", "epsilon"), [(1.7, 0.9, 0.4, 1.0), (1, 0.7, 2, 0.5)])
def test_gains_put_the_poles_where_the_formula_says(wn, zeta, ki, epsilon):
    gains = tracking_gains(wn, zeta, ki, epsilon)
    found = np.sort_complex(np.roots([1, gains.velocity, gains.position, gains.integral]))
    pair = wn / epsilon * (-zeta + 1j * np.sqrt(1 - zeta**2))
    wanted = np.sort_complex(np.array([pair, pair.conjugate(), -ki / epsilon]))
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_kernel_answers_as_its_poles(axis):
    """0.1 m beside the reference on p'' = a: within 1 % of the closed form at all times."""
    poles = {"wn": 0.9, "zeta": 0.8, "ki": 0.3, "epsilon": 0.5}
    data = F450.model_dump()
    data["control"] = {"horizontal": poles, "height": poles}
    law = fine_gains(Airframe.model_validate(data))
    position = np.zeros(3)
    position[axis] = 0.1
    errors, _ = double_integrator(8.0, position, law=law)
    wn, zeta, ki, e = poles.values()
    monic = np.polymul([e * e, 2 * zeta * wn * e, wn * wn], [e, ki]) / e**3
    system = np.array([[0, 1, 0], [0, 0, 1], -monic[:0:-1]])
    exact = [(expm(system * t) @ [0, 0.1, 0])[1] for t in np.arange(0, 8, 0.05)]
    np.testing.assert_allclose(errors[::50, axis], exact, atol=1e-3)
    assert np.abs(np.delete(errors, axis, axis=1)).max() < 1e-12


def test_a_steady_push_leaves_no_error():
    errors, integrals = double_integrator(30.0, (0, 0, 0), push=(1.5, -1.0, 0.8), tick=4e-3)
    assert np.abs(errors[-1]).max() < 1e-3
    np.testing.assert_allclose(integrals[-1], (-1.5, 1.0, -0.8), atol=1e-2)


def test_integrals_do_not_wind_up_in_saturation():
    """Thrown off at growing speed: a longer saturation leaves no larger swing to the other side."""
    swings = []
    for speed in (5.0, 10.0, 20.0, 30.0):
        errors, integrals = double_integrator(45.0, (0, 0, 0), (speed, 0, 0), tick=4e-3)
        swings.append(-errors[:, 0].min())
        assert errors[:, 0].max() > speed**2 / 40  # far beyond what one second could bring back
        bound = gains_of(F450, 1e-3)["integral_limit"][0]
        assert np.abs(integrals).max() <= bound
        assert abs(errors[-1, 0]) < 0.02
    assert max(swings) <= 1.01 * swings[0] < 0.3


def test_integral_stands_still_while_it_would_push_further():
    gains = fine_gains()
    control_states, bodies = new_control_states(UP), new_bodies(np.array([[0.5, 0, 0]]), UP)
    bodies["velocity_map"] = (20, 0, 0)  # brakes at the limit, away from the reference
    for _ in range(100):
        _track(control_states, bodies, gains, 0.0, 0.0, 0.0)
    assert control_states["velocity_integral"][0, 0] == 0.0
    bodies["position_map"] = (-0.5, 0, 0)  # now the error takes from the saturation
    _track(control_states, bodies, gains, 0.0, 0.0, 0.0)
    assert control_states["velocity_integral"][0, 0] > 0.0


def test_own_limits_of_the_integral_follow_the_drag():
    data = F450.model_dump()
    found = []
    for drag in (0.0, 1.75e-4, 3.5e-4, 1e-3):  # N s2/m, of each rotor
        data["rotors"]["drag_n_s2_m"] = drag
        found.append(gains_of(Airframe.model_validate(data), 1e-3)["integral_limit"][0])
    data["rotors"]["drag_n_s2_m"] = 3.5e-4
    wind = drag_acceleration(Airframe.model_validate(data), F450.limits.speed_m_s)
    assert 0.5 * GRAVITY < wind < 0.8 * GRAVITY
    wanted = [0.5 * GRAVITY, 0.5 * GRAVITY, wind, 0.8 * GRAVITY]
    np.testing.assert_allclose(found, wanted, rtol=1e-4)


@pytest.mark.parametrize("goal", [(0.3, 0, 0), (4, -3, 1), (60, 80, -30), (0, 0, 15), (-2, 0, 0)])
def test_the_reference_is_feasible_and_arrives(goal):
    gains = gains_of(F450, 1e-3)
    row, tick = gains[0], float(gains["tick"][0])
    control_states, bodies = new_control_states(UP), new_bodies(np.zeros((1, 3)), UP)
    control_states["position_target"] = goal
    if goal == (-2, 0, 0):
        control_states["velocity"] = (6, 3, 0)  # must turn back first
    seen = []
    for _ in range(round(40 / tick)):
        bodies["position_map"] = (
            control_states["position"] + tick * control_states["velocity"]
        )  # follows well
        _lead(control_states, bodies, gains)
        control_state = control_states[0]
        seen.append(
            [*control_state["position"], *control_state["velocity"], *control_state["acceleration"]]
        )
    position, velocity, acceleration = np.split(np.array(seen), 3, axis=1)
    np.testing.assert_allclose(position[-1], goal, atol=1e-3)
    assert np.hypot(*velocity[:, :2].T).max() < 1.02 * row["speed"]
    assert velocity[:, 2].max() < 1.02 * row["climb"]
    assert velocity[:, 2].min() > -1.02 * row["descent"]
    assert np.hypot(*acceleration[:, :2].T).max() < 1.0001 * row["acceleration"]
    assert np.abs(acceleration[:, 2]).max() < 1.0001 * row["climb_acceleration"]
    jerk = np.diff(acceleration, axis=0) / tick
    assert np.hypot(*jerk[:, :2].T).max() < 1.0001 * row["acceleration"] * row["ease"]
    step = position[:-1] + tick * velocity[:-1] + 0.5 * tick**2 * acceleration[:-1]
    np.testing.assert_allclose(position[1:], step, atol=1e-9)
    if goal != (-2, 0, 0):
        along = position @ np.array(goal, float) / np.linalg.norm(goal)
        assert along.max() < np.linalg.norm(goal) + 0.02


def test_a_reference_waits_for_a_uav_that_is_held_back():
    gains = gains_of(F450, 1e-3)
    control_states, bodies = new_control_states(UP), new_bodies(np.zeros((1, 3)), UP)
    control_states["position_target"] = (50, 0, 20)
    for _ in range(1000):
        _lead(control_states, bodies, gains)
    ahead = control_states["position"][0]
    assert np.hypot(*ahead[:2]) <= gains["level_leash"][0] + 1e-9
    assert ahead[2] <= gains["height_leash"][0] + 1e-9


def test_hover_in_wind_has_no_steady_error_and_survives_a_change():
    fleet = in_air()
    for wind in ((6.0, -2.0, 0.5), (-3.0, 4.0, 0.0)):
        fleet.set_weather(Weather(wind))
        fleet.advance(25_000, FLAT.grid)
        np.testing.assert_allclose(fleet.state.position_map[0], [0, 0, 50], atol=0.005)
