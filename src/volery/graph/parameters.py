"""Parameters that nodes have declared, by node and name, for who asks from outside.

Numbers are finite, in lists and tables too, and lie within the bounds of the quantity that the name
tells (`height_m`: see `core.quantities`), besides those that the node declares. A node's own
defaults are its author's business.

What is set takes effect when the node reads `Parameter.value` next. A node that reads a value only
once, at its start, declares it read-only, and setting it is refused rather than without effect.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from enum import IntEnum
from typing import Any, ClassVar, NamedTuple

from volery.core.errors import GraphError
from volery.core.quantities import fault_in


class Within(NamedTuple):
    """Bounds of a number; whatever is not finite lies outside."""

    min_value: float
    max_value: float = math.inf

    def holds(self, value: Any) -> bool:
        """Whether a number lies within."""
        return bool(self.min_value <= value <= self.max_value and value < math.inf)

    def __str__(self) -> str:
        """As an error tells it."""
        return (
            f"{self.min_value:g} to {self.max_value:g}"
            if self.max_value < math.inf
            else f"{self.min_value:g} or more"
        )


class ParameterNotDeclaredError(GraphError):
    """A node has no such parameter."""


class ParameterAlreadyDeclaredError(GraphError):
    """A node has declared that parameter before."""


class ParameterType(IntEnum):
    """Types of values, numbered as in `rcl_interfaces/msg/ParameterType`."""

    NOT_SET = 0
    BOOL = 1
    INTEGER = 2
    DOUBLE = 3
    STRING = 4
    BYTE_ARRAY = 5
    BOOL_ARRAY = 6
    INTEGER_ARRAY = 7
    DOUBLE_ARRAY = 8
    STRING_ARRAY = 9

    @classmethod
    def from_parameter_value(cls, value: Any) -> ParameterType:
        """Type of a value; NOT_SET for what ROS 2 has no type for."""
        from volery.graph.parameter_values import type_of  # it is built upon messages

        return cls(type_of(value))

    def check(self, value: Any) -> bool:
        """Whether a value is of this type."""
        return self.from_parameter_value(value) is self


_LIKE: dict[ParameterType, Any] = {
    ParameterType.BOOL: False,
    ParameterType.INTEGER: 0,
    ParameterType.DOUBLE: 0.0,
    ParameterType.STRING: "",
}


def like_of(kind: ParameterType) -> Any:
    """A value of a type, for `Parameter`; lists are not looked into."""
    return None if kind is ParameterType.NOT_SET else _LIKE.get(kind, [])


class ParameterSetting:
    """A name with a value, in the shape of `rclpy.parameter.Parameter`.

    `ValueError` where a type is given and the value is not of it.
    """

    Type: ClassVar[type[ParameterType]] = ParameterType

    def __init__(self, name: str, type_: ParameterType | None = None, value: Any = None) -> None:
        if type_ is not None and not ParameterType(type_).check(value):
            raise ValueError(f"parameter '{name}': {value!r} is no {ParameterType(type_).name}")
        self.name = name
        self.value = value

    @property
    def type_(self) -> ParameterType:
        """Type of the value."""
        return ParameterType.from_parameter_value(self.value)

    def get_parameter_value(self) -> Any:
        """`rcl_interfaces/msg/ParameterValue`, as of `.double_value`."""
        from volery.graph.parameter_values import value_message

        return value_message(self.value)

    def to_parameter_msg(self) -> Any:
        """`rcl_interfaces/msg/Parameter`."""
        from volery.graph.parameter_values import parameter_message

        return parameter_message(self.name, self.value)

    @classmethod
    def from_parameter_msg(cls, message: Any) -> ParameterSetting:
        """Name and value of a `rcl_interfaces/msg/Parameter`."""
        from volery.graph.parameter_values import plain_of

        return cls(message.name, value=plain_of(message.value))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.value!r})"


class Parameter(ParameterSetting):
    """A declared parameter and its value.

    like: a value of the kind that it takes, None where it takes any. within: bounds of a number.
    read_only: whether the value that it has at the node's start is for good. before_set: called
    before another value is set. agrees: called with a value that fits, raises `GraphError` with the
    reason where the node does not take it.
    """

    def __init__(
        self,
        name: str,
        value: Any,
        *,
        like: Any = None,
        within: Within | None = None,
        read_only: bool = True,
        before_set: Callable[[], None] | None = None,
        agrees: Callable[[Parameter, Any], None] | None = None,
        description: str = "",
    ) -> None:
        super().__init__(name, value=value)
        self.read_only = read_only
        self.description = description
        self._agrees = agrees
        self._before_set = before_set
        self._like = like
        self._within = within
        self._check(value)
        self.value = self._of_kind(value)

    def set(self, value: Any) -> None:
        """Set another value. `GraphError` if it is read-only, or for a value that does not fit."""
        self.check(value)
        if self._before_set is not None:
            self._before_set()
        if self._agrees is not None:
            self._agrees(self, value)
        self.value = self._of_kind(value)

    def check(self, value: Any) -> None:
        """`GraphError` if it is read-only, or for a value that does not fit."""
        if self.read_only:
            raise GraphError(
                f"parameter '{self.name}' is read-only: its node takes it at its start"
            )
        self._check(value)

    def describe(self) -> Any:
        """`rcl_interfaces/msg/ParameterDescriptor`."""
        from volery.graph.messages import message_type

        descriptor = message_type("rcl_interfaces/msg/ParameterDescriptor")(
            name=self.name,
            type=int(self.type_),
            description=self.description,
            read_only=self.read_only,
            dynamic_typing=self._like is None,
        )
        if self._within is not None:
            whole = self.type_ is ParameterType.INTEGER
            kind = "IntegerRange" if whole else "FloatingPointRange"
            least, most = self._within
            if not whole or most < math.inf:
                limits = (int(least), int(most)) if whole else (float(least), float(most))
                bounds = message_type(f"rcl_interfaces/msg/{kind}")(
                    from_value=limits[0], to_value=limits[1]
                )
                getattr(descriptor, "integer_range" if whole else "floating_point_range").append(
                    bounds
                )
        return descriptor

    def _of_kind(self, value: Any) -> Any:
        """A whole number as a float where the parameter is one."""
        return float(value) if isinstance(self._like, float) else value

    def _check(self, value: Any) -> None:
        if not same_kind(value, self._like):
            raise GraphError(f"parameter '{self.name}' must be like {self._like!r}, not {value!r}")
        if self._within is not None and not self._within.holds(value):
            raise GraphError(f"parameter '{self.name}' must be {self._within}, not {value!r}")
        if value is self._like:
            return  # the node's own default, such as an infinity for "no limit"
        fault = fault_in(self.name, value)
        if fault is not None:
            raise GraphError(f"parameter '{self.name}': {fault}")


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
                raise ParameterAlreadyDeclaredError(
                    f"node '{node}' has declared parameter '{parameter.name}' already"
                )
            declared[parameter.name] = parameter

    def undeclare(self, node: str, name: str) -> None:
        """Strike off one parameter of a node."""
        with self._lock:
            self._nodes.get(node, {}).pop(name, None)

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
