"""Publishes the scenario of a flight for logs, and restores it from a log."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path

from volery.bridges.logs.recorded_flight import ORIGIN_TOPIC, RecordedScenario
from volery.core.errors import ScenarioError
from volery.graph.graph import Graph
from volery.graph.messages import String
from volery.scenario.access import ScenarioAccess
from volery.scenario.file_names import texts_of
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario


def publish_origin(graph: Graph, scenario: Scenario) -> None:
    """Publishes the scenario on `/volery/scenario`, latched: the first message of every log."""
    publisher = graph.advertise(ORIGIN_TOPIC, String, latched=True)
    publisher.publish(String(origin_of_scenario(scenario).to_json()))


def origin_of_scenario(scenario: Scenario) -> RecordedScenario:
    """Returns the record of a scenario for a log."""
    content = scenario.model_dump(exclude_unset=True)
    return RecordedScenario(scenario.name, scenario.seed, _version(), content)


@cache
def _version() -> str:
    """Returns the version of Volery; finding it takes a millisecond, much of a short run."""
    return version("volery")


def scenario_of(
    origin: RecordedScenario, own: Scenario | None = None, *, folder: Path | None = None
) -> Scenario:
    """Returns the scenario of a log.

    The log may come from another user, so the scenario is confined: it reads files only below
    `folder`, that of the log, and among shipped data, and starts shipped nodes only. `own` is the
    user's own scenario of that name: the log's one then reads below the folder of `own`, and may
    use the files and nodes that `own` names with the permissions of `own`.

    Raises `ScenarioError` if `own` has another name, or the log's content is invalid.
    """
    if own is not None and own.name != origin.name:
        raise ScenarioError(f"the log is of a flight of '{origin.name}', not of '{own.name}'")
    access = ScenarioAccess(folder, is_confined=True, is_trusted=False)
    if own is not None:
        access = _lent(own)
    where = f"the log's scenario '{origin.name[:80]}'"
    return parse_scenario(origin.content, where=where, access=access)


def _lent(own: Scenario) -> ScenarioAccess:
    """Returns the access of a log's scenario for a user who has it as an own scenario."""
    access = own.access
    if access.is_confined:
        return access
    return replace(
        access,
        is_confined=True,
        own_names=frozenset(texts_of(own.model_dump(exclude_unset=True))),
        own_nodes=frozenset(entry.node for entry in own.node_entries),
    )
