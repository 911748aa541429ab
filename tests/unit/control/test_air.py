"""UAVs in moving air: how they lean and drift, and when a change of weather reaches them."""

import numpy as np
import pytest
from flights import F450, FLAT, LEVEL, in_air, track
from scipy.optimize import fsolve

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.errors import CommandError
from volery.world.weather import Gust, LogProfile, Particles, Weather, WindField

G, RHO = 9.80665, 1.225
MASS = F450.body.mass_kg
LOSS = F450.rotors.drag_n_s2_m
LIFT = F450.rotors.thrust_n_s2
AREA = np.array(F450.body.drag_area_m2)


def wrench(pitch, front, back, wind):
    """Force (map) and torque (body) of the air on an F450 at rest, written anew from the formulas.

    pitch: rad about y. front, back: rad/s of the rotors there. wind: m/s along x.
    """
    turn = rotations.matrix(rotations.from_rpy(0.0, pitch, 0.0))
    v = turn.T @ [-wind, 0.0, 0.0]
    force, torque = -0.5 * RHO * AREA * np.linalg.norm(v) * v, np.zeros(3)
    for rotor in F450.rotors.places:
        speed = front if rotor.position_m[0] > 0 else back
        thrust = LIFT * speed**2 * (1 - abs(v[2]) / 25.0)
        pull = np.array([0.0, 0.0, thrust]) - LOSS * speed * v * [1, 1, 0]
        force = force + pull
        torque = torque + np.cross(rotor.position_m, pull)
    return turn @ force, torque


@pytest.mark.parametrize("wind", [2.0, -3.0, 4.0])
def test_a_holding_f450_leans_into_the_wind_as_the_drag_formula_says(wind):
    fleet = in_air()
    _, velocity, tilt = track(fleet, 15.0, wind=(wind, 0.0, 0.0))

    def balance(unknown):
        force, torque = wrench(*unknown, wind)
        return force[0], force[2] - MASS * G, torque[1]

    pitch, front, back = fsolve(balance, [-0.1 * np.sign(wind), 770.0, 770.0])
    assert np.abs(velocity[-1]).max() < 0.01
    assert tilt[-1] == pytest.approx(abs(pitch), rel=1e-3)
    upward = rotations.matrix(fleet.state.attitude[0])[:, 2]
    assert np.sign(upward[0]) == -np.sign(wind)
    speeds = [front if p.position_m[0] > 0 else back for p in F450.rotors.places]
    np.testing.assert_allclose(fleet.state.rotor_speed[0, :4], speeds, rtol=2e-3)


def test_a_level_f450_drifts_as_the_drag_formula_says():
    """Pushed at first by (4 w c_d + rho A u / 2) u, u the wind; in the end it goes with the air."""
    fleet = in_air((0.0, 0.0, 1000.0), weather=Weather((3.0, 0.0, 0.0)))
    fleet.command_attitude(0, LEVEL, MASS * G)
    fleet.advance(1, FLAT.grid)
    force = (4 * np.sqrt(MASS * G / (4 * LIFT)) * LOSS + 0.5 * RHO * AREA[0] * 3.0) * 3.0
    assert fleet.state.acceleration_map[0, 0] == pytest.approx(force / MASS, rel=1e-6)
    track(fleet, 30.0)
    assert fleet.state.velocity_map[0, 0] == pytest.approx(3.0, rel=2e-3)


def test_weather_reaches_the_uavs_at_the_next_guidance_tick():
    fleet = in_air(weather=Weather((1.0, 0.0, 0.0)))
    air = fleet.state.air_velocity_map
    fleet.advance(3, FLAT.grid)
    assert air[0].tolist() == [1, 0, 0]
    fleet.set_weather(Weather((0.0, 2.0, 0.0)))
    fleet.advance(5, FLAT.grid)  # steps 3 to 7
    assert air[0].tolist() == [1, 0, 0]
    fleet.advance(1, FLAT.grid)
    assert air[0].tolist() == [0, 2, 0]


