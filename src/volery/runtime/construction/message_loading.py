"""Loads the message packages that a scenario names."""

from __future__ import annotations

from volery.core.errors import DataFileError, GraphError, ScenarioError
from volery.graph.messages import add_definitions
from volery.scenario.schema import Scenario


def learn_messages(scenario: Scenario) -> list[str]:
    """Registers the types of the scenario's message folders and returns their names.

    Folders are searched beside the scenario and in the working folder. Raises `ScenarioError`
    with the key and, for an invalid definition, its file and line.
    """
    learned = []
    for k, name in enumerate(scenario.message_packages):
        where = f"{scenario.name}: message_packages[{k}]"
        try:
            learned += add_definitions(scenario.access.find_folder(name))
        except (DataFileError, GraphError) as error:
            raise ScenarioError(f"{where}: {error}") from None
    return learned
