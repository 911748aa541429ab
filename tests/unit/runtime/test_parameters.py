"""Parameters of nodes, set in flight."""

from __future__ import annotations

import pytest

from volery.core.errors import GraphError
from volery.runtime.simulation import Simulation
from volery.scenario.changes import Changes, apply
from volery.scenario.load import load_scenario

NODE = "/uav1/gap_following"


def height(simulation):
    return simulation.uavs["uav1"].position_map[2]


def test_a_node_takes_what_is_set_in_flight_and_a_snapshot_keeps_it(simulate, wood_data):
    simulation = simulate(wood_data)
    parameters = simulation.graph.parameters
    assert (NODE, "height_m") in parameters.names()
    simulation.run(6.0)
    low = height(simulation)
    kept = simulation.snapshot()
    simulation.post(lambda: parameters.get(NODE, "height_m").set(low + 2.0))
    simulation.run(4.0)
    assert height(simulation) > low + 1.0
    simulation.restore(kept)
    assert parameters.get(NODE, "height_m").value == 3.0
    simulation.run(4.0)
    assert height(simulation) < low + 0.5


def test_what_a_node_reads_at_its_start_only_cannot_be_set(simulate, wood_data):
    simulation = simulate(wood_data)
    with pytest.raises(GraphError, match="read-only"):
        simulation.graph.parameters.get(NODE, "route").set([[1.0, 1.0]])


def test_a_node_of_the_whole_system_gets_the_names_of_all_uavs():
    with Simulation(apply(load_scenario("coverage"), Changes(uavs=2))) as simulation:
        assert simulation.graph.parameters.get("/coverage", "uavs").value == ["uav1", "uav2"]
