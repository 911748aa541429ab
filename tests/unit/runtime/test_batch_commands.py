"""Commands to all UAVs at once equal the commands to each, in a simulation and in environments."""

import asyncio

import numpy as np
import pytest

from volery.control.flight_modes import FlightMode
from volery.control.trajectory import Trajectory
from volery.core.errors import CommandError, WaitTimeoutError
from volery.runtime import VectorizedSimulation
from volery.scenario.load import parse_scenario

TILTED = np.array([[0.05, 0.0, 0.0, 1.0], [0.0, 0.04, 0.1, 1.0], [0.0, 0.0, 0.3, 1.0]])
"""Attitudes, x y z w, not normalised."""
ROWS = {
    "command_velocity": lambda n: ([[1.0, 0.1 * n, 0.0]], [0.1 * n]),
    "command_velocity_map": lambda n: ([[0.5, 0.1 * n, 0.0]], [0.2]),
    "command_acceleration": lambda n: ([[0.3, 0.1 * n, 0.0]], [0.1 * n]),
    "command_setpoint": lambda n: (
        *([[4.0 * n, 0.5, 3.0]], [[0.1, 0.0, 0.0]], [[0.0, 0.0, 0.1]], [0.3 * n], [0.1]),
    ),
    "command_attitude": lambda n: ([TILTED[n]], [15.0 + n]),
    "command_rates": lambda n: ([[0.1 * n, 0.0, 0.2]], [15.0 + n]),
    "command_rotor_speeds": lambda n: ([[500.0 + n, 510.0, 505.0, 500.0]],),
    "go_to": lambda n: ([[4.0 * n + 1.0, 2.0, 3.0]], [0.5 * n]),
}
"""Arguments of each command for UAV n, with a first axis of one."""
STATES = ("position_map", "velocity_map", "attitude", "omega_body", "rotor_speed")


@pytest.fixture
def three_data(flat_data):
    """Three UAVs in wind; the second is on the ground, the others hover."""
    flat_data["world"] = {"wind": {"velocity_m_s": [2.0, 0.0, 0.0], "turbulence": "light"}}
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0, 3.0]},
        {"type": "f450", "position_m": [4.0, 0.0]},
        {"type": "f450", "position_m": [8.0, 0.0, 3.0]},
    ]
    return flat_data


def batch_of(command):
    """Arguments of a command for all three UAVs, (3, ...)."""
    return [np.concatenate(parts) for parts in zip(*map(ROWS[command], range(3)), strict=True)]


def command_each(simulation, command):
    guides = not command.startswith(("command_attitude", "command_rates", "command_rotor"))
    guides = guides and command != "command_acceleration"
    for n, uav in enumerate(simulation.uavs.values()):
        if not ((guides or command == "command_acceleration") and uav.mode is FlightMode.LANDED):
            getattr(uav, command)(*(np.asarray(part)[0] for part in ROWS[command](n)))


def bytes_of(simulation):
    return {name: getattr(simulation.vehicles.state(), name).tobytes() for name in STATES}


@pytest.mark.parametrize("command", ROWS)
def test_a_batch_equals_the_commands_of_each_uav(simulate, three_data, command):
    alone, batch = simulate(three_data), simulate(three_data)
    for simulation in (alone, batch):
        simulation.run(0.2)
    for _ in range(3):  # from hovering, and again
        command_each(alone, command)
        getattr(batch.vehicles, command)(*batch_of(command))
        for simulation in (alone, batch):
            simulation.run(0.15)
        assert alone._engine.fleet.modes.tolist() == batch._engine.fleet.modes.tolist()
        assert bytes_of(alone) == bytes_of(batch)


@pytest.mark.parametrize("command", ROWS)
def test_environments_take_the_same_arrays(simulate, three_data, command):
    alone = simulate(three_data)
    alone.run(0.2)
    getattr(alone.vehicles, command)(*batch_of(command))
    alone.run(0.2)
    seed = alone.scenario.seed
    with VectorizedSimulation(
        parse_scenario(three_data), 2, seeds=[seed, seed + 1], threads=2
    ) as envs:
        envs.run(0.2)
        result = getattr(envs, command)(*(np.stack([part, part]) for part in batch_of(command)))
        assert result is None or len(result) == 4  # go_to: the UAV on the ground has no future
        envs.run(0.2)
        for name in STATES:
            found, expected = getattr(envs.state(), name), getattr(alone.vehicles.state(), name)
            np.testing.assert_array_equal(found[0], expected, err_msg=name)
            assert found.shape == (2, 3, *expected.shape[1:])


