"""Which scenario a log's flight was of: told by the simulation, and made into a scenario again."""

from __future__ import annotations

from importlib.metadata import version

from volery.bridges.logs.flights import ORIGIN_TOPIC, Origin
from volery.core.errors import ScenarioError
from volery.graph.graph import Graph
from volery.graph.messages import String
from volery.scenario import library
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import Scenario


def tell_origin(graph: Graph, scenario: Scenario) -> None:
    """Publish what is flown on `/volery/scenario`, latched: the first message of every log."""
    publisher = graph.advertise(ORIGIN_TOPIC, String, latched=True)
    publisher.publish(String(origin_of_scenario(scenario).to_json()))


def origin_of_scenario(scenario: Scenario) -> Origin:
    """What a log is told of a scenario."""
    content = scenario.model_dump(exclude_unset=True)
    shipped = library.path_of(scenario.name)
    folder = scenario.folder
    if shipped is not None and folder == shipped.parent:
        folder = None
    return Origin(scenario.name, scenario.seed, version("volery"), content, folder)


def scenario_of(origin: Origin, name_or_path: str | None = None) -> Scenario:
    """The scenario that a log tells of, its files beside the one that is called `name_or_path`.

    Raises `ScenarioError` where that is another scenario, or the log's content is none.
    """
    folder = origin.folder
    if name_or_path is not None and name_or_path != origin.name:
        given = load_scenario(name_or_path)
        if given.name != origin.name:
            raise ScenarioError(f"the log is of a flight of '{origin.name}', not of '{given.name}'")
        folder = given.folder
    elif folder is None and (shipped := library.path_of(origin.name)) is not None:
        folder = shipped.parent
    scenario = parse_scenario(origin.content, where=f"the log's scenario '{origin.name}'")
    scenario._folder = folder
    return scenario
