"""Starts the nodes that a scenario names."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from volery.core.errors import ScenarioError
from volery.graph.node import Context, Node
from volery.scenario.schema import NodeEntry


def start_node(
    entry: NodeEntry, context: Context, namespace: str, where: str, folder: Path | None
) -> Node:
    """Import and construct a node. Raises `ScenarioError` naming the key in the scenario.

    Modules are also looked for in the scenario's `folder` and in the working folder.
    """
    node_class = find_node(entry, where, folder)
    try:
        node: Node = node_class(
            context=context, namespace=namespace, parameter_overrides=entry.parameters
        )
    except Exception as error:
        _check_base(getattr(error, "obj", None), entry, where)
        raise ScenarioError(f"{where}: node '{entry.node}' does not start: {error}") from error
    _check_base(node, entry, where)
    unused = node.unused_overrides()
    if unused:
        raise ScenarioError(
            f"{where}: node '{entry.node}' has no parameter {', '.join(unused)}; "
            f"known: {', '.join(node.declared_parameters())}"
        )
    return node


def _check_base(node: object, entry: NodeEntry, where: str) -> None:
    """`ScenarioError` for a node whose `__init__` does not call that of `Node` first."""
    if isinstance(node, Node) and not hasattr(node, "_context"):
        name = type(node).__name__
        raise ScenarioError(
            f"{where}: node '{entry.node}' does not start: {name}.__init__ does not call the one "
            f'of Node before it does anything else; begin it with: super().__init__("{name.lower()}'
            '", **options)'
        )


def find_node(entry: NodeEntry, where: str, folder: Path | None) -> type[Any]:
    """Import a node's class, as `start_node` does."""
    with _also_from(folder or Path(), Path()):
        return _find_class(entry.node, where)


@contextmanager
def _also_from(*folders: Path) -> Iterator[None]:
    """Let imports find modules in these folders, after the installed ones."""
    added = [str(folder.resolve()) for folder in folders]
    sys.path.extend(added)
    try:
        yield
    finally:
        for folder in added:
            sys.path.remove(folder)


def _find_class(path: str, where: str) -> type[Any]:
    module_name, class_name = path.split(":")
    try:
        module = importlib.import_module(module_name)
    except Exception as error:
        raise ScenarioError(f"{where}: node '{path}' cannot be imported: {error}") from error
    try:
        found = getattr(module, class_name)
    except AttributeError:
        raise ScenarioError(
            f"{where}: module '{module_name}' has no class '{class_name}'"
        ) from None
    if not (isinstance(found, type) and issubclass(found, Node)):
        raise ScenarioError(f"{where}: '{path}' is no subclass of volery.graph.node.Node")
    return found
