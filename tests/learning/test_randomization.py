"""Randomized parameters: an environment equals a simulation whose scenario has its values."""

import textwrap
from dataclasses import replace

import numpy as np
import pytest

from volery.core.errors import CommandError
from volery.learning import randomization
from volery.learning.episodes import Episodes
from volery.learning.tasks import load_task
from volery.learning.worlds import open_air
from volery.runtime import Simulation, VectorizedSimulation
from volery.runtime.environment_parameters import EnvironmentParameters
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.load import parse_scenario

STATES = ("position_map", "velocity_map", "attitude", "omega_body", "rotor_speed")
SPEEDS = [610.0, 600.0, 605.0, 604.0]


def data():
    """The scenario of `open_air`, as data, with another seed."""
    return {
        "name": "own",
        "seed": 1,
        "physics": {"rate_hz": 500, "guidance_rate_hz": 100},
        "world": {},
        "types": {"f450": {"airframe": "f450", "sensors": []}},
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 10.0]}],
    }


@pytest.fixture(scope="module")
def many():
    """Three environments of an F450; the second one differs."""
    scenario = open_air("f450", physics_hz=500, guidance_hz=100)
    with VectorizedSimulation(scenario, 3, seeds=[1, 1, 1], threads=2) as envs:
        yield envs


def alone(scenario, command, seconds=0.4):
    """Returns the last state of a simulation of one UAV."""
    with Simulation(parse_scenario(scenario)) as simulation:
        command(simulation.uavs["uav1"])
        simulation.run(seconds)
        state = simulation.uavs["uav1"].fleet_row[0].state
        return type(state)(*(array.copy() for array in state))


def flown(envs, command, seconds=0.4):
    command(envs)
    envs.run(seconds)
    return envs.state()


def assert_equal(found, expected):
    for name in STATES:
        np.testing.assert_array_equal(
            getattr(found, name)[1, 0], getattr(expected, name)[0], err_msg=name
        )


def test_masses_rotors_and_motors_are_those_of_a_scenario_with_another_airframe(many, tmp_path):
    file = tmp_path / "heavy.toml"
    file.write_text(
        textwrap.dedent("""
            base = "f450"
            name = "heavy"
            [body]
            mass_kg = 2.3
            inertia_kg_m2 = [0.04, 0.035, 0.02]
        """)
    )
    thrust, lag = [0.9, 1.0, 0.95, 0.97], [1.5, 1.0, 1.2, 0.8]
    nominal = data()
    nominal["types"]["f450"]["airframe"] = str(file)
    nominal["types"]["f450"]["wear"] = [
        {"thrust": t, "lag": d} for t, d in zip(thrust, lag, strict=True)
    ]

    def command(envs):
        envs.command_rotor_speeds(SPEEDS)

    expected = alone(nominal, command)
    before = many.get_state()
    parameters = EnvironmentParameters(
        mass_kg=2.3, inertia_kg_m2=[0.04, 0.035, 0.02], rotor_thrust=thrust, motor_delay=lag
    )
    many.set_parameters([1], parameters)
    many.reset()
    found = flown(many, command)
    assert_equal(found, expected)
    assert abs(found.velocity_map[0, 0, 2] - found.velocity_map[1, 0, 2]) > 0.3
    np.testing.assert_array_equal(found.position_map[0], found.position_map[2])

    varied = many.get_state()
    again = flown(many, command, 0.2)
    many.set_state(varied)
    np.testing.assert_array_equal(flown(many, command, 0.2).position_map, again.position_map)
    many.set_state(before)
    many.reset()
    found = flown(many, command)
    np.testing.assert_array_equal(found.position_map[0], found.position_map[1])


def test_winds_are_those_of_a_scenario_with_other_weather(many):
    windy = data()
    windy["world"]["wind"] = {"velocity_m_s": [5.0, -2.0, 0.0], "w20_m_s": 7.0}

    def command(envs):
        envs.command_velocity([1.0, 0.0, 0.0], 0.2)

    expected = alone(windy, command)
    before = many.get_state()
    parameters = EnvironmentParameters(wind_map=[5.0, -2.0, 0.0], turbulence_m_s=7.0)
    many.reset(seeds=[7, 8, 9])
    many.reset(seeds=[1, 1, 1])  # while the air is calm
    many.set_parameters(np.array([False, True, False]), parameters)
    many.reset()
    assert_equal(flown(many, command), expected)
    many.reset(seeds=[4, 5, 6])
    windy_state = many.get_state()
    other = flown(many, command).position_map
    many.reset(seeds=[1, 1, 1])
    found = flown(many, command)
    assert_equal(found, expected)
    many.set_state(windy_state)
    np.testing.assert_array_equal(flown(many, command).position_map, other)
    assert np.linalg.norm(found.air_velocity_map[1]) > 3.0
    assert not found.air_velocity_map[0].any()
    many.set_state(before)
    assert not flown(many, command).air_velocity_map.any()


def test_heavy_uavs_start_with_the_rotor_speeds_of_their_own_hover(many):
    before = many.get_state()
    many.set_parameters(None, EnvironmentParameters(mass_kg=[[2.0], [2.5], [3.0]]))
    many.reset(start=EnvironmentStart([0.0, 0.0, 9.0]))
    speeds = many.state().rotor_speed[:, 0, 0]
    np.testing.assert_allclose(speeds**2, speeds[0] ** 2 * np.array([1.0, 1.25, 1.5]))
    many.set_state(before)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"mass_kg": [0.0]}, "mass_kg: finite numbers from 0.0001 to 10000 are needed"),
        ({"wind_map": [np.nan, 0, 0]}, "wind_map: finite numbers"),
        ({"rotor_thrust": np.ones((7, 1, 4))}, "does not broadcast"),
    ],
)
def test_impossible_parameters_are_refused(many, parameters, message):
    with pytest.raises(CommandError, match=message):
        many.set_parameters(None, EnvironmentParameters(**parameters))


def test_every_episode_draws_from_the_stated_ranges():
    task = replace(
        load_task("hover"),
        randomization=(
            randomization.wind(1.0, 2.0),
            randomization.turbulence(0.0, 5.0),
            randomization.mass(0.8, 1.2),
            randomization.inertia(0.9, 1.1),
            randomization.rotor_thrust(0.9, 1.0),
            randomization.motor_delay(0.7, 1.3),
            randomization.noise_scale(0.5, 2.0),
        ),
    )
    episodes = Episodes(task, 4, threads=1)
    episodes.begin(np.arange(4))
    first = {name: numbers.copy() for name, numbers in episodes.flight.varied.items()}
    episodes.begin(np.array([1, 2]))
    varied = episodes.flight.varied
    for name, low, high in (("mass", 0.8, 1.2), ("rotor_thrust", 0.9, 1.0), ("inertia", 0.9, 1.1)):
        assert (varied[name] >= low).all()
        assert (varied[name] <= high).all()
        assert len(np.unique(varied[name])) == varied[name].size
        np.testing.assert_array_equal(varied[name][[0, 3]], first[name][[0, 3]])
        assert (varied[name][[1, 2]] != first[name][[1, 2]]).all()
    speed = np.linalg.norm(varied["wind"], axis=-1)
    assert ((speed >= 1.0) & (speed <= 2.0)).all()
    health = episodes.flight.state.rotor_health[:, :, :4]
    np.testing.assert_array_equal(health, varied["rotor_thrust"])
    episodes.close()
