"""What stood where a log was flown."""

from volery.runtime import Simulation
from volery.runtime.construction.worlds import geometry_of
from volery.scenario.load import parse_scenario


def test_geometry_is_that_of_the_flight(wood_data):
    """The same id as of the simulation, so a browser that has the world need not fetch it again."""
    scenario = parse_scenario(wood_data)
    with Simulation(scenario, threads=1) as simulation:
        assert geometry_of(scenario).id == simulation.geometry.id
