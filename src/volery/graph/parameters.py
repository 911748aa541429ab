"""Parameters that nodes have declared, by node and name, for who asks from outside.

What is set takes effect when the node reads `Parameter.value` next. A node that reads a value only
once, at its start, declares it read-only, and setting it is refused rather than without effect.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from volery.core.errors import GraphError


class Parameter:
    """A declared parameter and its value.

    like: a value of the kind that it takes, None where it takes any. read_only: whether the value
    that it has at the node's start is for good. before_set: called before another value is set.
    """

    def __init__(
        self,
        name: str,
        value: Any,
        *,
        like: Any = None,
        read_only: bool = True,
        before_set: Callable[[], None] | None = None,
    ) -> None:
        self.name = name
        self.value = value
        self.read_only = read_only
        self._before_set = before_set
        self._like = like

    def set(self, value: Any) -> None:
        """Set another value. `GraphError` if it is read-only, or for a value of another kind."""
        if self.read_only:
            raise GraphError(
                f"parameter '{self.name}' is read-only: its node takes it at its start"
            )
        if not same_kind(value, self._like):
            raise GraphError(f"parameter '{self.name}' must be like {self._like!r}, not {value!r}")
        if self._before_set is not None:
            self._before_set()
        self.value = value


class Parameters:
    """All parameters of the nodes of a graph. Values are set in the simulation's thread alone."""

    def __init__(self) -> None:
        self._nodes: dict[str, dict[str, Parameter]] = {}
        self._present: set[str] = set()
        self._lock = threading.Lock()

    def enter(self, node: str) -> None:
        """Note that there is a node of this full name, whether or not it declares any."""
        with self._lock:
            self._present.add(node)

    def nodes(self) -> set[str]:
        """Full names of all nodes."""
        with self._lock:
            return {*self._present, *self._nodes}

    def declare(self, node: str, parameter: Parameter) -> None:
        """Add a parameter of a node named absolutely. `GraphError` if it has one of that name."""
        with self._lock:
            declared = self._nodes.setdefault(node, {})
            if parameter.name in declared:
                raise GraphError(f"node '{node}' has declared parameter '{parameter.name}' already")
            declared[parameter.name] = parameter

    def forget(self, node: str) -> None:
        """Strike off all parameters of a node that has ended."""
        with self._lock:
            self._nodes.pop(node, None)
            self._present.discard(node)

    def names(self) -> list[tuple[str, str]]:
        """Nodes and names, sorted."""
        with self._lock:
            return sorted((node, name) for node, found in self._nodes.items() for name in found)

    def has_node(self, node: str) -> bool:
        """Whether a node has declared any."""
        return node in self._nodes

    def get(self, node: str, name: str) -> Parameter:
        """A parameter. `GraphError`, with what there is, where there is none such."""
        with self._lock:
            declared = self._nodes.get(node)
            if declared is None:
                raise GraphError(f"no node '{node}' with parameters")
            if name not in declared:
                known = ", ".join(sorted(declared))
                raise GraphError(f"node '{node}' has no parameter '{name}'; it has {known}")
            return declared[name]


def same_kind(value: Any, like: Any) -> bool:
    """Whether a value may stand where `like` does: a whole number may for any number."""
    if like is None:
        return True
    if isinstance(like, bool) or isinstance(value, bool):
        return isinstance(like, bool) and isinstance(value, bool)
    if isinstance(like, float):
        return isinstance(value, int | float)
    return isinstance(value, type(like))
