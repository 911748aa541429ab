"""One list for every plant: what turns commands into motion may differ, how it behaves may not."""

import numpy as np
import pytest

from volery.control.fleet import Fleet
from volery.vehicle.airframe import load_airframe
from volery.vehicle.identified import load_identified
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import RigidBody
from volery.world.terrain import Terrain
from volery.world.weather import Weather

FLAT = Terrain.flat(1000.0, 0.0, (-500.0, -500.0)).grid
PLANTS = {
    "rigid_body": RigidBody(),
    "identified": load_identified("f450"),
    "kinematic": Kinematic(),
    "kinematic, lagging": Kinematic(time_constant_s=0.3, limited=True),
}
OFFSET = np.array([3.0, 1.0, 1.0])
every_plant = pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)


def fleet_of(*plants):
    f450, count = load_airframe("f450"), len(plants)
    positions = np.column_stack([10.0 * np.arange(count), np.zeros(count), np.full(count, 10.0)])
    attitude = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    return Fleet(
        [f450] * count, positions, attitude, plants=plants, weather=Weather((1.0, 0.5, 0.0))
    )


def task(fleet, row=0):
    """Flies by velocity, then to a position, then down."""
    at = fleet.state.position_map[row].copy()
    yield 400, lambda: fleet.command_velocity_body(row, [1.0, 0.5, 0.2], 0.4)
    yield 5000, lambda: fleet.command_position(row, at + OFFSET, 0.5)
    yield 400, lambda: fleet.hold(row)


def flown(fleet, slices=(6000,), row=0):
    turn = 0
    for steps, command in task(fleet, row):
        command()
        left = steps
        while left:
            done = min(left, slices[turn % len(slices)])
            fleet.advance(done, FLAT)
            left, turn = left - done, turn + 1
    return {name: np.array(array[row]) for name, array in fleet.state._asdict().items()}


def assert_equal(ours, theirs):
    for name, array in ours.items():
        np.testing.assert_array_equal(array, theirs[name], err_msg=name)


@every_plant
def test_does_its_task(plant):
    fleet = fleet_of(plant)
    start = fleet.state.position_map[0].copy()
    flown(fleet)
    fleet.advance(2000, FLAT)
    np.testing.assert_allclose(fleet.state.position_map[0], start + OFFSET, atol=0.15)
    assert np.linalg.norm(fleet.state.velocity_map[0]) < 0.05
    np.testing.assert_allclose(np.linalg.norm(fleet.state.attitude[0]), 1.0, atol=1e-9)


@every_plant
def test_is_deterministic_and_independent_of_slicing(plant):
    once = flown(fleet_of(plant))
    assert_equal(once, flown(fleet_of(plant)))
    assert_equal(once, flown(fleet_of(plant), slices=(1, 7, 33, 5)))


@every_plant
def test_state_is_kept_and_taken_back(plant):
    fleet = fleet_of(plant)
    flown(fleet)
    kept = fleet.get_state()
    first = flown(fleet)
    fleet.set_state(kept)
    assert_equal(first, flown(fleet))


@every_plant
def test_nothing_is_shared_with_others(plant):
    """Alone, beside each other plant, and beside itself it flies the same."""
    alone = flown(fleet_of(plant, RigidBody()))
    for other in PLANTS.values():
        both = fleet_of(plant, other)
        both.command_velocity_map(1, [0.0, 2.0, 0.5])
        assert_equal(alone, flown(both))


@every_plant
def test_the_ground_stops_it(plant):
    fleet = fleet_of(plant)
    fleet.land(0)
    fleet.advance(30_000, FLAT)
    assert 0.05 < fleet.state.position_map[0, 2] < 0.25
    assert fleet.mode(0).name == "LANDED"
