"""Message packages that a scenario names."""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import GraphError, ScenarioError
from volery.graph.messages import add_definitions
from volery.scenario.schema import Scenario


def learn_messages(scenario: Scenario) -> list[str]:
    """Make the types of the scenario's message folders known; their names.

    Folders are looked for beside the scenario and in the working folder. `ScenarioError` names the
    key and, for a broken definition, its file and line.
    """
    learned = []
    for k, name in enumerate(scenario.messages):
        where = f"{scenario.name}: messages[{k}]"
        places = [(scenario.folder or Path()) / name, Path(name)]
        folder = next((place for place in places if place.is_dir()), None)
        if folder is None:
            looked = ", ".join(dict.fromkeys(str(place.parent.resolve()) for place in places))
            raise ScenarioError(f"{where}: there is no folder '{name}' (looked in {looked})")
        try:
            learned += add_definitions(folder)
        except GraphError as error:
            raise ScenarioError(f"{where}: {error}") from None
    return learned
