import pytest

import volery
from volery.runtime.vehicles.uav_table import UavTable, UnknownUavError


def test_an_unknown_name_lists_the_known_ones(scenario_of_two):
    with volery.Simulation(scenario_of_two) as simulation:
        with pytest.raises(UnknownUavError, match="there is no UAV 'x'; known: uav1, uav2"):
            simulation.uavs["x"]
        assert simulation.uavs.get("x") is None
        with pytest.raises(volery.VoleryError, match="uav1 is on the ground already"):
            simulation.uavs["uav1"].land()


def test_an_empty_table_says_so():
    with pytest.raises(KeyError, match="known: none"):
        UavTable()["x"]


@pytest.fixture
def scenario_of_two():
    return volery.load_scenario("hover").with_(uavs=2).with_({"uavs[0].on_start": "wait"})