def test_each_uav_has_its_own_air():
    nodes = np.zeros((1, 1, 2, 3))
    nodes[0, 0, 1] = (0, 8, 0)
    field = WindField(nodes, (0, 0, 0), (40, 1, 1))
    fleet = Fleet(
        [F450] * 3, [[x, 0, 50] for x in (0, 10, 90)], [LEVEL] * 3, weather=Weather(field=field)
    )
    fleet.advance(1, FLAT.grid)
    np.testing.assert_allclose(fleet.state.air_velocity_map, [[0, 0, 0], [0, 2, 0], [0, 8, 0]])
    fleet.set_weather(Weather((4, 0, 0), LogProfile(10.0, 0.1)))
    fleet.advance(8, FLAT.grid)
    share = np.log(50 / 0.1) / np.log(10 / 0.1)
    np.testing.assert_allclose(fleet.state.air_velocity_map[:, 0], 4 * share, rtol=1e-3)


def test_a_gust_pushes_and_passes():
    fleet = in_air()
    fleet.advance(1000, FLAT.grid)
    fleet.add_gust(Gust((5.0, 0.0, 0.0), 1.0, 0.4, 2.5))
    position, _, tilt = track(fleet, 12.0)
    assert 0.1 < position[:, 0].max() < 3.0
    assert tilt.max() > 0.1
    np.testing.assert_allclose(position[-1], [0, 0, 50], atol=0.05)
    assert not fleet.state.air_velocity_map.any()
    assert fleet.weather.gusts[0].end_s == 2.5


def test_a_snapshot_holds_the_weather():
    """The turbulence, its position in the stream, and a gust that was added, all come back."""
    fleet = Fleet(
        [F450] * 2, [[0, 0, 20], [5, 0, 20]], [LEVEL] * 2, weather=Weather((4, 0, 0), w20_m_s=12.0)
    )
    fleet.advance(301, FLAT.grid)
    fleet.add_gust(Gust((0.0, 3.0, 0.0), 0.4, 0.3, 1.2))
    kept, weather = fleet.get_state(), fleet.weather
    fleet.advance(700, FLAT.grid)
    wanted = fleet.get_state()["uavs"].tobytes()
    fleet.set_weather(Weather((-9.0, 0.0, 0.0)))
    fleet.advance(100, FLAT.grid)
    fleet.set_state(kept)
    assert fleet.weather is weather
    fleet.advance(700, FLAT.grid)
    assert fleet.get_state()["uavs"].tobytes() == wanted


def test_turbulence_differs_by_uav_and_seed_and_shakes():
    def flown(seed):
        fleet = Fleet(
            [F450] * 2,
            [[0, 0, 20], [5, 0, 20]],
            [LEVEL] * 2,
            weather=Weather((4, 0, 0), w20_m_s=15.0),
            seed=seed,
        )
        fleet.advance(3000, FLAT.grid)
        return fleet.state.air_velocity_map.copy(), fleet.state.position_map.copy()

    (air, position), (other, _) = flown(1), flown(2)
    assert np.abs(air[0] - air[1]).min() > 1e-3
    assert np.abs(air - other).min() > 1e-3
    assert np.abs(position - [[0, 0, 20], [5, 0, 20]]).max() > 0.05


def test_too_many_gusts_are_refused_and_leave_the_weather_alone():
    fleet = in_air(weather=Weather(gusts=(Gust((1, 0, 0), 0, 1),) * 64))
    with pytest.raises(CommandError, match="at most 64"):
        fleet.add_gust(Gust((1, 0, 0), 0, 1))
    assert len(fleet.weather.gusts) == 64


def test_rain_pushes_down_with_the_momentum_that_its_drops_lose():
    """A holding F450 carries rate x speed x area besides its weight."""
    thrust = {}
    for rate in (0.0, 200.0):
        fleet = in_air(weather=Weather(particles=Particles(rain_mm_h=rate)))
        fleet.advance(12_000, FLAT.grid)
        squares = []
        for _ in range(64):
            fleet.advance(1, FLAT.grid)
            squares.append((fleet.state.rotor_speed[0, :4] ** 2).sum())
        thrust[rate] = LIFT * np.mean(squares)
        assert np.abs(fleet.state.velocity_map[0]).max() < 1e-3
    speed = 9.65 - 10.3 * np.exp(-0.6 * 4.0 / (4.1 * 200.0**-0.21))
    assert thrust[0.0] == pytest.approx(MASS * G, rel=1e-6)
    assert thrust[200.0] - thrust[0.0] == pytest.approx(200.0 / 3600.0 * speed * AREA[2], rel=0.02)
