"""Writes the reference of services from running simulations."""

from __future__ import annotations

from collections.abc import Iterator

import graph_survey
from reference_links import message_link

_HEAD = """\
# Services

All services of a simulation with their types, found by building simulations part by part; `uavN`
stands for `uav1`, `uav2`, ... [Services](../services.md) describes how they act,
[messages](messages.md) their requests and responses.

In a run: `volery service list`, `volery service call /uav1/land`.
"""


def page() -> str:
    """Returns the page."""
    return "\n".join(_parts())


def _parts() -> Iterator[str]:
    yield _HEAD
    base = graph_survey.base().services
    standard, own, uavs = (
        {name: kind for name, kind in base.items() if _group(name, kind) == group}
        for group in ("standard", "own", "uav")
    )
    yield "## ROS standard `simulation_interfaces`\n"
    yield _table(standard)
    yield "## Volery's own\n"
    yield _table(own)
    yield "## Every UAV\n"
    yield _table(uavs)
    for name, added in (*graph_survey.worlds(), *graph_survey.sensors()):
        if added.services:
            yield f"## {name}\n"
            yield _table(added.services)
    yield "## Nodes\n"
    for name, _, added in graph_survey.nodes():
        if added.services:
            yield f"### `{name}`\n"
            yield _table(added.services)


def _group(name: str, kind: str) -> str:
    if "uavN" in name:
        return "uav"
    return "standard" if kind.startswith("simulation_interfaces/") else "own"


def _table(services: dict[str, str]) -> str:
    lines = ["| service | type |", "|---|---|"]
    lines += [f"| `{name}` | {message_link(kind)} |" for name, kind in services.items()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(page(), end="")