def test_one_value_serves_all(simulate, three_data):
    simulation = simulate(three_data)
    simulation.vehicles.command_velocity([1.0, 0.0, 0.0])
    simulation.run(0.5)
    speeds = simulation.vehicles.state().velocity_map[:, 0]
    assert speeds[[0, 2]].min() > 0.3
    assert speeds[1] == 0.0
    modes = [uav.mode for uav in simulation.uavs.values()]
    assert modes == [FlightMode.VELOCITY, FlightMode.LANDED, FlightMode.VELOCITY]


def test_flight_modes_of_all_return_their_futures(simulate, three_data):
    simulation = simulate(three_data)
    vehicles = simulation.vehicles
    assert [future.uav for future in vehicles.take_off(2.0)] == ["uav2"]
    simulation.run_until(simulation.uavs["uav2"].pending_command)
    trajectory = Trajectory.from_samples([0.0, 1.0], [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]])
    with pytest.raises(CommandError, match="2 trajectories for 3 UAVs; give one each"):
        vehicles.follow_trajectory([trajectory, trajectory])
    assert len(vehicles.follow_trajectory(trajectory)) == 3
    futures = vehicles.hold()
    simulation.run_until(futures)
    assert all(future.done() for future in futures)
    simulation.run_until(vehicles.land())
    assert {uav.mode for uav in simulation.uavs.values()} == {FlightMode.LANDED}
    with pytest.raises(CommandError, match="land reaches no UAV: uav1 is on the ground already"):
        vehicles.land()


def test_batches_that_reach_no_uav_say_why(simulate, three_data):
    """A script that commands before it waits must not end without a flight."""
    for uav in three_data["uavs"]:
        uav["position_m"] = uav["position_m"][:2]
        uav["on_start"] = "take_off"
    simulation = simulate(three_data)
    vehicles = simulation.vehicles
    with pytest.raises(CommandError, match=r"take_off reaches no UAV: uav1 .*TAKE_OFF.*wait\(\)"):
        vehicles.take_off(2.0)
    for stream in ("command_velocity", "command_velocity_map", "command_acceleration"):
        with pytest.raises(CommandError, match=f"{stream} reaches no UAV: uav1 is TAKE_OFF, uav2"):
            getattr(vehicles, stream)([1.0, 0.0, 0.0])
    with pytest.raises(CommandError, match="command_setpoint reaches no UAV: uav1 is TAKE_OFF"):
        vehicles.command_setpoint([0.0, 0.0, 3.0])
    goals = [[0.0, 1.0, 3.0], [4.0, 1.0, 3.0], [8.0, 1.0, 3.0]]
    assert len(vehicles.go_to(goals)) == 3  # as the command to a single UAV, it ends a take-off
    results = vehicles.wait()
    np.testing.assert_allclose([one.position_map for one in results], goals, atol=0.3)
    assert vehicles.wait() == []
    simulation.run_until(vehicles.land())
    for command in (vehicles.land, vehicles.hold, lambda: vehicles.go_to([0.0, 0.0, 3.0])):
        with pytest.raises(CommandError, match=r"reaches no UAV: uav1 is on the ground"):
            command()
    for nothing in ([], (), {}, (future for future in ())):
        with pytest.raises(CommandError, match="nothing to wait for"):
            simulation.run_until(nothing)


def test_all_uavs_wait_within_one_timeout(simulate, three_data):
    simulation = simulate(three_data)
    simulation.vehicles.take_off(3.0)
    with pytest.raises(WaitTimeoutError, match=r"take_off of uav2 is not done within 0\.5 s"):
        simulation.vehicles.wait(0.5)
    assert simulation.time_s == pytest.approx(0.5)
    assert [one.mode for one in simulation.vehicles.wait()] == [FlightMode.HOLD]
    with pytest.raises(CommandError, match="timeout_s must be a number"):
        simulation.vehicles.wait(-1.0)


