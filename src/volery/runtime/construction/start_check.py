"""What a scenario needs to start, checked before anything is built."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from volery.core.errors import DataFileError, GraphError, ScenarioError
from volery.graph.messages import add_definitions
from volery.runtime.construction.fleet import check_types
from volery.runtime.construction.node_loading import check_nodes
from volery.scenario.node_packages import check_packages
from volery.scenario.schema import Scenario


def check_start(scenario: Scenario) -> None:
    """Raises `VoleryError` if a type, package, world file or node's class of a scenario is missing.

    It imports the nodes' modules, and learns the messages that these may import.
    """
    check_types(scenario)
    check_packages(scenario)
    _check_world_files(scenario)
    learn_messages(scenario)
    check_nodes(scenario)


def _check_world_files(scenario: Scenario) -> None:
    for key, name in _files(scenario.world, "world"):
        try:
            scenario.access.find_file(name)
        except DataFileError as error:
            raise DataFileError(f"{scenario.name}: {key}: {error}") from None


def _files(part: Any, key: str) -> Iterator[tuple[str, str]]:
    """Yields the key of each table with a file, and the file's name."""
    if isinstance(part, BaseModel):
        for name, value in part:
            if isinstance(value, str) and (
                name == "file" or (key, name) == ("world.wind", "field")
            ):
                yield (key if name == "file" else f"{key}.{name}"), value
            else:
                yield from _files(value, f"{key}.{name}")
    elif isinstance(part, tuple | list):
        for value in part:
            yield from _files(value, key)


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
