"""Scenarios that clients of the graph load with changes."""

import json
import sys

import numpy as np
import pytest
from service_calls import call_service

from volery.core.errors import CommandError
from volery.runtime import Simulation
from volery.runtime.construction.worlds import build_forest, build_terrain
from volery.scenario import library
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.changes import Changes, WorldRequest, apply
from volery.scenario.load import load_scenario, parse_scenario
from volery.vehicle.airframe import airframe_names


def test_what_can_be_chosen(simulate, flat_data):
    options = call_service(simulate(flat_data), "/volery/get_scenario_options")
    assert options.success
    assert list(options.scenarios) == library.names()
    assert tuple(options.airframes) == airframe_names()
    assert list(options.sensor_sets) == ["lidar", "camera", "sonar", "navigation"]
    assert len(options.sensor_set_descriptions) == 4
    schema = json.loads(options.changes_schema)
    assert schema["properties"]["uavs"]["anyOf"][0]["maximum"] == 10_000


def test_a_scenario_is_loaded_with_changes(simulate, flat_data):
    asked = []
    simulation = simulate(flat_data, on_load=asked.append)
    changes = {"uavs": 5, "airframe": "crazyflie", "sensors": ["lidar", "camera"], "seed": 3}
    response = call_service(
        simulation, "/volery/load_scenario", scenario="longleaf", changes=json.dumps(changes)
    )
    assert response.success, response.message
    wanted = Changes(uavs=5, airframe="crazyflie", sensors=("lidar", "camera"), seed=3)
    assert asked == [WorldRequest("longleaf", wanted)]
    assert call_service(simulation, "/volery/load_scenario", scenario="hover").success
    assert asked[1] == WorldRequest("hover", Changes())


@pytest.mark.parametrize(
    ("scenario", "changes", "words"),
    [
        ("nowhere", {}, ["'nowhere'", "longleaf"]),
        ("../../etc/passwd", {}, ["known"]),
        ("", {}, ["known"]),
        ("hover", {"airframe": "zeppelin"}, ["'zeppelin'", "crazyflie"]),
        ("hover", {"airframe": "../f450.toml"}, ["known"]),
        ("hover", {"uavs": -1}, ["key 'uavs'"]),
        ("hover", {"tree_share": 0.5}, ["tree_share"]),
        ("swarm_100", {"uavs": 7}, ["10 groups"]),
    ],
)
def test_what_cannot_be_is_refused_before_the_world_goes(
    simulate, flat_data, scenario, changes, words
):
    asked = []
    simulation = simulate(flat_data, on_load=asked.append)
    response = call_service(
        simulation, "/volery/load_scenario", scenario=scenario, changes=json.dumps(changes)
    )
    assert not response.success
    assert all(word in response.message for word in words), response.message
    assert asked == []


@pytest.mark.parametrize("service", ["/volery/load_scenario", "/load_world"])
def test_a_scenario_whose_packages_are_missing_does_not_end_the_flight(
    simulate, flat_data, service, monkeypatch
):
    monkeypatch.setitem(sys.modules, "ompl", None)
    monkeypatch.setitem(sys.modules, "gtsam", None)
    asked = []
    simulation = simulate(flat_data, on_load=asked.append)
    if service == "/load_world":
        fields = {"world_resource": {"uri": "forest_search"}}
        response = call_service(simulation, service, **fields).result
        message, done = response.error_message, response.result == 1
    else:
        response = call_service(simulation, service, scenario="forest_search")
        message, done = response.message, response.success
    assert not done
    assert message == (
        'forest_search: slam needs gtsam, global_planner needs ompl: pip install "volery[autonomy]"'
    )
    assert asked == []


@pytest.mark.parametrize("service", ["/volery/load_scenario", "/load_world"])
def test_a_scenario_whose_node_cannot_be_imported_does_not_end_the_flight(
    simulate, flat_data, service, monkeypatch
):
    """A package may be there and broken: its module is found, and its import fails."""
    monkeypatch.setitem(sys.modules, "broken_module", None)
    nodes = [{"node": "broken_module:Node"}]
    given = parse_scenario({**flat_data, "name": "own", "nodes": nodes})
    asked = []
    simulation = simulate(flat_data, on_load=asked.append, shelf=ScenarioCatalog(given=given))
    if service == "/load_world":
        message = call_service(
            simulation, service, world_resource={"uri": "own"}
        ).result.error_message
    else:
        message = call_service(simulation, service, scenario="own").message
    assert message.startswith("own: nodes[0]: ")
    assert "cannot be imported" in message
    assert asked == []


@pytest.mark.parametrize(
    ("world", "where"),
    [
        (
            {"forest": {"kind": "inventory", "file": "gone.csv", "species": "conifer"}},
            "world.forest",
        ),
        ({"terrain": {"kind": "grid", "file": "gone.csv", "spacing_m": 1.0}}, "world.terrain"),
        ({"grid_map": {"maps": [{"file": "gone.csv", "name": "a"}]}}, "world.grid_map.maps"),
        ({"wind": {"field": "gone.csv"}}, "world.wind.field"),
    ],
)
def test_a_scenario_whose_world_file_is_gone_does_not_end_the_flight(
    simulate, flat_data, world, where
):
    given = parse_scenario({**flat_data, "name": "own", "world": world})
    asked = []
    simulation = simulate(flat_data, on_load=asked.append, shelf=ScenarioCatalog(given=given))
    message = call_service(simulation, "/volery/load_scenario", scenario="own").message
    assert message.startswith(f"own: {where}: ")
    assert "gone.csv" in message
    assert asked == []


def test_loading_is_the_owners_business(simulate, flat_data):
    response = call_service(simulate(flat_data), "/volery/load_scenario", scenario="hover")
    assert not response.success
    assert "one scenario" in response.message

    def refuse(request):
        raise CommandError(f"no memory for {request.name}")

    simulation = simulate(flat_data, on_load=refuse)
    response = call_service(simulation, "/volery/load_scenario", scenario="hover")
    assert (response.success, response.message) == (False, "no memory for hover")


def test_many_uavs_with_other_sensors_are_built():
    changes = Changes(uavs=30, airframe="iris", sensors=("sonar", "navigation"))
    scenario = apply(load_scenario("hover"), changes)
    with Simulation(scenario, threads=1) as simulation:
        assert len(simulation.uavs) == 30
        positions = np.array([uav.position_map for uav in simulation.uavs.values()])
        apart = np.linalg.norm(positions[:, None] - positions[None], axis=2) + 10.0 * np.eye(30)
        assert apart.min() > 1.0
        topics = {topic.name for topic in simulation.graph.topics()}
        assert {"/uav30/gnss", "/uav30/range"} & topics
        simulation.run(1.0)
        assert all(uav.airframe.name == "iris" for uav in simulation.uavs.values())
        assert not any(uav.crashed for uav in simulation.uavs.values())


def test_a_thinned_inventory_holds_the_same_trees():
    def forest(fraction):
        scenario = apply(load_scenario("longleaf"), Changes(tree_share=fraction))
        return build_forest(scenario, build_terrain(scenario))

    whole, half, few = forest(1.0), forest(0.5), forest(0.2)
    count = len(whole.position_map)
    assert len(half.position_map) == pytest.approx(0.5 * count, abs=3.0 * np.sqrt(0.25 * count))
    assert len(few.position_map) == pytest.approx(0.2 * count, abs=3.0 * np.sqrt(0.16 * count))

    def trees(of):
        return {
            (*position, dbh)
            for position, dbh in zip(of.position_map.tolist(), of.dbh_m.tolist(), strict=True)
        }

    assert trees(few) < trees(half) < trees(whole)
