"""Ground effect: published numbers, smoothness, forward flight, and the flight near the ground."""

import numpy as np
import pytest
from flown_plants import F450, LEVEL, plant, ring

from volery.control.fleet import Fleet
from volery.vehicle.compiled import fused_kernel
from volery.vehicle.ground_effect import ground_fraction
from volery.world.terrain import Terrain

FLAT = Terrain.flat(4000.0, 0.0, (-2000.0, -2000.0))
R = F450.rotors.radius_m


@fused_kernel
def _shares(plants, heights, out):
    for k in range(len(heights)):
        out[k] = ground_fraction(plants[0], heights[k])


def factor(plants, heights):
    out = np.zeros(len(heights))
    _shares(plants, np.asarray(heights, dtype=float), out)
    return 1.0 / (1.0 - out)


def test_published_numbers_at_one_radius():
    """R = 0.12, d = 0.318, b = 0.45: Cheeseman-Bennett 1.067, Sanchez-Cuevas 1.174."""
    assert factor(plant(ring(6)), [R])[0] == pytest.approx(1.067, abs=5e-4)
    assert factor(plant(F450), [R])[0] == pytest.approx(1.174, abs=1e-3)


def test_quad_form_term_by_term():
    d, b = 2 * 0.159, 2 * 0.159 * np.sqrt(2)
    for z in (0.07, 0.2, 0.5, 0.7):
        fraction = (
            (R / (4 * z)) ** 2
            + R**2 * z / (d**2 + 4 * z**2) ** 1.5
            + R**2 / 2 * z / (2 * d**2 + 4 * z**2) ** 1.5
            + 2 * R**2 * z * 2.0 / (b**2 + 4 * z**2) ** 1.5
        )
        assert factor(plant(F450), [z])[0] == pytest.approx(1 / (1 - fraction), rel=1e-12)


def test_fades_out_smoothly_and_never_grows_with_height():
    heights = np.linspace(0.0, 12 * R, 4001)
    for airframe in (F450, ring(6), ring(8)):
        gain = factor(plant(airframe), heights)
        assert (np.diff(gain) <= 1e-15).all()
        assert (gain[heights >= 10 * R] == 1.0).all()
        slope = np.diff(gain)[heights[1:] > 4 * R]  # with both ends of the fade
        assert np.abs(np.diff(slope)).max() < 0.01 * np.abs(slope).max()


def hovering(height, speed=0.0, airframe=F450):
    """Thrust over that of the free air, at once, of a UAV at hover speed."""
    z = height - airframe.rotors.places[0].position_m[2]
    fleet = Fleet([airframe], [[0, 0, z]], [LEVEL])
    fleet.command_rotor_speeds(0, fleet.state.rotor_speed[0, :4].copy())
    fleet.state.velocity_map[0, 0] = speed
    fleet.advance(1, FLAT.grid)
    return (fleet.state.acceleration_map[0, 2] + 9.80665) / 9.80665


def test_a_hovering_uav_feels_it_and_a_fast_one_less():
    wanted = factor(plant(F450), [0.25])[0]
    assert hovering(0.25) == pytest.approx(wanted, abs=1e-4)
    assert hovering(2.0) == pytest.approx(1.0, abs=1e-6)
    induced = 2.065 * 9.80665 / 4 / (2 * 1.225 * np.pi * R**2)
    fraction = (1 - 1 / wanted) / (1 + 5.0**2 / induced)
    assert hovering(0.25, 5.0) == pytest.approx(1 / (1 - fraction), abs=2e-4)


def flights(slices):
    """A fleet that dives to the ground and climbs again, cut into slices."""
    fleet = Fleet([F450, ring(6)], [[0, 0, 3.0], [9, 0, 3.0]], [LEVEL] * 2)
    for i, low in enumerate((0.25, 0.3)):
        fleet.command_position(i, [9.0 * i + 4.0, 1.0, low])
    done = 0
    for k, steps in enumerate(slices):
        fleet.advance(steps, FLAT.grid)
        done += steps
        if k == len(slices) // 2:
            assert (fleet.state.position_map[:, 2] < 0.6).all()
    return fleet.get_state()["uavs"].tobytes()


def test_slicing_changes_nothing():
    assert flights([6000]) == flights([7] * 857 + [1])


def test_hovers_low_with_less_thrust():
    """It holds 0.25 m under its rotors on rotors that turn as much slower as the formula says."""
    fleet = Fleet([F450], [[0, 0, 0.15]], [LEVEL])
    fleet.advance(8000, FLAT.grid)
    height = fleet.state.position_map[0, 2] + 0.11
    wanted = 769.56 / np.sqrt(factor(plant(F450), [height])[0])
    assert height == pytest.approx(0.26, abs=0.01)
    np.testing.assert_allclose(fleet.state.rotor_speed[0, :4], wanted, rtol=1e-3)


def test_the_effect_ends_with_the_ground():
    """Over a cliff the free thrust is back exactly."""
    ground = np.zeros((21, 21))
    ground[:, 13:] = -50.0
    terrain = Terrain.from_heights(ground, 5.0, (-50.0, -50.0))
    fleet = Fleet([F450], [[0, 0, 0.4]], [LEVEL])
    lift = fleet.get_state()["uavs"]["body"]["rotor_lift"][0, 0]
    fleet.advance(1, terrain.grid)
    assert fleet.get_state()["uavs"]["body"]["rotor_lift"][0, 0] > 1.01 * lift
    fleet.command_position(0, [20, 0, 0.4])
    fleet.advance(9000, terrain.grid)
    assert fleet.state.position_map[0, 0] > 19
    assert fleet.get_state()["uavs"]["body"]["rotor_lift"][0, 0] == lift
