"""How a node learns what it stands on: a graph, timers, a clock, a namespace, its parameters.

A node of rclpy takes no such arguments: `super().__init__("name")` finds them here, where they are
while `making` a node. One that accepts `context`, or any keyword, is given them as arguments too.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

from volery.graph.graph import Graph
from volery.graph.nodes.timer import Timers


def _allows_every_folder(_folder: str) -> bool:
    return True


@dataclass(frozen=True)
class Context:
    """What a node stands on: a graph, timers, a clock, and the simulated time it takes to think.

    With `latency_ns` above 0 the node's callbacks run on a worker and what they publish is
    released that much later; see `graph.nodes.deferred_execution`.
    """

    graph: Graph
    timers: Timers
    now_ns: Callable[[], int]
    latency_ns: int = 0
    remap: Mapping[str, str] = field(default_factory=dict)
    """Other names for topics and services: absolute name of the node's to that of the graph."""
    allows_folder: Callable[[str], bool] = _allows_every_folder
    """Whether the node may write into a folder of this name."""


@dataclass(frozen=True)
class Launch:
    """What a node is made with."""

    context: Context
    namespace: str
    parameters: Mapping[str, Any]


_present: ContextVar[Launch | None] = ContextVar("volery_node_launch", default=None)


def present_launch() -> Launch | None:
    """With what a node is being made at present; None where none is."""
    return _present.get()


def make_node(node_class: type[Any], launch: Launch) -> Any:
    """Make a node; what its constructor raises is raised."""
    options = {
        "context": launch.context,
        "namespace": launch.namespace,
        "parameter_overrides": launch.parameters,
    }
    token = _present.set(launch)
    try:
        return node_class(**options) if _takes_context(node_class) else node_class()
    finally:
        _present.reset(token)


def _takes_context(node_class: type[Any]) -> bool:
    parameters = inspect.signature(node_class).parameters
    return "context" in parameters or any(p.kind is p.VAR_KEYWORD for p in parameters.values())
