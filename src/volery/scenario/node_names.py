"""Names of nodes: `slam`, registered by an installed package, or `my_package.planning:Planner`.

Packages register their nodes as entry points of the group `volery.nodes`; Volery registers its own
in `pyproject.toml`.
"""

from __future__ import annotations

from volery.core.entry_points import EntryPoints
from volery.core.errors import ScenarioError
from volery.core.near_names import near_miss

NODE_PATTERN = r"^(\w[\w-]*|[\w.]+:\w+)$"
"""Pattern of node names: a registered name or `module:Class`."""

_REGISTERED = EntryPoints("volery.nodes")


def registered_nodes() -> dict[str, str]:
    """Returns the `module:Class` of each registered name, sorted by name."""
    return {name: node_path(name) for name in _REGISTERED.names()}


def node_path(node: str) -> str:
    """Returns a node's `module:Class`. Imports nothing.

    Raises `ScenarioError` for a name that no installed package registers.
    """
    if ":" in node:
        return node
    path = _REGISTERED.find(node)
    if path is None:
        known = _REGISTERED.names()
        hint = near_miss(node, known)
        raise ScenarioError(
            f"no node '{node}'{hint} It is neither module:Class nor one of: {', '.join(known)}"
        )
    return path


def name_of_class(node: type) -> str:
    """Returns the `module:Class` of a class; raises `ValueError` if a module cannot name it."""
    if "." in node.__qualname__:
        raise ValueError(
            f"class {node.__qualname__} is inside a function or a class; a node is a class at the "
            "top level of a module"
        )
    return f"{node.__module__}:{node.__qualname__}"


def is_same_node(one: str, other: str) -> bool:
    """Returns whether two names refer to the same class; False for unknown names."""
    try:
        return node_path(one) == node_path(other)
    except ScenarioError:
        return False


def node_module(node: str) -> str | None:
    """Returns the module of a node, or None for a name that no installed package registers."""
    try:
        return node_path(node).partition(":")[0]
    except ScenarioError:
        return None
