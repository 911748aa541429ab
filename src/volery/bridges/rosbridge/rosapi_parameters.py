"""Parameters by rosapi's names: those that nodes declared, and all others.

In ROS 1 names are paths, `/uav1/gap_following/height_m`; in ROS 2 a node and its parameter,
`/uav1/gap_following:height_m`. Both are accepted. Values are JSON text.
"""

from __future__ import annotations

import json
from typing import Any

from volery.bridges.rosbridge.fields import absolute
from volery.core.errors import GraphError
from volery.graph.parameters import Parameter
from volery.graph.parameters import Parameters as Declared

MAX_PARAMETERS = 10_000
MAX_VALUE_LENGTH = 1_000_000
"""Largest number of characters of a parameter's JSON text."""


class Parameters:
    """Parameters that no node declared, by name, each the JSON text of its value."""

    def __init__(self) -> None:
        self._values: dict[str, str] = {"/use_sim_time": "true"}

    def names(self) -> list[str]:
        """Returns all names, sorted."""
        return sorted(self._values)

    def get(self, name: str) -> str | None:
        """Returns a value, or None."""
        return self._values.get(absolute(name))

    def set(self, name: str, value: str) -> None:
        """Sets a value. Raises `GraphError` if there would be too much."""
        if len(value) > MAX_VALUE_LENGTH or len(self._values) >= MAX_PARAMETERS:
            raise GraphError(f"parameter '{name}': too large, or too many parameters")
        self._values[absolute(name)] = value

    def delete(self, name: str) -> None:
        """Removes a parameter. Raises `GraphError` if there is none."""
        if self._values.pop(absolute(name), None) is None:
            raise GraphError(f"no parameter '{name}'")


class NamedParameters:
    """Parameters of nodes and others, with one form of names.

    ros1: whether nodes' parameters are listed as paths.
    """

    def __init__(self, others: Parameters, declared: Declared, *, ros1: bool) -> None:
        self._others = others
        self._declared = declared
        self._between = "/" if ros1 else ":"

    def names(self) -> list[str]:
        """Returns all names, sorted."""
        declared = [f"{node}{self._between}{name}" for node, name in self._declared.names()]
        return sorted([*self._others.names(), *declared])

    def get(self, name: str) -> str | None:
        """Returns a value, or None for an unknown name."""
        try:
            parameter = self._find(name)
        except GraphError:
            return None
        return self._others.get(name) if parameter is None else _text(parameter.value)

    def set(self, name: str, value: str) -> None:
        """Sets a value. Raises `GraphError` if it is no JSON, or its node refuses it."""
        try:
            plain = json.loads(value, parse_constant=_refuse)
        except (ValueError, RecursionError):
            raise GraphError(f"parameter '{name}': the value must be JSON text") from None
        parameter = self._find(name)
        if parameter is None:
            self._others.set(name, value)
        else:
            parameter.set(plain)

    def delete(self, name: str) -> None:
        """Removes a parameter. Raises `GraphError` if there is none, or a node has declared it."""
        if self._find(name) is not None:
            raise GraphError(f"parameter '{name}' is declared by its node")
        self._others.delete(name)

    def _find(self, name: str) -> Parameter | None:
        """Returns the parameter of a node, None for one that no node declared.

        Raises `GraphError` if the named node has no such parameter, because no node would read it.
        """
        full = absolute(name)
        node, colon, last = full.rpartition(":")
        if not colon:
            node, _, last = full.rpartition("/")
            if not self._declared.has_node(node):
                return None
        return self._declared.get(node, last)


def _refuse(word: str) -> None:
    """Refuses NaN and Infinity, which Python would accept."""
    raise ValueError(word)


def _text(value: Any) -> str:
    """Returns the JSON text of a value; numbers without a JSON form are null."""
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        return json.dumps(None)