def test_a_batch_says_how_long_it_waited(simulate, flat_data):
    """Also for a UAV whose turn comes when most of the time is over."""
    flat_data["uavs"][0] |= {"count": 2, "position_m": [0.0, 0.0, 2.0]}
    simulation = simulate(flat_data)
    near, far = [0.0, 0.0, 2.5], [90.0, 0.0, 3.0]
    with pytest.raises(WaitTimeoutError, match=r"go_to of uav2 is not done within 4 s; it goes on"):
        simulation.vehicles.go_to([near, far]).wait(4.0)
    futures = simulation.vehicles.go_to([near, far])
    with pytest.raises(WaitTimeoutError, match=r"go_to of uav2 is not done within 3 s; it goes on"):
        simulation.run_until(futures, timeout_s=3.0)


def test_futures_of_a_batch_are_waited_for_like_that_of_one_uav(simulate, three_data):
    simulation = simulate(three_data)
    vehicles = simulation.vehicles
    (climbed,) = vehicles.take_off(2.0).wait()
    assert climbed.mode is FlightMode.HOLD
    with pytest.raises(WaitTimeoutError, match=r"go_to of uav1 is not done within 1 s"):
        vehicles.go_to([[9.0, 9.0, 3.0], [4.0, 1.0, 3.0], [8.0, 1.0, 3.0]]).wait(1.0)
    assert simulation.time_s == pytest.approx(climbed.time_s + 1.0, abs=0.05)

    async def fly():
        held = await vehicles.hold()
        stopped, landed = await asyncio.gather(simulation.uavs["uav1"].hold(), vehicles_of(1, 2))
        return held, stopped, landed

    async def vehicles_of(*rows):
        uavs = list(simulation.uavs.values())
        return [await uavs[row].land() for row in rows]

    held, stopped, landed = asyncio.run(fly())
    assert [one.mode for one in held] == 3 * [FlightMode.HOLD]
    assert stopped.mode is FlightMode.HOLD
    assert [one.mode for one in landed] == 2 * [FlightMode.LANDED]
    assert [one.mode for one in vehicles.return_home().wait()] == [FlightMode.LANDED]


def test_futures_are_awaited_in_any_collection(simulate, three_data):
    simulation = simulate(three_data)
    uavs = [simulation.uavs["uav1"], simulation.uavs["uav3"]]
    for collect in (list, tuple, set, np.array, lambda those: {one.uav: one for one in those}):
        simulation.run_until(collect([uav.go_to(uav.position_map + 0.2) for uav in uavs]))
        assert {uav.mode for uav in uavs} == {FlightMode.HOLD}
    line = Trajectory.from_samples([0.0, 1.0], [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]])
    assert len(simulation.vehicles.follow_trajectory(line for _ in range(3))) == 2
    with pytest.raises(CommandError) as caught:
        simulation.run_until([[uav.hold()] for uav in uavs])
    assert len(str(caught.value)) < 190


def test_single_uavs_are_not_sought_among_the_vehicles(simulate, three_data):
    vehicles = simulate(three_data).vehicles
    assert len(vehicles) == 3
    for look in (lambda: vehicles["uav1"], lambda: vehicles[:2], lambda: list(vehicles)):
        with pytest.raises(CommandError, match=r"simulation\.uavs has each by its name"):
            look()


def test_environments_wait_together_and_ignore_streams_that_reach_none(three_data):
    with VectorizedSimulation(parse_scenario(three_data), 2, seeds=[1, 2], threads=1) as envs:
        assert len(envs.take_off(2.0)) == 2
        assert [one.mode for one in envs.wait()] == [FlightMode.HOLD] * 2
        envs.land()
        envs.wait()
        envs.command_velocity([1.0, 0.0, 0.0])  # policies act at each step, also after a landing
        with pytest.raises(CommandError, match="hold reaches no UAV"):
            envs.hold()


def test_a_batch_replaces_flight_modes_of_the_uavs_that_it_reaches(simulate, three_data):
    simulation = simulate(three_data)
    trajectory = Trajectory.from_samples([0.0, 3.0], [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]])
    first = simulation.uavs["uav1"].follow_trajectory(trajectory)
    climbing = simulation.uavs["uav2"].take_off(2.0)
    simulation.vehicles.command_setpoint([4.0, 0.0, 3.0])
    assert "command_setpoint replaced it" in str(first.exception())
    assert not climbing.done()  # it takes off and ignores setpoints
    simulation.vehicles.command_rates([0.0, 0.0, 0.0], 15.0)
    assert "command_rates replaced it" in str(climbing.exception())


