"""Provides the contents of the stand-ins for `rclpy` and its modules."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from types import SimpleNamespace
from typing import Any

from volery.core.errors import GraphError
from volery.graph import parameters, qos
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.messages import message_type
from volery.graph.nodes import handles, logger, ros_time
from volery.graph.nodes.node import Node as VoleryNode
from volery.graph.nodes.service_client import Client, Future
from volery.graph.nodes.timer import Timer
from volery.graph.parameter_values import plain_of


class Node(VoleryNode):
    """`rclpy.node.Node`: parameters may be set at run time unless declared read-only.

    Received messages are copies that the node may modify, with sequences that behave as in rclpy.
    """

    settable_parameters = True
    receives_copies = True

    def __init__(self, node_name: str, **options: Any) -> None:
        super().__init__(node_name, **options)
        if not self.has_parameter("use_sim_time"):  # declared from an override
            self.declare_parameter("use_sim_time", True)

    def get_node_names(self) -> list[str]:
        """Returns the names of all nodes, without namespaces."""
        return [name for name, _ in self.get_node_names_and_namespaces()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """Returns names and namespaces of all nodes."""
        parts = [name.rpartition("/") for name in sorted(self._context.graph.parameters.nodes())]
        return [(name, namespace or "/") for namespace, _, name in parts]

    def get_topic_names_and_types(self, no_demangle: bool = False) -> list[tuple[str, list[str]]]:  # noqa: ARG002
        """Returns all topics with their types."""
        return [(topic.name, [topic.msgtype]) for topic in self._context.graph.topics()]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Returns all services with their types."""
        return [(name, [kind]) for name, kind in self._context.graph.services().items()]

    def count_publishers(self, topic_name: str) -> int:
        """Returns the number of publishers of a topic."""
        return self._context.graph.publishers(self.resolve(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        """Returns the number of subscribers to a topic."""
        return self._context.graph.subscribers(self.resolve(topic_name))

    def create_rate(self, *_arguments: Any, **_options: Any) -> Any:
        """Raises `GraphError`: no callback can wait."""
        raise GraphError("a rate waits, and simulated time stands still in a callback: use a timer")

    def create_guard_condition(self, *_arguments: Any, **_options: Any) -> Any:
        """Raises `GraphError`."""
        raise GraphError("Volery has no guard conditions: publish on a topic, or use a timer")


class _Refused:
    """A class of rclpy that Volery lacks."""

    def __init__(self, *_arguments: Any, **_options: Any) -> None:
        raise GraphError(f"Volery has no rclpy {type(self).__name__}; see docs/nodes.md")


class ActionClient(_Refused):
    """Refuses construction."""


class ActionServer(_Refused):
    """Refuses construction."""


class LifecycleNode(_Refused):
    """Refuses construction."""


class AsyncParameterClient(_Refused):
    """Refuses construction."""


class Context(_Refused):
    """Refuses construction."""


class GoalResponse(IntEnum):
    """See `rclpy.action`; an action server is refused."""

    REJECT = 1
    ACCEPT = 2


class CancelResponse(IntEnum):
    """See `rclpy.action`."""

    REJECT = 1
    ACCEPT = 2


class CallbackGroup:
    """A group has no effect: callbacks of a node run one after the other."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """See `rclpy.callback_groups`."""


class ReentrantCallbackGroup(CallbackGroup):
    """See `rclpy.callback_groups`."""


class ExternalShutdownException(Exception):  # noqa: N818  # rclpy's name
    """Never raised: Volery ends nodes by `destroy_node`."""


class ROSInterruptException(Exception):  # noqa: N818
    """Never raised."""


class LivelinessPolicy(StrEnum):
    """Has no effect."""

    AUTOMATIC = "automatic"
    MANUAL_BY_TOPIC = "manual_by_topic"
    SYSTEM_DEFAULT = "system_default"


class _Init:
    """Returned by `rclpy.init()`; a context manager."""

    def __enter__(self) -> _Init:
        return self

    def __exit__(self, *_exception: object) -> None:
        """Does nothing."""


def _init(*_arguments: Any, **_options: Any) -> _Init:
    """Does nothing: Volery is already running."""
    return _Init()


def _shutdown(*_arguments: Any, **_options: Any) -> None:
    """Does nothing: Volery destroys nodes."""


def _ok(*_arguments: Any, **_options: Any) -> bool:
    """Returns True: nodes are running."""
    return True


def _remove_ros_args(args: list[str] | None = None) -> list[str]:
    """Returns arguments without those from `--ros-args` to `--`."""
    import sys

    kept: list[str] = []
    is_ros = False
    for argument in sys.argv if args is None else args:
        if argument in ("--ros-args", "--"):
            is_ros = argument == "--ros-args"
        elif not is_ros:
            kept.append(argument)
    return kept


def _spin(*_arguments: Any, **_options: Any) -> None:
    raise GraphError(
        "Volery spins its nodes: name the class in a scenario or run it with `volery node`, and "
        "wait for a response with add_done_callback instead of spin_until_future_complete"
    )


class Executor:
    """Refuses construction: Volery itself spins its nodes."""

    def __init__(self, *_arguments: Any, **_options: Any) -> None:
        _spin()


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    descriptor = message_type("rcl_interfaces/msg/ParameterDescriptor")
    result = message_type("rcl_interfaces/msg/SetParametersResult")
    policies = {
        "ReliabilityPolicy": qos.ReliabilityPolicy,
        "QoSReliabilityPolicy": qos.ReliabilityPolicy,
        "DurabilityPolicy": qos.DurabilityPolicy,
        "QoSDurabilityPolicy": qos.DurabilityPolicy,
        "HistoryPolicy": qos.HistoryPolicy,
        "QoSHistoryPolicy": qos.HistoryPolicy,
        "LivelinessPolicy": LivelinessPolicy,
        "QoSLivelinessPolicy": LivelinessPolicy,
    }
    profiles = {
        "qos_profile_sensor_data": qos.qos_profile_sensor_data,
        "qos_profile_system_default": qos.QoSProfile(),
        "qos_profile_services_default": qos.QoSProfile(),
        "qos_profile_parameters": qos.QoSProfile(depth=1000),
    }
    presets = SimpleNamespace(
        SENSOR_DATA=SimpleNamespace(value=qos.qos_profile_sensor_data),
        SYSTEM_DEFAULT=SimpleNamespace(value=qos.QoSProfile()),
        SERVICES_DEFAULT=SimpleNamespace(value=qos.QoSProfile()),
        PARAMETERS=SimpleNamespace(value=qos.QoSProfile(depth=1000)),
    )
    spins = ("spin", "spin_once", "spin_until_future_complete")
    return {
        "rclpy": {
            "init": _init,
            "shutdown": _shutdown,
            "try_shutdown": _shutdown,
            "ok": _ok,
            "create_node": Node,
            "Parameter": parameters.ParameterSetting,
            **dict.fromkeys(spins, _spin),
        },
        "rclpy.node": {
            "Node": Node,
            "ParameterDescriptor": descriptor,
            "SetParametersResult": result,
        },
        "rclpy.action": {
            "ActionClient": ActionClient,
            "ActionServer": ActionServer,
            "CancelResponse": CancelResponse,
            "GoalResponse": GoalResponse,
        },
        "rclpy.action.client": {"ActionClient": ActionClient},
        "rclpy.action.server": {"ActionServer": ActionServer, "ServerGoalHandle": object},
        "rclpy.context": {"Context": Context},
        "rclpy.impl": {},
        "rclpy.impl.logging_severity": {"LoggingSeverity": logger.LoggingSeverity},
        "rclpy.lifecycle": {
            "LifecycleNode": LifecycleNode,
            "Node": LifecycleNode,
            "Publisher": handles.NodePublisher,
            "State": object,
            "TransitionCallbackReturn": object,
        },
        "rclpy.parameter_client": {"AsyncParameterClient": AsyncParameterClient},
        "rclpy.serialization": {
            "serialize_message": _serialize,
            "deserialize_message": _deserialize,
        },
        "rclpy.utilities": {
            "ok": _ok,
            "remove_ros_args": _remove_ros_args,
            "shutdown": _shutdown,
            "try_shutdown": _shutdown,
        },
        "rclpy.parameter": {
            "Parameter": parameters.ParameterSetting,
            "parameter_value_to_python": plain_of,
        },
        "rclpy.qos": {
            "QoSProfile": qos.QoSProfile,
            "QoSPresetProfiles": presets,
            **policies,
            **profiles,
        },
        "rclpy.time": {"Time": ros_time.Time, "Duration": ros_time.Duration},
        "rclpy.duration": {"Duration": ros_time.Duration},
        "rclpy.clock": {
            "Clock": ros_time.Clock,
            "ROSClock": ros_time.ROSClock,
            "ClockType": ros_time.ClockType,
        },
        "rclpy.clock_type": {"ClockType": ros_time.ClockType},
        "rclpy.constants": {"S_TO_NS": 10**9},
        "rclpy.logging": {
            "LoggingSeverity": logger.LoggingSeverity,
            "get_logger": _free_logger,
        },
        "rclpy.timer": {"Timer": Timer},
        "rclpy.publisher": {"Publisher": handles.NodePublisher},
        "rclpy.subscription": {"Subscription": handles.NodeSubscription},
        "rclpy.service": {"Service": handles.NodeService},
        "rclpy.client": {"Client": Client},
        "rclpy.task": {"Future": Future},
        "rclpy.callback_groups": {
            "CallbackGroup": CallbackGroup,
            "MutuallyExclusiveCallbackGroup": MutuallyExclusiveCallbackGroup,
            "ReentrantCallbackGroup": ReentrantCallbackGroup,
        },
        "rclpy.executors": {
            "ExternalShutdownException": ExternalShutdownException,
            "Executor": Executor,
            "SingleThreadedExecutor": Executor,
            "MultiThreadedExecutor": Executor,
        },
        "rclpy.exceptions": {
            "ParameterNotDeclaredException": parameters.ParameterNotDeclaredError,
            "ParameterAlreadyDeclaredException": parameters.ParameterAlreadyDeclaredError,
            "InvalidParameterValueException": GraphError,
            "InvalidParameterTypeException": GraphError,
            "ParameterImmutableException": GraphError,
            "ROSInterruptException": ROSInterruptException,
        },
    }


def _serialize(message: Any) -> bytes:
    """Returns a message in CDR."""
    return encode_cdr(message, message.__msgtype__)


def _deserialize(serialized_message: bytes, message_type: Any) -> Any:
    """Returns the message in bytes in CDR."""
    return decode_cdr(serialized_message, message_type.__msgtype__)


def _free_logger(name: str) -> logger.NodeLogger:
    """Returns a logger without node, with wall time and without `/rosout`."""
    import time

    return logger.NodeLogger(name, time.time_ns, None)
