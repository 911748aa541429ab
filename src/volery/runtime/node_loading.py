"""Starts the nodes that a scenario names."""

from __future__ import annotations

import importlib
from typing import Any

from volery.core.errors import GraphError, ScenarioError
from volery.graph.node import Context, Node
from volery.scenario.schema import NodeEntry


def start_node(entry: NodeEntry, context: Context, namespace: str, where: str) -> Node:
    """Import and construct a node. Raises `ScenarioError` naming the key in the scenario."""
    node_class = _find_class(entry.node, where)
    try:
        node: Node = node_class(
            context=context, namespace=namespace, parameter_overrides=entry.parameters
        )
    except (GraphError, TypeError, ValueError) as error:
        raise ScenarioError(f"{where}: node '{entry.node}' does not start: {error}") from error
    unused = node.unused_overrides()
    if unused:
        raise ScenarioError(
            f"{where}: node '{entry.node}' has no parameter {', '.join(unused)}; "
            f"known: {', '.join(node.declared_parameters())}"
        )
    return node


def _find_class(path: str, where: str) -> type[Any]:
    module_name, class_name = path.split(":")
    try:
        found = getattr(importlib.import_module(module_name), class_name)
    except ImportError as error:
        raise ScenarioError(f"{where}: node '{path}' cannot be imported: {error}") from error
    except AttributeError:
        raise ScenarioError(
            f"{where}: module '{module_name}' has no class '{class_name}'"
        ) from None
    if not (isinstance(found, type) and issubclass(found, Node)):
        raise ScenarioError(f"{where}: '{path}' is no subclass of volery.graph.node.Node")
    return found