@pytest.mark.parametrize(
    ("command", "arguments", "reason"),
    [
        ("command_velocity", ([[1.0, 0.0]] * 3,), r"velocity of shape \(3, 2\) does not broadcast"),
        ("command_velocity", ("fast",), r"velocity: numbers of shape \(3, 3\) are needed"),
        ("command_velocity", ([np.nan, 0, 0],), r"velocity = \[nan, 0.0, 0.0\] of uav1 is out of"),
        ("command_velocity", ([[0, 0, 0], [0, 0, 0], [9e3, 0, 0]],), "of uav3 is out of range; "),
        ("command_velocity", ([1.0, 0, 0], 200.0), "yaw rate = 200.0 of uav1 .* -100 to 100 are"),
        ("command_velocity_map", ([1.0, 0, 0], [0.0, 0.0]), r"yaw rate of shape \(2,\) does not"),
        ("command_setpoint", ([1e7, 0, 0],), "position = .* of uav1 is out of range"),
        ("command_setpoint", ([0, 0, 1], 0.0, 0.0, np.inf), "yaw = inf of uav1 is out of range"),
        ("command_acceleration", ([np.inf, 0, 0],), "acceleration = .* of uav1"),
        ("command_attitude", ([0, 0, 0, 2], 9.0), "length of attitude = 2.0 of uav1 is .* 0.9 to"),
        ("command_attitude", ([0, 0, 0, 1], [1, 2, -3]), "thrust = -3.0 of uav3 is out of range"),
        ("command_rates", ([99.0, 0, 0], 9.0), "rates = .* of uav1 is out of range"),
        ("command_rates", ([0, 0, 0], 9e9), "thrust = 9000000000.0 of uav1 is out of range; "),
        ("command_rotor_speeds", ([1, 2, 3],), r"rotor speeds of shape \(3,\) does not broadcast "),
        ("command_rotor_speeds", (-1.0,), "rotor speeds = .* of uav1 is out of range; .* from 0 "),
        ("go_to", ([1.0, 0.0],), r"position of shape \(2,\) does not broadcast to \(3, 3\)"),
    ],
)
def test_errors_are_one_line_and_change_nothing(simulate, three_data, command, arguments, reason):
    simulation = simulate(three_data)
    future = simulation.uavs["uav3"].go_to([9.0, 0.0, 3.0])
    before = simulation._engine.fleet.get_state()["uavs"].tobytes()
    with pytest.raises(CommandError, match=reason) as caught:
        getattr(simulation.vehicles, command)(*arguments)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 160
    assert simulation._engine.fleet.get_state()["uavs"].tobytes() == before
    assert not future.done()


def test_errors_name_the_environment_and_no_block_is_commanded(three_data):
    with VectorizedSimulation(parse_scenario(three_data), 3, threads=3) as envs:
        thrust = np.full((3, 3), 15.0)
        thrust[2, 1] = -1.0
        with pytest.raises(CommandError, match=r"thrust = -1.0 of 2/uav2 is out of range"):
            envs.command_rates([0.0, 0.0, 0.0], thrust)
        assert envs.uav(0, "uav1").mode is FlightMode.HOLD
    with pytest.raises(CommandError, match="closed"):
        envs.command_velocity([0.0, 0.0, 0.0])


def test_plants_without_a_command_refuse_the_batch(simulate, flat_data):
    flat_data["types"]["f450"]["plant"] = "kinematic"
    simulation = simulate(flat_data)
    with pytest.raises(CommandError, match="uav1 does not accept rates: its plant is a Kinematic"):
        simulation.vehicles.command_rates([0.0, 0.0, 0.0], 9.0)
    with pytest.raises(CommandError, match="does not accept rotor speeds"):
        simulation.vehicles.command_rotor_speeds(100.0)


def test_a_changed_fleet_has_its_own_limits(simulate, three_data):
    simulation = simulate(three_data)
    simulation.vehicles.command_rates([0.0, 0.0, 0.0], 15.0)
    simulation.vehicles.spawn("small", "crazyflie", [0.0, 9.0, 2.0])
    with pytest.raises(CommandError, match=r"thrust = 15.0 of small is out of range"):
        simulation.vehicles.command_rates([0.0, 0.0, 0.0], 15.0)
    simulation.vehicles.command_rates([0.0, 0.0, 0.0], [15.0, 15.0, 15.0, 0.3])
    assert simulation.uavs["small"].mode is FlightMode.LOW_LEVEL
