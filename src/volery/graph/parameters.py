"""Provides the declared parameters of all nodes, by node and name.

Numbers are finite, in lists and tables too, and lie within the limits of the quantity that the name
indicates (`height_m`: see `core.quantities`) and those that the node declares. A node's own
defaults are not checked against the quantity.

A new value takes effect when the node next reads `Parameter.value`. A node that reads a value only
once, at its start, declares the parameter read-only, so that setting it fails instead of having no
effect.
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
    """Limits of a number; numbers that are not finite are outside."""

    min_value: float
    max_value: float = math.inf
    step: float = 0.0
    """Distance of the allowed numbers from `min_value` on; `max_value` is allowed too. 0: any."""

    def holds(self, value: Any) -> bool:
        """Returns whether a number is within the limits."""
        inside = self.min_value <= value <= self.max_value and value < math.inf
        return bool(inside and (not self.step or value == self.max_value or self._is_step(value)))

    def __str__(self) -> str:
        """Returns the limits for an error message."""
        limits = (
            f"{self.min_value:g} to {self.max_value:g}"
            if self.max_value < math.inf
            else f"{self.min_value:g} or more"
        )
        return f"{limits} in steps of {self.step:g}" if self.step else limits

    def _is_step(self, value: float) -> bool:
        nearest = self.min_value + round((value - self.min_value) / self.step) * self.step
        return math.isclose(nearest, value, rel_tol=1e-9, abs_tol=1e-9 * self.step)


class ParameterNotDeclaredError(GraphError):
    """Raised when a node has no such parameter."""


class ParameterUninitializedError(GraphError):
    """Raised when a parameter was declared with a type, and nothing has given it a value."""


class ParameterAlreadyDeclaredError(GraphError):
    """Raised when a node has declared the parameter already."""


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
        """Returns the type of a value; NOT_SET if ROS 2 has no type for the value."""
        from volery.graph.parameter_values import type_of  # it imports messages

        return cls(type_of(value))

    def check(self, value: Any) -> bool:
        """Returns whether a value is of this type."""
        return self.from_parameter_value(value) is self


_LIKE: dict[ParameterType, Any] = {
    ParameterType.BOOL: False,
    ParameterType.INTEGER: 0,
    ParameterType.DOUBLE: 0.0,
    ParameterType.STRING: "",
}


def like_of(kind: ParameterType) -> Any:
    """Returns an example value of a type, for `Parameter`; elements of lists are not checked."""
    return None if kind is ParameterType.NOT_SET else _LIKE.get(kind, [])


class ParameterSetting:
    """A name with a value, with the interface of `rclpy.parameter.Parameter`.

    Raises `ValueError` if a type is given and the value is of another.
    """

    Type: ClassVar[type[ParameterType]] = ParameterType

    def __init__(self, name: str, type_: ParameterType | None = None, value: Any = None) -> None:
        if type_ is not None and not ParameterType(type_).check(value):
            raise ValueError(f"parameter '{name}': {value!r} is not a {ParameterType(type_).name}")
        self.name = name
        self.value = value

    @property
    def type_(self) -> ParameterType:
        """Type of the value."""
        return ParameterType.from_parameter_value(self.value)

    def get_parameter_value(self) -> Any:
        """Returns the value as a `rcl_interfaces/msg/ParameterValue`."""
        from volery.graph.parameter_values import value_message

        return value_message(self.value)

    def to_parameter_msg(self) -> Any:
        """Returns the parameter as a `rcl_interfaces/msg/Parameter`."""
        from volery.graph.parameter_values import parameter_message

        return parameter_message(self.name, self.value)

    @classmethod
    def from_parameter_msg(cls, message: Any) -> ParameterSetting:
        """Returns the setting in a `rcl_interfaces/msg/Parameter`."""
        from volery.graph.parameter_values import plain_of

        return cls(message.name, value=plain_of(message.value))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.value!r})"


class Parameter(ParameterSetting):
    """A declared parameter and its value.

    like: an example value that determines the accepted kind, None: any. within: limits of a number.
    read_only: whether the value is fixed after the node's start. before_set: called before another
    value is set. agrees: called with a value that fits; raises `GraphError` with the reason if the
    node rejects the value. after_set: called with the value that has been set. set_with: called
    with a value that fits; returns whether it has set it, with others, or raises `GraphError`.
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
        after_set: Callable[[Parameter, Any], None] | None = None,
        set_with: Callable[[Parameter, Any], bool] | None = None,
        description: str = "",
    ) -> None:
        super().__init__(name, value=value)
        self.read_only = read_only
        self.description = description
        self._agrees = agrees
        self._before_set = before_set
        self._after_set = after_set
        self._set_with = set_with
        self._like = like
        self._within = within
        if value is not None:
            self._check(value)
        self.value = self._of_kind(value)

    @property
    def is_initialized(self) -> bool:
        """Whether it has a value, or none was to be given at its declaration."""
        return self.value is not None or self._like is None

    def set(self, value: Any) -> None:
        """Sets the value. Raises `GraphError` if read-only, or if the value does not fit."""
        self.check(value)
        if self._set_with is not None and self._set_with(self, value):
            return
        if self._before_set is not None:
            self._before_set()
        if self._agrees is not None:
            self._agrees(self, value)
        self.value = self._of_kind(value)
        if self._after_set is not None:
            self._after_set(self, self.value)

    def check(self, value: Any) -> None:
        """Raises `GraphError` if the parameter is read-only, or if the value does not fit."""
        if self.read_only:
            raise GraphError(
                f"parameter '{self.name}' is read-only: set it in the scenario before the start"
            )
        self._check(value)

    def describe(self) -> Any:
        """Returns the parameter's `rcl_interfaces/msg/ParameterDescriptor`."""
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
            minimum, maximum, step = self._within
            if not whole or maximum < math.inf:
                number: Any = int if whole else float
                bounds = message_type(f"rcl_interfaces/msg/{kind}")(
                    from_value=number(minimum), to_value=number(maximum), step=number(step)
                )
                getattr(descriptor, "integer_range" if whole else "floating_point_range").append(
                    bounds
                )
        return descriptor

    def _of_kind(self, value: Any) -> Any:
        """Converts an integer to a float if the parameter is a float."""
        return float(value) if isinstance(self._like, float) and value is not None else value

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
    """Holds all parameters of a graph. Values are set in the simulation's thread only."""

    def __init__(self) -> None:
        self._nodes: dict[str, dict[str, Parameter]] = {}
        self._present: set[str] = set()
        self._lock = threading.Lock()

    def enter(self, node: str) -> None:
        """Registers a node by its full name, with or without parameters."""
        with self._lock:
            self._present.add(node)

    def nodes(self) -> set[str]:
        """Returns the full names of all nodes."""
        with self._lock:
            return {*self._present, *self._nodes}

    def declare(self, node: str, parameter: Parameter) -> None:
        """Adds a parameter of a node (full name). Raises `GraphError` if it is declared already."""
        with self._lock:
            declared = self._nodes.setdefault(node, {})
            if parameter.name in declared:
                raise ParameterAlreadyDeclaredError(
                    f"node '{node}' has already declared parameter '{parameter.name}'"
                )
            declared[parameter.name] = parameter

    def undeclare(self, node: str, name: str) -> None:
        """Removes one parameter of a node."""
        with self._lock:
            self._nodes.get(node, {}).pop(name, None)

    def forget(self, node: str) -> None:
        """Removes a destroyed node and its parameters."""
        with self._lock:
            self._nodes.pop(node, None)
            self._present.discard(node)

    def names(self) -> list[tuple[str, str]]:
        """Returns all (node, name) pairs, sorted."""
        with self._lock:
            return sorted((node, name) for node, found in self._nodes.items() for name in found)

    def has_node(self, node: str) -> bool:
        """Returns whether a node has declared parameters."""
        return node in self._nodes

    def get(self, node: str, name: str) -> Parameter:
        """Returns a parameter. Raises `GraphError`, with the known names, if it does not exist."""
        with self._lock:
            declared = self._nodes.get(node)
            if declared is None:
                raise GraphError(f"no node '{node}' has parameters")
            if name not in declared:
                known = ", ".join(sorted(declared))
                raise GraphError(f"node '{node}' has no parameter '{name}'; known: {known}")
            return declared[name]


def same_kind(value: Any, like: Any) -> bool:
    """Returns whether a value is of the kind of `like`; an integer is also a float."""
    if like is None:
        return True
    if isinstance(like, bool) or isinstance(value, bool):
        return isinstance(like, bool) and isinstance(value, bool)
    if isinstance(like, float):
        return isinstance(value, int | float)
    return isinstance(value, type(like))
