"""The compiled plant against the equations of motion, integrated by scipy with tight tolerances.

The right-hand side below is written from the published equations (rotor model of RotorS and
PX4, Newton-Euler), shares no code with the plant and is solved by DOP853 at 1e-11.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from volery.control.fleet import Fleet
from volery.scenario.schema import RotorWear
from volery.vehicle.airframe import Airframe, load_airframe
from volery.world.terrain import Terrain
from volery.world.weather import Weather

FAR_BELOW = Terrain.flat(1e5, -1e4, (-5e4, -5e4)).grid
RHO, G = 1.225, 9.80665


def rotation(q):
    x, y, z, w = q / np.linalg.norm(q)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * skew + 2 * skew @ skew


def ground_gain(radius, d, b, z, across, thrust):
    """Sanchez-Cuevas et al. 2017, reduced in forward flight, faded from 6 to 10 R."""
    far = 4 * z**2
    share = (radius / (4 * z)) ** 2 + radius**2 * z / (d**2 + far) ** 1.5
    share += radius**2 / 2 * z / (2 * d**2 + far) ** 1.5
    share += 2 * radius**2 * z * 2 / (b**2 + far) ** 1.5
    up = np.clip((z / radius - 6) / 4, 0, 1)
    induced = thrust / (2 * RHO * np.pi * radius**2)
    return 1 / (1 - share * (1 - up**2 * (3 - 2 * up)) / (1 + across / induced))


def right_hand_side(airframe, reference, wind, wear=None, ground=None):
    """wear: of each rotor. ground: height of level ground under a four-rotor frame, m."""
    rotors, inertia = airframe.rotors, np.array(airframe.body.inertia_kg_m2)
    wear = wear or [RotorWear()] * len(rotors.places)
    lag = np.array([w.lag for w in wear])
    area = np.array(airframe.body.drag_area_m2)

    def rhs(_t, y):
        v, q, omega, speeds = y[3:6], y[6:10], y[10:13], y[13:]
        turn = rotation(q)
        air = turn.T @ (v - wind)
        force = -0.5 * RHO * area * np.linalg.norm(air) * air
        torque = np.zeros(3)
        for rotor, w, old in zip(rotors.places, speeds, wear, strict=True):
            axis, arm = np.array(rotor.axis), np.array(rotor.position_m)
            sense = {"ccw": 1.0, "cw": -1.0}[rotor.direction]
            hub = air + np.cross(omega, arm)
            along = hub @ axis
            across = hub - along * axis
            thrust = old.thrust * rotors.thrust_n_s2 * w**2
            if ground is not None:
                z = y[2] + (turn @ arm)[2] - ground
                spacing = 2 * abs(arm[0]), 2 * abs(arm[0]) * np.sqrt(2)
                across_ground = (v - wind)[0] ** 2 + (v - wind)[1] ** 2
                thrust *= ground_gain(rotors.radius_m, *spacing, z, across_ground, thrust)
            thrust *= np.clip(1 - abs(along) / 25, 0, 1)
            pull = thrust * axis - w * rotors.drag_n_s2_m * across
            force = force + pull
            torque = torque + np.cross(arm, pull)
            torque = torque - sense * thrust * rotors.torque_m * old.torque * axis
            torque = torque - w * sense * rotors.rolling_n_s2 * across
        alpha = (torque - np.cross(omega, inertia * omega)) / inertia
        x, yy, z, w = q
        spin = 0.5 * np.array(
            [
                [w, -z, yy],
                [z, w, -x],
                [-yy, x, w],
                [-x, -yy, -z],
            ]
        )
        tau = lag * np.where(reference > speeds, rotors.rise_time_s, rotors.fall_time_s)
        acceleration = turn @ force / airframe.body.mass_kg - np.array([0, 0, G])
        return np.concatenate([v, acceleration, spin @ omega, alpha, (reference - speeds) / tau])

    return rhs


def solve(airframe, start, reference, wind, seconds, **terms):
    rhs = right_hand_side(airframe, reference, wind, **terms)
    result = solve_ivp(rhs, (0, seconds), start, method="DOP853", rtol=1e-11, atol=1e-11)
    y = result.y[:, -1]
    y[6:10] /= np.linalg.norm(y[6:10])
    return y


def fly(airframe, start, reference, wind, seconds, dt_ns=1_000_000, wear=(), ground=None):
    start_pose = start[None, :3], start[None, 6:10]
    fleet = Fleet([airframe], *start_pose, dt_ns=dt_ns, wear=[wear], weather=Weather(wind))
    grid = FAR_BELOW if ground is None else Terrain.flat(1e5, ground, (-5e4, -5e4)).grid
    fleet.command_rotor_speeds(0, reference)
    state, count = fleet.state, len(reference)
    state.velocity_map[0] = start[3:6]
    state.omega_body[0] = start[10:13]
    state.rotor_speed[0, :count] = start[13:]
    steps = round(seconds * 1e9 / dt_ns)
    assert fleet.advance(steps, grid) == steps
    return np.concatenate(
        [
            state.position_map[0],
            state.velocity_map[0],
            state.attitude[0],
            state.omega_body[0],
            state.rotor_speed[0, :count],
        ]
    )


def attitude_error(a, b):
    return 2 * np.arccos(min(1.0, abs(a @ b)))


def tilted_hexarotor() -> Airframe:
    data = load_airframe("f450").model_dump()
    data["name"] = "tilted"
    data["body"]["collision_radius_m"] = 0.6
    data["rotors"]["places"] = [
        {
            "position_m": [0.3 * np.cos(a), 0.3 * np.sin(a), 0.05],
            "direction": "ccw" if k % 2 else "cw",
            "axis": [0.05 * np.cos(a) + 0.02, 0.05 * np.sin(a), 1.0],
        }
        for k, a in enumerate(np.arange(6) * np.pi / 3)
    ]
    return Airframe.model_validate(data)


def state_of(airframe, velocity=(0, 0, 0), omega=(0, 0, 0), speeds=0.0, q=(0.1, -0.2, 0.3, 0.9)):
    q = np.array(q) / np.linalg.norm(q)
    speeds = np.broadcast_to(np.asarray(speeds, dtype=float), (len(airframe.rotors.places),))
    return np.concatenate([[1, 2, 3], velocity, q, omega, speeds])


F450 = load_airframe("f450")
CASES = {
    "free rotation": (F450, state_of(F450, omega=(8, -3, 5)), np.zeros(4), (0, 0, 0)),
    "asymmetric thrust": (
        F450,
        state_of(F450, omega=(0.5, 1, -2), speeds=700),
        np.array([800.0, 740, 790, 730]),
        (0, 0, 0),
    ),
    "drag and wind": (
        F450,
        state_of(F450, velocity=(12, -7, 3), omega=(1, -1, 2), speeds=770),
        np.full(4, 770.0),
        (-6, 5, 1),
    ),
    "rotors starting and stopping": (
        F450,
        state_of(F450, velocity=(2, 0, 0), speeds=(0, 900, 300, 1000)),
        np.array([780.0, 760, 770, 775]),
        (3, 0, 0),
    ),
    "six tilted rotors": (
        tilted_hexarotor(),
        state_of(tilted_hexarotor(), velocity=(5, 5, -5), omega=(0, 1, 0), speeds=600),
        np.array([650.0, 630, 640, 655, 645, 635]),
        (1, -2, 0.5),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_agrees_with_the_equations(name):
    """At 1 kHz, after 1 s: 1 mm, 2 mm/s, 1 mrad, 4 mrad/s."""
    airframe, start, reference, wind = CASES[name]
    wanted = solve(airframe, start, reference, np.array(wind, float), 1.0)
    got = fly(airframe, start, reference, wind, 1.0)
    assert np.linalg.norm(got[:3] - wanted[:3]) < 1e-3
    assert np.linalg.norm(got[3:6] - wanted[3:6]) < 2e-3
    assert attitude_error(got[6:10], wanted[6:10]) < 1e-3
    assert np.linalg.norm(got[10:13] - wanted[10:13]) < 4e-3
    np.testing.assert_allclose(got[13:], wanted[13:], atol=1e-6)


@pytest.mark.parametrize("name", ["free rotation", "drag and wind", "six tilted rotors"])
def test_second_order_in_the_step(name):
    airframe, start, reference, wind = CASES[name]
    wanted = solve(airframe, start, reference, np.array(wind, float), 0.8)
    errors = []
    for dt_ns in (4_000_000, 2_000_000, 1_000_000, 500_000):
        got = fly(airframe, start, reference, wind, 0.8, dt_ns)
        errors.append(
            np.linalg.norm(got[:6] - wanted[:6]) + attitude_error(got[6:10], wanted[6:10])
        )
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders.min() > 1.7, (errors, orders)


def test_free_rotation_keeps_momentum_and_energy():
    """Without air torque (rotors stopped, no velocity) both are constant."""
    data = F450.model_dump()
    data["body"]["drag_area_m2"] = (0, 0, 0)
    airframe = Airframe.model_validate(data)
    inertia = np.array(airframe.body.inertia_kg_m2)
    start = state_of(airframe, omega=(6, -4, 9))

    def momentum_and_energy(y):
        return rotation(y[6:10]) @ (inertia * y[10:13]), 0.5 * y[10:13] @ (inertia * y[10:13])

    before = momentum_and_energy(start)
    after = momentum_and_energy(fly(airframe, start, np.zeros(4), (0, 0, 0), 5.0))
    np.testing.assert_allclose(after[0], before[0], rtol=0, atol=2e-3 * np.linalg.norm(before[0]))
    assert after[1] == pytest.approx(before[1], rel=1e-3)


def test_free_fall_is_exact():
    data = F450.model_dump()
    data["body"]["drag_area_m2"] = (0, 0, 0)
    airframe = Airframe.model_validate(data)
    got = fly(airframe, state_of(airframe, velocity=(1, 2, 3)), np.zeros(4), (0, 0, 0), 2.0)
    np.testing.assert_allclose(got[3:6], [1, 2, 3 - 2 * G], atol=1e-10)
    np.testing.assert_allclose(got[:3], [3, 6, 3 + 6 - 2 * G], atol=1e-9)


def test_rotor_lag_is_exact():
    start = state_of(F450, speeds=(0, 1000, 500, 700))
    reference = np.array([800.0, 200, 500, 701])
    for milliseconds in (1, 7, 40):
        got = fly(F450, start, reference, (0, 0, 0), milliseconds * 1e-3)
        tau = np.where(reference > start[13:], 0.0125, 0.025)
        wanted = reference + (start[13:] - reference) * np.exp(-milliseconds * 1e-3 / tau)
        np.testing.assert_allclose(got[13:], wanted, rtol=1e-12)


def test_hover_trim():
    """Each rotor carries a quarter of the weight: w = sqrt(m g / 4 kF), as of the data file."""
    fleet = Fleet([F450], [[0, 0, 0]], [[0, 0, 0, 1]])
    wanted = np.sqrt(2.065 * G / (4 * 8.54858e-6))
    np.testing.assert_allclose(fleet.state.rotor_speed[0, :4], wanted, rtol=1e-12)
    fleet.advance(5000, FAR_BELOW)
    np.testing.assert_allclose(fleet.state.rotor_speed[0, :4], wanted, rtol=1e-9)
    np.testing.assert_allclose(fleet.state.position_map[0], 0.0, atol=1e-9)
    assert not fleet.state.rotor_speed[0, 4:].any()


WORN = [
    RotorWear(thrust=0.9, torque=1.3),
    RotorWear(lag=2.0),
    RotorWear(thrust=0.97, lag=1.5, torque=0.8),
    RotorWear(),
]


@pytest.mark.parametrize("terms", [{"wear": WORN}, {"ground": 2.45}, {"wear": WORN, "ground": 2.5}])
def test_wear_and_ground_agree_with_the_equations(terms):
    """Over the ground it climbs from 0.6 m through the whole fade of the effect."""
    start = state_of(
        F450, velocity=(1.5, -1, 0.8), omega=(0.1, 0.2, 0.3), speeds=760, q=(0, 0, 0.2, 1)
    )
    reference = np.array([775.0, 772, 774, 771])
    wanted = solve(F450, start, reference, np.array([0.5, 0, 0]), 0.6, **terms)
    got = fly(F450, start, reference, (0.5, 0, 0), 0.6, **terms)
    plain = fly(F450, start, reference, (0.5, 0, 0), 0.6)
    assert np.linalg.norm(plain[:6] - got[:6]) > 0.02  # the terms matter
    assert np.linalg.norm(got[:3] - wanted[:3]) < 5e-4
    assert np.linalg.norm(got[3:6] - wanted[3:6]) < 1e-3
    assert attitude_error(got[6:10], wanted[6:10]) < 5e-4
    assert np.linalg.norm(got[10:13] - wanted[10:13]) < 4e-3
    np.testing.assert_allclose(got[13:], wanted[13:], atol=1e-6)
