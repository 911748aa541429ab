"""The quick sum over upright rotors against the general one, and wear."""

import numpy as np
import pytest
from flown_plants import F450, body, coaxial_octo, plant, ring

from volery.control.fleet import Fleet
from volery.core.errors import CommandError
from volery.scenario.schema import RotorWear
from volery.vehicle.aerodynamics import leaning_rotors, upright_rotors
from volery.vehicle.airframe import MAX_ROTORS
from volery.vehicle.compiled import fused_kernel
from volery.world.terrain import Terrain

COMMAND = np.dtype([("rotor_reference", "f8", MAX_ROTORS)])
FAR_BELOW = Terrain.flat(1e5, -1e4, (-5e4, -5e4)).grid


@fused_kernel
def _both(quick, general, plants, commands, v):
    a = upright_rotors(quick[0], plants[0], commands[0], v[0], v[1], v[2], v[3], v[4], v[5])
    b = leaning_rotors(general[0], plants[0], commands[0], v[0], v[1], v[2], v[3], v[4], v[5])
    return a, b


@pytest.mark.parametrize("airframe", [F450, ring(6), ring(12)], ids=["four", "six", "twelve"])
def test_the_quick_sum_equals_the_general_one(airframe):
    rng = np.random.default_rng(5)
    count = len(airframe.rotors.places)
    wear = [RotorWear(torque=1.0 + 0.1 * k, lag=1.0 + 0.05 * k) for k in range(count)]
    plants = plant(airframe, wear=wear)
    assert plants["upright"][0]
    for _ in range(200):
        bodies, commands = body(plants), np.zeros(1, COMMAND)
        bodies["rotor_speed"][0, :count] = rng.uniform(0, 1100, count)
        commands["rotor_reference"][0, :count] = rng.uniform(0, 1100, count)
        other = bodies.copy()
        motion = np.concatenate([rng.normal(0, 10, 3), rng.normal(0, 5, 3)])
        quick, general = _both(bodies, other, plants, commands, motion)
        scale = np.abs(general).max()
        np.testing.assert_allclose(quick, general, rtol=0, atol=1e-12 * scale)
        assert bodies.tobytes() == other.tobytes()


def test_other_frames_take_the_general_sum():
    assert not plant(coaxial_octo())["upright"][0]
    assert not plant(ring(6, lean=0.1))["upright"][0]


def in_air(airframe=F450, **options):
    return Fleet([airframe], [[0, 0, 100]], [[0, 0, 0, 1]], **options)


def test_a_worn_rotor_pulls_less():
    new, worn = in_air(), in_air(wear=[[RotorWear(thrust=0.5)] * 4])
    for fleet in (new, worn):
        fleet.command_rotor_speeds(0, [770] * 4)
        fleet.advance(1, FAR_BELOW)
    pull = 9.80665 + np.array([f.state.acceleration_map[0, 2] for f in (new, worn)])
    assert pull[1] == pytest.approx(0.5 * pull[0], rel=1e-3)
    np.testing.assert_array_equal(worn.state.rotor_health[0, :5], [0.5] * 4 + [0])


def test_a_slow_motor_lags():
    fleet = in_air(wear=[[RotorWear(lag=3.0), *[RotorWear()] * 3]])
    fleet.state.rotor_speed[0, :4] = 0.0
    fleet.command_rotor_speeds(0, [800] * 4)
    fleet.advance(20, FAR_BELOW)
    wanted = 800 * (1 - np.exp(-0.02 / np.array([0.0375, 0.0125, 0.0125, 0.0125])))
    np.testing.assert_allclose(fleet.state.rotor_speed[0, :4], wanted, rtol=1e-12)


def test_a_stiff_rotor_turns_the_body():
    fleet = in_air(wear=[[RotorWear(torque=1.5), *[RotorWear()] * 3]])
    fleet.command_rotor_speeds(0, [700] * 4)
    fleet.state.rotor_speed[0, :4] = 700.0
    fleet.advance(1, FAR_BELOW)
    pull = F450.rotors.thrust_n_s2 * 700**2
    wanted = -0.5 * F450.rotors.torque_m * pull / F450.body.inertia_kg_m2[2]
    assert fleet.state.angular_acceleration_body[0, 2] == pytest.approx(wanted, rel=1e-3)


def test_a_lost_motor_stops_and_a_new_one_starts():
    fleet = in_air()
    fleet.command_rotor_speeds(0, [770] * 4)
    fleet.set_rotor_health(0, 2, 0.0)
    fleet.advance(300, FAR_BELOW)
    speeds = fleet.state.rotor_speed[0]
    assert speeds[2] == pytest.approx(770 * np.exp(-0.3 / 0.025), rel=1e-3)
    np.testing.assert_allclose(speeds[[0, 1, 3]], 770, rtol=1e-6)
    fleet.set_rotor_health(0, 2, 1.0)
    fleet.advance(300, FAR_BELOW)
    assert speeds[2] == pytest.approx(770, rel=1e-6)


@pytest.mark.parametrize("factor", [-0.1, 1.1, np.nan])
def test_impossible_health_is_refused(factor):
    fleet = in_air()
    with pytest.raises(CommandError, match="rotor health"):
        fleet.set_rotor_health(0, 0, factor)
    with pytest.raises(CommandError, match="no rotor 4"):
        fleet.set_rotor_health(0, 4, 0.5)
    with pytest.raises(CommandError, match="no UAV 1"):
        fleet.set_rotor_health(1, 0, 0.5)
    with pytest.raises(CommandError, match="names 3 rotors"):
        in_air(wear=[[RotorWear()] * 3])


def fly_on_without(airframe, rotor, seconds=12.0):
    """Lowest height and largest distance while one rotor is lost in hover at 100 m."""
    fleet = in_air(airframe)
    fleet.advance(1000, FAR_BELOW)
    fleet.set_rotor_health(0, rotor, 0.0)
    track = []
    for _ in range(round(seconds * 100)):
        fleet.advance(10, FAR_BELOW)
        track.append(fleet.state.position_map[0].copy())
    track = np.array(track)
    return track[:, 2].min(), np.linalg.norm(track[:, :2], axis=1).max()


def test_a_hexarotor_flies_on_without_a_rotor_and_a_quadrotor_does_not():
    """Allocation stays nominal; the integrals of the rate loop find the new trim."""
    low, far = fly_on_without(ring(6), 1)
    assert low > 98.5, (low, far)
    assert far < 3.5, (low, far)
    low, _ = fly_on_without(F450, 1)
    assert low < 50.0
