"""Provides the parameter methods of a node, as in rclpy's `Node`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar

from volery.core.errors import GraphError
from volery.graph.messages import message_type
from volery.graph.parameters import (
    Parameter,
    ParameterNotDeclaredError,
    Parameters,
    ParameterSetting,
    ParameterType,
    ParameterUninitializedError,
    Within,
    like_of,
)

OnSet = Callable[[list[ParameterSetting]], Any]
"""Receives the values to set, returns a `SetParametersResult`."""
PreSet = Callable[[list[ParameterSetting]], list[ParameterSetting]]
"""Receives the values to set, returns those to set in their place."""
PostSet = Callable[[list[ParameterSetting]], None]
"""Receives the values that have been set."""


class ParameterMethods:
    """The parameter methods of `Node`.

    By default, a parameter of a class with `settable_parameters` may be set while the node runs, as
    with rclpy; otherwise its value is fixed at the node's start.
    """

    settable_parameters: ClassVar[bool] = False

    def __init__(
        self,
        name: str,
        full_name: str,
        declared: Parameters,
        overrides: Mapping[str, Any] | Iterable[ParameterSetting] | None,
        *,
        before_set: Callable[[], None],
        allow_undeclared: bool,
    ) -> None:
        self.__name, self.__full_name, self.__declared = name, full_name, declared
        if not isinstance(overrides, Mapping):
            overrides = {setting.name: setting.value for setting in overrides or ()}
        self.__overrides = dict(overrides)
        self.__parameters: dict[str, Parameter] = {}
        self.__on_set: list[OnSet] = []
        self.__pre_set: list[PreSet] = []
        self.__post_set: list[PostSet] = []
        self.__before_set = before_set
        self.__allow_undeclared = allow_undeclared
        self.__calls_callbacks = True
        """Whether to call the callbacks for one parameter; False while several are set together."""

    # ---------------------------------------------------------------------------------- declaring

    def declare_parameter(
        self,
        name: str,
        value: Any = None,
        descriptor: Any = None,
        ignore_override: bool = False,
        *,
        read_only: bool | None = None,
        min_value: float | None = None,
        max_value: float = math.inf,
    ) -> Parameter:
        """Declares a parameter; an override given at the start takes precedence over `value`.

        A parameter that is not `read_only` may be set while the node runs; the node then reads
        `Parameter.value` at each use. A number with a `min_value` is finite, and at most
        `max_value`. descriptor: a `ParameterDescriptor`, with description, limits and `read_only`.
        With a `ParameterType` as `value`, only an override gives a value. Raises `GraphError` if
        the value does not fit.
        """
        like = like_of(value) if isinstance(value, ParameterType) else value
        default = None if isinstance(value, ParameterType) else value
        given = self.__overrides.pop(name, default)
        start = default if ignore_override else given
        if read_only is None:
            read_only = not self.settable_parameters if descriptor is None else descriptor.read_only
        if descriptor is not None and descriptor.dynamic_typing:
            like = None
        within = _bounds(descriptor) if min_value is None else Within(min_value, max_value)
        try:
            parameter = Parameter(
                name,
                start,
                like=None if start is None and not isinstance(value, ParameterType) else like,
                within=within,
                read_only=read_only,
                before_set=self.__before_set,
                agrees=self.__call_callbacks,
                after_set=self.__call_after,
                set_with=self.__set_with,
                description="" if descriptor is None else descriptor.description,
            )
            self.__call_callbacks(parameter, start)
        except GraphError as error:
            raise type(error)(f"node {self.__name}: {error}") from None
        self.__declared.declare(self.__full_name, parameter)
        self.__parameters[name] = parameter
        self.__call_after(parameter, parameter.value)
        return parameter

    def declare_parameters(
        self, namespace: str, parameters: Sequence[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Declares tuples (name,), (name, value) or (name, value, descriptor), with a prefix."""
        prefix = f"{namespace}." if namespace else ""
        padded = [(*entry, None, None)[:3] for entry in parameters]
        return [
            self.declare_parameter(f"{prefix}{name}", value, descriptor, ignore_override)
            for name, value, descriptor in padded
        ]

    def declare_overrides(self) -> None:
        """Declares all overrides given at the node's start."""
        for name, value in list(self.__overrides.items()):
            self.declare_parameter(name, value)

    def undeclare_parameter(self, name: str) -> None:
        """Removes a parameter. Raises `GraphError` if it is read-only or not declared."""
        if self.__find(name).read_only:
            raise GraphError(f"node {self.__name}: parameter '{name}' is read-only")
        self.__declared.undeclare(self.__full_name, name)
        del self.__parameters[name]

    # ------------------------------------------------------------------------------------ reading

    def has_parameter(self, name: str) -> bool:
        """Returns whether a parameter is declared."""
        return name in self.__parameters

    def get_parameter(self, name: str) -> Parameter:
        """Returns a parameter.

        Raises `ParameterNotDeclaredError` if it is not declared, `ParameterUninitializedError` if
        it was declared with a type alone and has no value.
        """
        if self.__allow_undeclared and name not in self.__parameters:
            return Parameter(name, None)
        found = self.__find(name)
        if not found.is_initialized:
            raise ParameterUninitializedError(
                f"node {self.__name}: parameter '{name}' is declared without a value: set it in "
                "the scenario"
            )
        return found

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        """Returns parameters in the order of `names`."""
        return [self.get_parameter(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Any = None) -> Any:
        """Returns a declared parameter, or the alternative."""
        if name in self.__parameters and self.__parameters[name].is_initialized:
            return self.__parameters[name]
        return Parameter(name, None) if alternative_value is None else alternative_value

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """Returns parameters named `prefix`.NAME, by NAME."""
        start = f"{prefix}." if prefix else ""
        found = self.__parameters.items()
        return {name[len(start) :]: one for name, one in found if name.startswith(start)}

    def describe_parameter(self, name: str) -> Any:
        """Returns the `rcl_interfaces/msg/ParameterDescriptor` of a parameter."""
        return self.__find(name).describe()

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        """Returns descriptors in the order of `names`."""
        return [self.describe_parameter(name) for name in names]

    def get_parameter_type(self, name: str) -> ParameterType:
        """Returns the type of a parameter's value."""
        return self.__find(name).type_

    def declared_parameters(self) -> list[str]:
        """Returns the names of all declared parameters."""
        return sorted(self.__parameters)

    def unused_overrides(self) -> list[str]:
        """Returns the overrides that no declaration used: most likely misspelt."""
        return [] if self.__allow_undeclared else sorted(self.__overrides)

    # ------------------------------------------------------------------------------------ setting

    def set_parameters(self, parameter_list: Sequence[ParameterSetting]) -> list[Any]:
        """Sets parameters one by one; returns a `SetParametersResult` with a reason for each."""
        return [self.__set([setting]) for setting in parameter_list]

    def set_parameters_atomically(self, parameter_list: Sequence[ParameterSetting]) -> Any:
        """Sets all parameters or none; returns one `SetParametersResult`."""
        return self.__set(parameter_list)

    def add_on_set_parameters_callback(self, callback: OnSet) -> OnSet:
        """Adds a callback that accepts or rejects values before they are set.

        The callback that was added last is called first.
        """
        self.__on_set.insert(0, callback)
        return callback

    def add_pre_set_parameters_callback(self, callback: PreSet) -> PreSet:
        """Adds a callback that may change the values to set, and add others."""
        self.__pre_set.insert(0, callback)
        return callback

    def remove_pre_set_parameters_callback(self, callback: PreSet) -> None:
        """Removes a callback."""
        self.__pre_set.remove(callback)

    def add_post_set_parameters_callback(self, callback: PostSet) -> PostSet:
        """Adds a callback that receives values after they are set or declared."""
        self.__post_set.insert(0, callback)
        return callback

    def remove_post_set_parameters_callback(self, callback: PostSet) -> None:
        """Removes a callback."""
        self.__post_set.remove(callback)

    def remove_on_set_parameters_callback(self, callback: OnSet) -> None:
        """Removes a callback."""
        self.__on_set.remove(callback)

    def __set(self, settings: Sequence[ParameterSetting]) -> Any:
        result = message_type("rcl_interfaces/msg/SetParametersResult")
        for callback in tuple(self.__pre_set):
            settings = callback(list(settings))
        try:
            for setting in settings:
                known = setting.name in self.__parameters
                if not known and not self.__allow_undeclared:
                    self.__find(setting.name)
                if known:
                    self.__parameters[setting.name].check(setting.value)
            self.__consult(settings)
            self.__calls_callbacks = False
            for setting in settings:
                if setting.name in self.__parameters:
                    self.__parameters[setting.name].set(setting.value)
                else:
                    self.declare_parameter(setting.name, setting.value, read_only=False)
        except ParameterNotDeclaredError:
            raise
        except GraphError as error:
            return result(successful=False, reason=str(error))
        finally:
            self.__calls_callbacks = True
        self.__report(settings)
        return result(successful=True)

    def __call_callbacks(self, parameter: Parameter, value: Any) -> None:
        if self.__calls_callbacks:
            self.__consult([ParameterSetting(parameter.name, value=value)])

    def __set_with(self, parameter: Parameter, value: Any) -> bool:
        """Sets a value that comes from outside, with those that callbacks add."""
        if not self.__pre_set or not self.__calls_callbacks:
            return False
        answer = self.__set([ParameterSetting(parameter.name, value=value)])
        if not answer.successful:
            raise GraphError(answer.reason)
        return True

    def __call_after(self, parameter: Parameter, value: Any) -> None:
        if self.__calls_callbacks:
            self.__report([ParameterSetting(parameter.name, value=value)])

    def __report(self, settings: Sequence[ParameterSetting]) -> None:
        for callback in tuple(self.__post_set):
            callback(list(settings))

    def __consult(self, settings: Sequence[ParameterSetting]) -> None:
        for callback in tuple(self.__on_set):
            answer = callback(list(settings))
            if not answer.successful:
                names = ", ".join(setting.name for setting in settings)
                raise GraphError(answer.reason or f"{names}: the node rejected the value")

    def __find(self, name: str) -> Parameter:
        try:
            return self.__parameters[name]
        except KeyError:
            raise ParameterNotDeclaredError(
                f"node {self.__name}: parameter '{name}' is not declared"
            ) from None

    # ---------------------------------------------------------------------------------- snapshots

    def parameter_values(self) -> dict[str, Any]:
        """Returns the values of the settable parameters, by name."""
        return {k: p.value for k, p in self.__parameters.items() if not p.read_only}

    def restore_parameters(self, values: Mapping[str, Any]) -> None:
        """Restores what `parameter_values` returned."""
        for name, value in values.items():
            if name in self.__parameters:
                self.__parameters[name].value = value


def _bounds(descriptor: Any) -> Within | None:
    """Returns the limits in a descriptor."""
    if descriptor is None:
        return None
    for ranges in (descriptor.floating_point_range, descriptor.integer_range):
        if len(ranges):
            return Within(ranges[0].from_value, ranges[0].to_value, ranges[0].step)
    return None
