"""Downwash: the jet's momentum, which UAVs it pushes, and the search for neighbours."""

import numpy as np
import pytest
from flown_plants import F450, LEVEL
from scipy.integrate import quad

from volery.control.fleet import Fleet
from volery.vehicle.airframe import load_airframe
from volery.vehicle.compiled import fused_kernel
from volery.vehicle.downwash import jet_speed
from volery.world.terrain import Terrain

FLAT = Terrain.flat(4000.0, 0.0, (-2000.0, -2000.0)).grid
RHO = 1.225
CRAZYFLIE = load_airframe("crazyflie")


@fused_kernel
def _speeds(thrust, radius, r, s, out):
    for k in range(len(out)):
        out[k] = jet_speed(thrust, radius, r[k], s[k])


def jet(thrust, radius, r, s):
    r, s = np.broadcast_arrays(np.asarray(r, float), np.asarray(s, float))
    out = np.zeros(r.shape)
    _speeds(thrust, radius, r, s, out)
    return out


@pytest.mark.parametrize("depth", [4.0, 20.0, 60.0])
def test_the_far_jet_carries_the_thrust(depth):
    """rho times the integral of w^2 over a section; 2.5 b hold all but a per cent of it."""
    thrust, radius = 20.0, 0.24

    def flux(r):
        return RHO * jet(thrust, radius, [r], [depth * radius])[0] ** 2 * 2 * np.pi * r

    edge = 2.5 * (radius + 0.1 * depth * radius)
    near = (1 + depth / np.hypot(1, depth)) / 2  # what momentum theory's inflow has not yet become
    assert quad(flux, 0, edge)[0] == pytest.approx(thrust * near**2, rel=0.01)


def test_speeds_of_momentum_theory():
    thrust, radius = 20.0, 0.24
    induced = np.sqrt(thrust / (2 * RHO * np.pi * radius**2))
    assert jet(thrust, radius, [0], [1e-6])[0] == pytest.approx(induced, rel=3e-3)
    assert jet(thrust, radius, [0], [0.5])[0] == pytest.approx(
        induced * (1 + 0.5 / np.hypot(0.5, 0.24)) * 0.24 / (0.24 + 0.05), rel=3e-3
    )
    assert (jet(thrust, radius, [0, 0, 0.7, 5], [-0.1, 24.1, 0.1, 1]) == 0.0).all()


def test_the_jet_ends_smoothly():
    s = np.linspace(0.01, 25.0, 5001)
    assert np.abs(np.diff(jet(20.0, 0.24, np.zeros_like(s), s), 2)).max() < 5e-3
    r = np.linspace(0.0, 3.0, 3001)
    assert np.abs(np.diff(jet(20.0, 0.24, r, np.full_like(r, 3.0)))).max() < 0.05


def pair(offset, airframe=F450, copies=0):
    """Air velocity at two UAVs, the second `offset` from the first, after one step."""
    positions = np.array([[0, 0, 50.0], np.array([0, 0, 50.0]) + offset])
    fleet = Fleet([airframe] * 2, positions, [LEVEL] * 2, copies=copies)
    fleet.advance(1, FLAT)
    return fleet.state.air_velocity_map


def test_above_pushes_below_and_no_uav_beside():
    air = pair([0.1, 0, -2.0])
    assert air[0, 2] == 0.0
    thrust = 2.065 * 9.80665
    assert air[1, 2] == pytest.approx(-jet(thrust, 0.24, [0.1], [2.0])[0], rel=1e-9)
    assert not air[:, :2].any()
    assert not pair([0.75, 0, 0.0]).any()
    assert not pair([1.5, 0, -1.0]).any()
    assert not pair([0.0, 0, -2.0], copies=[0, 1]).any()


