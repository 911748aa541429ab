"""What people print and look at in notebooks says in a line what it is."""

import pytest

from volery.control.flight_modes import FlightMode
from volery.runtime import VectorizedSimulation
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
