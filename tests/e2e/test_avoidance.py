"""Avoidance by depth camera: past one block, by two methods; and the numbers of a bench."""

from __future__ import annotations

import itertools

import pytest

from volery.control.flight_modes import FlightMode
from volery.scenario.load import load_scenario
from volery_benchmarks.avoidance import FIELDS, METHODS, Flight, field_scenario, figures_of

COURSE_M = 32.0


@pytest.fixture
def past_a_block(tmp_path):
    """A course with a block of 2 m in its first half."""

    def scenario(method):
        data = load_scenario("obstacle_field").model_dump()
        (tmp_path / "block.csv").write_text("1\n")
        data["world"]["forest"] = None
        data["world"]["grid_map"] = {
            "maps": [{"file": str(tmp_path / "block.csv")}],
            "cell_size_m": 2.0,
            "origin_m": [11.0, -1.3],
        }
        node = data["types"]["scout"]["nodes"][0]
        node["node"] = METHODS[method]
        node["parameters"]["distance_m"] = COURSE_M
        if method == "region":
            node["parameters"] |= {"threshold": 0.6, "region": [0.5, 0.4]}
        data["duration_s"] = 120.0
        return data

    return scenario


def fly(simulate, scenario):
    simulation = simulate(scenario)
    phases = []
    for name in ("region_avoidance", "depth_avoidance"):
        topic = f"/uav1/{name}/phase"
        simulation.graph.subscribe(
            topic, lambda p: phases.append(p.message.data), "std_msgs/msg/String"
        )
    simulation.run()
    assert [
        e for e in simulation.diagnostics.events if str(e.kind) in ("impact", "collision")
    ] == []
    uav = simulation.uavs["uav1"]
    assert uav.mode is FlightMode.LANDED
    assert uav.position_map[0] > COURSE_M - 1.0
    return simulation, [phase for phase, _ in itertools.groupby(phases)]


def test_the_machine_goes_through_its_states(simulate, past_a_block):
    _, phases = fly(simulate, past_a_block("region"))
    assert phases[0] == "climb"
    flown = phases[1:]
    begin = flown.index("stopped") - 1
    assert flown[begin : begin + 4] == ["forward", "stopped", "avoid", "return"]
    assert flown[-1] == "land"


def test_the_whole_image_leads_around(simulate, past_a_block):
    simulation, phases = fly(simulate, past_a_block("whole"))
    assert phases == ["climb", "fly", "land"]
    assert simulation.time_s < 40.0


@pytest.mark.parametrize("field", FIELDS)
def test_fields_differ_by_seed_alone(tmp_path, field):
    first, again, other = (field_scenario("whole", field, seed, tmp_path) for seed in (1, 1, 2))
    assert first == again
    assert first.seed != other.seed


def test_the_benchs_figures():
    flights = [
        Flight("region", "trees", 1, True, False, 9.0, 10.0),
        Flight("region", "trees", 2, False, True, 70.0, 60.0),
        Flight("region", "trees", 3, False, True, 80.0, 50.0),
        Flight("whole", "trees", 1, False, True, 66.0, 40.0),
    ]
    figures = figures_of(flights)
    assert figures["trees_region_collisions"] == 1
    assert figures["trees_region_arrivals"] == 2
    assert figures["trees_region_metres"] == 75.0
    assert figures["trees_whole_seconds"] == 40.0
    assert figures["blocks_whole_arrivals"] == 0
    assert "blocks_whole_metres" not in figures
