"""A command to stop acts with the very next physics step, whatever guidance tick is next."""

from __future__ import annotations

import numpy as np
import pytest

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.vehicle.airframe import load_airframe
from volery.world.terrain import Terrain

GRID = Terrain.flat(extent_m=200.0).grid
LEVEL = [0.0, 0.0, 0.0, 1.0]


def cruising():
    fleet = Fleet(
        [load_airframe("f450")] * 2,
        [[0.0, 0.0, 20.0], [30.0, 0.0, 20.0]],
        [LEVEL] * 2,
        mode=FlightMode.HOLD,
    )
    for i in range(2):
        fleet.set_command_timeout(60.0, i)
        fleet.command_velocity_body(i, [3.0, 0.0, 0.0])
    fleet.advance(2000, GRID)
    return fleet


def rotors_after(steps, command, number=1, into_tick=3):
    """Commanded rotor speeds of both UAVs so many steps after a command between two ticks."""
    fleet = cruising()
    fleet.advance(into_tick, GRID)
    command(fleet)
    for _ in range(number):
        fleet.advance(steps // number, GRID)
    return fleet._control_states["rotor_reference"].copy()


def nothing(fleet):
    """No command."""


STOPS = {
    "zero Twist": lambda fleet: fleet.command_velocity_body(0, [0.0, 0.0, 0.0]),
    "hold": lambda fleet: fleet.hold(0),
}


@pytest.mark.parametrize("stop", STOPS.values(), ids=STOPS)
@pytest.mark.parametrize("into_tick", [1, 3, 6])
def test_a_stop_reaches_the_rotors_with_the_next_step(stop, into_tick):
    without = rotors_after(1, nothing, into_tick=into_tick)
    stopped = rotors_after(1, stop, into_tick=into_tick)
    assert (stopped[0] != without[0]).any()
    assert (stopped[1] == without[1]).all()


def test_other_velocities_wait_for_the_next_tick():
    faster = rotors_after(1, lambda fleet: fleet.command_velocity_body(0, [4.0, 0.0, 0.0]))
    assert (faster == rotors_after(1, nothing)).all()


@pytest.mark.parametrize("stop", STOPS.values(), ids=STOPS)
def test_how_time_is_sliced_changes_nothing(stop):
    assert (rotors_after(40, stop) == rotors_after(40, stop, number=40)).all()


def test_it_still_stops():
    fleet = cruising()
    fleet.command_velocity_body(0, [0.0, 0.0, 0.0])
    fleet.advance(4000, GRID)
    assert np.linalg.norm(fleet.state.velocity_map[0]) < 0.05
    assert np.linalg.norm(fleet.state.velocity_map[1]) > 2.5
