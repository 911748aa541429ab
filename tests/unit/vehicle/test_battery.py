"""Batteries: the circuit against its closed forms, levels, sag, endurance, the sensor."""

import numpy as np
import pytest
from flown_plants import F450, LEVEL, body, plant
from scipy.integrate import solve_ivp

from volery.control.fleet import Fleet
from volery.control.fleet_events import FleetEventKind
from volery.core.errors import CommandError
from volery.vehicle.airframe import Airframe, airframe_names, hover_power, load_airframe
from volery.vehicle.battery import BatteryLevel, drain
from volery.vehicle.compiled import fused_kernel
from volery.world.terrain import Terrain

FLAT = Terrain.flat(4000.0, 0.0, (-2000.0, -2000.0)).grid
COMMAND = np.dtype([("full_thrust", "f8")])


@fused_kernel
def _drain(bodies, plants, commands, times, out):
    for k in range(times):
        drain(bodies[0], plants[0], commands[0])
        out[k, 0] = bodies[0].battery_voltage
        out[k, 1] = bodies[0].battery_current
        out[k, 2] = bodies[0].battery_charge


def with_battery(base=F450, **changes) -> Airframe:
    data = base.model_dump()
    data["battery"] |= changes
    return Airframe.model_validate(data)


def drained(airframe, speed, seconds, charge=1.0):
    """Rows of voltage, current, charge while the rotors turn at `speed`."""
    plants = plant(airframe)
    bodies = body(plants, charge=charge)
    bodies["rotor_speed"][0, :4] = speed
    out = np.zeros((round(seconds / 0.04), 3))
    _drain(bodies, plants, np.zeros(1, COMMAND), len(out), out)
    return out


def shaft_power(airframe, speed):
    battery, rotors = airframe.battery, airframe.rotors
    torque = battery.power_torque_m * rotors.thrust_n_s2 * speed**2
    return 4 * torque * speed / battery.efficiency + battery.avionics_w


def test_sag_is_the_pairs_exponential():
    """Flat open-circuit voltage, next to no series resistance: V = E - I R1 (1 - exp(-t / tau))."""
    airframe = with_battery(
        open_circuit_v=(4.0, 4.0), resistance_ohm=1e-9, pair_resistance_ohm=2e-3, pair_time_s=8.0
    )
    rows = drained(airframe, 770.0, 30.0)
    current = shaft_power(airframe, 770.0) / 16.0
    time = np.arange(len(rows)) * 0.04
    wanted = 16.0 - 2e-3 * current * (1 - np.exp(-time / 8.0))
    np.testing.assert_allclose(rows[:, 0], wanted, atol=2e-4)
    np.testing.assert_allclose(rows[:, 2], 1 - current * (time + 0.04) / 18000, atol=1e-4)


def test_the_circuit_against_an_integrator():
    battery = F450.battery
    power = shaft_power(F450, 800.0)

    def current_of(charge, pair):
        table = battery.open_circuit_v
        source = 4 * np.interp(charge, np.linspace(0, 1, len(table)), table) - pair
        r = battery.resistance_ohm
        return (source - np.sqrt(source**2 - 4 * r * power)) / (2 * r), source

    def rhs(_t, y):
        current = current_of(*y)[0]
        pair = (battery.pair_resistance_ohm * current - y[1]) / battery.pair_time_s
        return [-current / (3600 * battery.capacity_ah), pair]

    rows = drained(F450, 800.0, 120.0)
    end = solve_ivp(rhs, (0, 119.96), [1.0, 0.0], rtol=1e-10, atol=1e-10, max_step=0.1).y[:, -1]
    current, source = current_of(*end)
    assert rows[-1, 0] == pytest.approx(source - battery.resistance_ohm * current, abs=2e-3)
    assert rows[-1, 1] == pytest.approx(current, rel=1e-4)
    assert rows[-1, 2] == pytest.approx(end[0], abs=1e-4)


def test_power_beyond_what_it_gives():
    rows = drained(with_battery(resistance_ohm=0.05), 1900.0, 0.04)
    np.testing.assert_allclose(rows[0, :2], [16.8 / 2, 16.8 / 2 / 0.05], rtol=1e-12)


@pytest.mark.parametrize("name", airframe_names())
def test_hover_endurance(name):
    """Charge falls as power over voltage says; a full pack lasts 5 to 30 minutes."""
    airframe = load_airframe(name)
    fleet = Fleet([airframe], [[0, 0, 100.0]], [LEVEL])
    fleet.advance(40_000, FLAT)
    used = 1.0 - fleet.state.battery_charge[0]
    power, battery = hover_power(airframe), airframe.battery
    coulombs = used * battery.capacity_ah * 3600
    assert coulombs * fleet.state.battery_voltage[0] == pytest.approx(40.0 * power, rel=0.03)
    nominal = 3.8 * battery.cells * battery.capacity_ah * 3600
    assert 5.0 < nominal / power / 60.0 < 30.0


def test_levels_are_reported_once_and_an_empty_pack_lets_it_fall():
    fleet = Fleet([with_battery(capacity_ah=0.1)], [[0, 0, 200.0]], [LEVEL], battery_charge=0.3)
    fleet.advance(8000, FLAT)
    noted = [e for e in fleet.drain_events() if e.kind is FleetEventKind.BATTERY]
    assert [e.battery_level for e in noted] == [
        BatteryLevel.LOW,
        BatteryLevel.CRITICAL,
        BatteryLevel.EMERGENCY,
        BatteryLevel.EMPTY,
    ]
    assert fleet.state.battery_level[0] == BatteryLevel.EMPTY
    assert fleet.state.rotor_speed[0].max() < 10.0
    assert fleet.state.velocity_map[0, 2] < -3.0


def test_sag_takes_the_top_of_the_thrust():
    full = {}
    for charge in (1.0, 0.15):
        fleet = Fleet([F450], [[0, 0, 100.0]], [LEVEL], battery_charge=charge)
        fleet.command_rotor_speeds(0, [1100] * 4)
        fleet.advance(500, FLAT)
        full[charge] = fleet.state.rotor_speed[0, 0], fleet.state.battery_voltage[0]
    assert full[1.0][0] == pytest.approx(1100, rel=0.03)
    speed, voltage = full[0.15]
    assert speed < 1050
    assert speed == pytest.approx(1100 * voltage / 14.8, rel=0.01)


def test_attitude_stays_in_hand_when_thrust_runs_out():
    """Commanded to climb on a weak pack, it climbs slowly and stays upright."""
    weak = with_battery(rated_v=18.5)
    fleet = Fleet([weak], [[0, 0, 50.0]], [LEVEL], battery_charge=0.3)
    fleet.command_velocity_map(0, (6, 0, 3))
    fleet.set_command_timeout(60)
    up = []
    for _ in range(300):
        fleet.advance(10, FLAT)
        q = fleet.state.attitude[0]
        up.append(1 - 2 * (q[0] ** 2 + q[1] ** 2))
    assert min(up) > 0.5


def test_without_a_battery_nothing_sags():
    data = F450.model_dump()
    data["battery"] = None
    fleet = Fleet([Airframe.model_validate(data)], [[0, 0, 50.0]], [LEVEL])
    fleet.advance(500, FLAT)
    assert fleet.state.battery_charge[0] == 1.0
    assert fleet.state.battery_current[0] == 0.0


def test_bad_charge():
    with pytest.raises(CommandError, match="battery_charge"):
        Fleet([F450], [[0, 0, 50.0]], [LEVEL], battery_charge=1.5)