def test_stacked_crazyflies():
    """About 9 g at the distances at which Neural-Swarm (Shi et al. 2020) flies them."""
    fleet = Fleet([CRAZYFLIE] * 2, [[0, 0, 2.0], [0, 0, 1.7]], [LEVEL] * 2)
    trim = fleet.state.rotor_speed[0, :4].copy()
    for i in (0, 1):
        fleet.command_rotor_speeds(i, trim)
    fleet.advance(1, FLAT)
    grams = -fleet.state.acceleration_map[1, 2] * 27.0 / 9.80665
    assert 5.0 < grams < 14.0, grams
    assert fleet.state.acceleration_map[0, 2] == pytest.approx(0.0, abs=1e-9)


def test_the_lower_one_holds_against_it():
    fleet = Fleet([F450] * 2, [[0, 0, 52.0], [0, 0, 50.0]], [LEVEL] * 2)
    low = []
    for _ in range(800):
        fleet.advance(10, FLAT)
        low.append(fleet.state.position_map[1, 2])
    assert min(low) < 49.9  # pushed down at first
    assert low[-1] == pytest.approx(50.0, abs=0.05)  # the integral takes it over
    assert fleet.state.rotor_speed[1, 0] > 1.05 * fleet.state.rotor_speed[0, 0]


def brute_force(fleet):
    """Downwash of all pairs, a second implementation."""
    positions, count = fleet.state.position_map, len(fleet)
    total = np.zeros(count)
    for j in range(count):
        frame = fleet.airframes[j]
        radius = np.sqrt(len(frame.rotors.places)) * frame.rotors.radius_m
        lift = fleet.get_state()["uavs"]["body"]["rotor_lift"][j]
        thrust = (lift * fleet.state.rotor_speed[j] ** 2).sum()
        r = np.hypot(*(positions[:, :2] - positions[j, :2]).T)
        s = positions[j, 2] - positions[:, 2]
        inside = (s > 0) & (s < 100 * radius) & (r < 2.5 * (radius + 0.1 * s))
        v = np.sqrt(thrust / (2 * RHO * np.pi * radius**2))
        b = radius + 0.1 * s
        w = (
            v
            * (1 + s / np.hypot(s, radius))
            * radius
            / b
            * (np.exp(-((r / b) ** 2)) - np.exp(-6.25))
        )
        end = np.clip((s / (100 * radius) - 2 / 3) * 3, 0, 1)
        total += np.where(inside, w * (1 - end**2 * (3 - 2 * end)), 0.0)
    return total


def crowd(order):
    """Sixty UAVs of two kinds that cross over and under each other."""
    rng = np.random.default_rng(8)
    count = 60
    positions = np.column_stack([rng.uniform(0, 25, (count, 2)), rng.uniform(40, 60, count)])
    goal = np.column_stack([rng.uniform(0, 25, (count, 2)), rng.uniform(40, 60, count)])
    frames = [F450 if k % 3 else load_airframe("hummingbird") for k in range(count)]
    fleet = Fleet([frames[k] for k in order], positions[order], [LEVEL] * count)
    for row, k in enumerate(order):
        fleet.command_position(row, goal[k])
    return fleet


def test_the_search_finds_every_pair():
    fleet = crowd(np.arange(60))
    felt = 0
    for _ in range(60):
        while fleet.step % 8:
            fleet.advance(1, FLAT)
        wanted = brute_force(fleet)
        fleet.advance(1, FLAT)  # the guidance tick that refreshes the air
        np.testing.assert_allclose(-fleet.state.air_velocity_map[:, 2], wanted, atol=1e-9)
        felt += (wanted > 0.1).sum()
        fleet.advance(55, FLAT)
    assert felt > 100


def test_order_and_slices_change_nothing():
    order = np.random.default_rng(1).permutation(60)
    whole, shuffled = crowd(np.arange(60)), crowd(order)
    whole.advance(3000, FLAT)
    for steps in [1, 6, 17, 100, 876, 2000]:
        shuffled.advance(steps, FLAT)
    for name in ("position_map", "velocity_map", "attitude", "rotor_speed", "air_velocity_map"):
        np.testing.assert_array_equal(
            getattr(whole.state, name)[order], getattr(shuffled.state, name), name
        )
