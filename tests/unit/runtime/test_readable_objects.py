"""What people print and look at in notebooks says in a line what it is."""

import copy
import pickle
import re

import pytest

import volery
from volery.control.flight_modes import FlightMode
from volery.runtime import Simulation, VectorizedSimulation
from volery.scenario.load import load_scenario, parse_scenario


def test_objects_print_as_a_line(simulate, flat_data):
    flat_data["uavs"][0] |= {"count": 2, "position_m": [0.0, 0.0, 2.0]}
    simulation = simulate(flat_data)
    simulation.run(0.5)
    uav = simulation.uavs["uav1"]
    name, seed = simulation.scenario.name, simulation.scenario.seed
    duration = f"{simulation.scenario.duration_s:g}"
    assert repr(simulation) == f"<Simulation '{name}': 0.500 of {duration} s, 2 UAVs, seed {seed}>"
    x, y, z = uav.position_map
    assert str(uav) == f"<Uav 'uav1' (f450): HOLD at ({x:.2f}, {y:.2f}, {z:.2f}) m>"
    assert str(simulation.vehicles) == "<2 UAVs: uav1 HOLD, uav2 HOLD>"
    assert str(simulation.world) == "<world: open ground>"
    assert re.fullmatch(r"<graph: \d\d+ topics, \d\d+ services>", str(simulation.graph))
    assert re.fullmatch(
        r"<scene: \d+ static instances?, 2 moving UAVs>", str(simulation.world.scene)
    )
    assert str(simulation.snapshot()) == "<Snapshot at 0.500 s of 2 UAVs>"
    simulation.vehicles.delete("uav1")
    assert str(uav) == "<Uav 'uav1' (f450): deleted>"
    assert "deleted" in uav._repr_html_()
    simulation.close()
    assert repr(simulation).endswith("closed>")


def test_flight_modes_print_their_names():
    mode = FlightMode.HOLD
    assert (str(mode), f"{mode}", f"{mode:>6}", f"{mode:d}") == (*("HOLD", "HOLD", "  HOLD", "2"),)
    assert mode == 2


def test_scenarios_and_worlds_print_what_is_in_them(flat_data):
    assert str(load_scenario("forest_survey")).startswith("<Scenario 'forest_survey': ")
    assert "forest, " in str(load_scenario("forest_survey"))
    flat_data["world"] = {"terrain": {"kind": "flat"}, "seed": 3}
    scenario = parse_scenario(flat_data)
    assert ", open ground, " in repr(scenario)
    assert str(scenario.world) == "seed=3 terrain=FlatTerrain(kind='flat')"


@pytest.mark.parametrize("name", ["coverage", "grid_map"])
def test_worlds_print_their_grid_map(name):
    with Simulation(load_scenario(name), threads=1) as simulation:
        assert str(simulation.world).startswith("<world: grid map")


def test_worlds_print_terrain_and_meshes(simulate, flat_data, tmp_path):
    (tmp_path / "ground.csv").write_text("0,0,1\n0,1,1\n")
    corners = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nv 0 0 1\n"
    (tmp_path / "rock.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    flat_data["world"] = {
        "terrain": {"kind": "grid", "file": str(tmp_path / "ground.csv"), "spacing_m": 500.0}
    }
    assert str(simulate(flat_data).world) == "<world: terrain>"
    assert ", terrain, " in str(parse_scenario(flat_data))
    rock = {"file": str(tmp_path / "rock.obj"), "position_m": [50.0, 50.0, 0.0]}
    flat_data["world"]["meshes"] = [rock]
    assert str(simulate(flat_data).world) == "<world: 1 mesh>"
    assert ", meshes, " in str(parse_scenario(flat_data))


def test_environments_print_as_a_line(flat_data):
    scenario = parse_scenario(flat_data)
    with VectorizedSimulation(scenario, 3, threads=1) as envs:
        text = f"<VectorizedSimulation '{scenario.name}': 3 environments of 1 UAV, 0.000 s>"
        assert repr(envs) == text
        assert "Uav '1/uav1'" in repr(envs.uav(1, "uav1"))


@pytest.mark.parametrize("words", ["flight mode", "HOLD", "position (map), m", "imu", "hold"])
def test_a_uav_in_a_notebook(simulate, flat_data, words):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 2.0]
    uav = simulate(flat_data).uavs["uav1"]
    uav.hold()
    assert words in uav._repr_html_()


def test_facets_airframes_and_trajectories_print_as_a_line(simulate, flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 3.0]
    simulation = simulate(flat_data)
    simulation.faults.inject({"kind": "motor", "uav": "uav1", "rotor": 0, "thrust_factor": 0.9})
    simulation.run(0.5)
    assert repr(simulation.clock) == "<clock: 0.500 s, as fast as possible>"
    simulation.clock.set_speed(2.0)
    assert repr(simulation.clock) == "<clock: 0.500 s, 2 times real time>"
    simulation.clock.pause()
    assert repr(simulation.clock) == "<clock: 0.500 s, paused>"
    assert repr(simulation.faults) == "<active faults: motor of uav1>"
    assert repr(simulation.diagnostics) == "<diagnostics: 1 event>"
    airframe = simulation.uavs["uav1"].airframe
    assert str(airframe) == "<Airframe 'f450': DJI F450 (OpenUAV), 4 rotors, 2.065 kg>"
    line = volery.Trajectory.from_samples([0.0, 2.0], [[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]])
    assert str(line) == "<Trajectory: 0 to 2 s, from (0.00, 0.00, 3.00) to (1.00, 0.00, 3.00) m>"


def test_trajectories_of_equal_numbers_are_equal():
    def line(end):
        return volery.Trajectory.from_samples([0.0, 2.0], [[0.0, 0.0, 3.0], [end, 0.0, 3.0]])

    assert line(1.0) == line(1.0)
    assert line(1.0) != line(2.0)
    assert line(1.0) != "a line"
    assert len({line(1.0), line(1.0), line(2.0)}) == 2


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_parts_of_a_running_simulation_are_not_copied(simulate, flat_data, duplicate):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 3.0]
    simulation = simulate(flat_data)
    uav = simulation.uavs["uav1"]
    running = (
        simulation,
        simulation.vehicles,
        uav,
        uav.sensors,
        uav.sensors["imu"],
        uav.hold(),
        simulation.snapshot(),
    )
    for one in running:
        with pytest.raises(volery.CommandError, match="is neither copied nor pickled"):
            duplicate(one)
    with (
        volery.VectorizedSimulation(simulation.scenario, 2) as envs,
        pytest.raises(volery.CommandError, match="a VectorizedSimulation is neither"),
    ):
        duplicate(envs)
    simulation.run(0.1)
    for data in (simulation.scenario, uav.sensors["imu"].latest, simulation.vehicles.state()):
        duplicate(data)


def test_tab_completes_names_of_uavs_and_sensors(simulate, flat_data):
    simulation = simulate(flat_data)
    names = simulation.uavs._ipython_key_completions_()
    assert names == ["uav1"]
    assert "imu" in simulation.uavs["uav1"].sensors._ipython_key_completions_()
    assert repr(simulation.uavs).startswith("{'uav1': <Uav 'uav1' (f450): LANDED")
