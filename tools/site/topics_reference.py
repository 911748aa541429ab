"""Writes the reference of topics from running simulations."""

from __future__ import annotations

from collections.abc import Iterator

import graph_survey
from graph_survey import SurveyedTopic
from reference_links import message_link

_HEAD = """\
# Topics

All topics of a simulation with their types, found by building simulations part by part. `uavN`
stands for `uav1`, `uav2`, ..., `NAME` for the name of a sensor or actor in the scenario. Directions
are those of the simulation: it publishes on *out*, it subscribes to *in*. A latched topic sends its
last message to late subscribers. [Conventions](../conventions.md#topics) adds rates and frames.

In a run: `volery topic list --types`, `volery topic echo TOPIC`, `volery topic hz TOPIC`.
"""


def page() -> str:
    """Returns the page."""
    return "\n".join(_parts())


def _parts() -> Iterator[str]:
    yield _HEAD
    yield "## Every simulation\n"
    base = graph_survey.base().topics
    yield _table({name: topic for name, topic in base.items() if "uavN" not in name})
    yield "## Every UAV\n"
    yield _table({name: topic for name, topic in base.items() if "uavN" in name})
    yield "## Sensors\n\nA sensor publishes under its UAV's name.\n"
    for kind, added in graph_survey.sensors():
        yield f"### `{kind}`\n"
        yield _table(added.topics)
    yield "## Features of the world\n"
    for name, added in graph_survey.worlds():
        yield f"### {name}\n"
        yield _table(added.topics)
    yield "## Nodes\n\nEvery node also publishes its log on `/rosout`.\n"
    for name, scenario, added in graph_survey.nodes():
        yield f"### `{name}`\n"
        if scenario:
            yield f"As in the shipped scenario `{scenario}`.\n"
        topics = {name: topic for name, topic in added.topics.items() if name != "/rosout"}
        yield _table(topics, "subscribes", "publishes")


def _table(topics: dict[str, SurveyedTopic], into: str = "in", out: str = "out") -> str:
    lines = ["| topic | type | direction | latched |", "|---|---|---|---|"]
    for name, topic in topics.items():
        ways = [(into, topic.subscribers), (out, topic.publishers)]
        direction = ", ".join(word for word, count in ways if count)
        latched = "yes" if topic.latched and topic.publishers else ""
        lines.append(f"| `{name}` | {message_link(topic.msgtype)} | {direction} | {latched} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(page(), end="")
