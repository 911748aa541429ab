"""Writes the gallery of shipped scenarios from their files."""

from __future__ import annotations

from collections.abc import Iterator

from volery.scenario import library
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario

_HEAD = """\
# Shipped scenarios

`volery run NAME` flies a scenario, `volery run NAME --page` shows it. Their files are in
`src/volery/scenario/library`, as templates for [your own](../scenarios.md).
"""
_CARDS = "../../src/volery/server/cards"
_FILES = "../../src/volery/scenario/library"


def page() -> str:
    """Returns the page."""
    return "\n".join(_parts())


def _parts() -> Iterator[str]:
    yield _HEAD
    for name in library.names():
        yield from _entry(load_scenario(name))


def _entry(scenario: Scenario) -> Iterator[str]:
    name = scenario.name
    yield f"## {name}\n"
    yield f"![{name}]({_CARDS}/{name}.jpg)\n"
    yield f"{scenario.description} ([file]({_FILES}/{name}.toml))\n"
    yield f"- UAVs: {scenario.uav_count}, {_names(k.airframe for k in scenario.types.values())}"
    yield f"- duration: {scenario.duration_s:g} s"
    kinds = (sensor.kind for kind in scenario.types.values() for sensor in kind.sensors)
    yield f"- sensors: {_names(kinds) or 'none'}"
    yield f"- nodes: {_names(entry.node for entry in scenario.node_entries) or 'none'}\n"


def _names(found: Iterator[str]) -> str:
    return ", ".join(f"`{name}`" for name in dict.fromkeys(found))


if __name__ == "__main__":
    print(page(), end="")
