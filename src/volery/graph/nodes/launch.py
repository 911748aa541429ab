"""Passes a node its graph, timers, clock, namespace and parameters.

An rclpy node takes no such arguments: `super().__init__("name")` finds them here while `make_node`
constructs it. A node that accepts `context`, or any keyword, also receives them as arguments.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from contextlib import suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from volery.graph.graph import Graph
from volery.graph.nodes.timer import Timers


def _allows_every_folder(_folder: str) -> bool:
    return True


@dataclass(frozen=True)
class Context:
    """A node's environment: graph, timers, clock and computation latency.

    With `latency_ns` above 0, the node's callbacks run on a worker and their publications are
    released that much later; see `graph.nodes.deferred_execution`.
    """

    graph: Graph
    timers: Timers
    now_ns: Callable[[], int]
    latency_ns: int = 0
    remap: Mapping[str, str] = field(default_factory=dict)
    """Remapped topics and services: absolute name in the node to absolute name in the graph."""
    allows_folder: Callable[[str], bool] = _allows_every_folder
    """Returns whether the node may write into a folder of this name."""
    find_file: Callable[[str], Path] = Path
    """Returns the path of a file that the node may read; raises `VoleryError` for others."""


@dataclass(frozen=True)
class Launch:
    """The arguments of a node's constructor."""

    context: Context
    namespace: str
    parameters: Mapping[str, Any]
    begun: list[Callable[[], object]] = field(default_factory=list)
    """Functions that destroy the nodes whose constructors have begun."""


_present: ContextVar[Launch | None] = ContextVar("volery_node_launch", default=None)


def present_launch() -> Launch | None:
    """Returns the launch of the node under construction; None without one."""
    return _present.get()


def make_node(node_class: type[Any], launch: Launch) -> Any:
    """Constructs a node; passes on exceptions of its constructor, of which then nothing stays."""
    options = {
        "context": launch.context,
        "namespace": launch.namespace,
        "parameter_overrides": launch.parameters,
    }
    token = _present.set(launch)
    try:
        return node_class(**options) if _takes_context(node_class) else node_class()
    except BaseException:
        for destroy in launch.begun:
            with suppress(Exception):  # the constructor's own error counts
                destroy()
        raise
    finally:
        _present.reset(token)


def _takes_context(node_class: type[Any]) -> bool:
    parameters = inspect.signature(node_class).parameters
    return "context" in parameters or any(p.kind is p.VAR_KEYWORD for p in parameters.values())
