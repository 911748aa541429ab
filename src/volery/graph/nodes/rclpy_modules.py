"""Provides the contents of the stand-ins for `rclpy` and its modules."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import Enum, IntEnum
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


def _refusal(text: str) -> Callable[..., Any]:
    """Returns a function or method that raises `GraphError`."""

    def refuse(*_arguments: Any, **_options: Any) -> Any:
        raise GraphError(text)

    return refuse


_NO_LISTS = "Volery does not list the topics and services of a node: use get_topic_names_and_types"


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

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.destroy_node()

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

    def count_services(self, service_name: str) -> int:
        """Returns the number of servers of a service, 0 or 1."""
        return int(self._context.graph.has_service(self.resolve(service_name)))

    def get_fully_qualified_node_names(self) -> list[str]:
        """Returns the names of all nodes, with namespaces."""
        return sorted(self._context.graph.parameters.nodes())

    def get_node_names_and_namespaces_with_enclaves(self) -> list[tuple[str, str, str]]:
        """Returns names and namespaces of all nodes; all are in the enclave `/`."""
        return [(*found, "/") for found in self.get_node_names_and_namespaces()]

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:  # noqa: ARG002
        """Returns whether there is such a node; simulated time cannot pass meanwhile."""
        return fully_qualified_node_name in self._context.graph.parameters.nodes()

    def get_parameter_types(self, names: list[str]) -> list[Any]:
        """Returns the types of parameters' values."""
        return [self.get_parameter_type(name) for name in names]

    @property
    def publishers(self) -> Iterator[Any]:
        """The node's publishers; that of `/rosout` is the first."""
        return iter(self._handles(handles.NodePublisher))

    @property
    def subscriptions(self) -> Iterator[Any]:
        """The node's subscriptions."""
        return iter(self._handles(handles.NodeSubscription))

    @property
    def services(self) -> Iterator[Any]:
        """The node's services."""
        return iter(self._handles(handles.NodeService))

    @property
    def timers(self) -> Iterator[Any]:
        """The node's timers."""
        return iter(self._handles(Timer))

    @property
    def executor(self) -> None:
        """None: Volery itself spins its nodes."""
        return None

    @property
    def context(self) -> _DefaultContext:
        """The only context."""
        return _CONTEXT

    @property
    def default_callback_group(self) -> CallbackGroup:
        """The group of callbacks without a group."""
        return _DEFAULT_GROUP

    create_rate = _refusal(
        "a rate waits, and simulated time stands still in a callback: use a timer"
    )
    create_guard_condition = _refusal(
        "Volery has no guard conditions: publish on a topic, or use a timer"
    )
    get_publishers_info_by_topic = get_subscriptions_info_by_topic = _refusal(
        "Volery does not describe single publishers and subscriptions: use count_publishers and "
        "count_subscribers"
    )
    get_publisher_names_and_types_by_node = _refusal(_NO_LISTS)
    get_subscriber_names_and_types_by_node = _refusal(_NO_LISTS)
    get_service_names_and_types_by_node = _refusal(_NO_LISTS)
    get_client_names_and_types_by_node = _refusal(_NO_LISTS)
    count_clients = _refusal("Volery does not count the clients of a service")
    add_waitable = _refusal("Volery has no waitables: use a timer or a subscription")
    set_descriptor = _refusal("a descriptor is given to declare_parameter, and stays")


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


class Task(_Refused):
    """Refuses construction."""


class CallbackGroup:
    """A group has no effect: callbacks of a node run one after the other."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """See `rclpy.callback_groups`."""


class ReentrantCallbackGroup(CallbackGroup):
    """See `rclpy.callback_groups`."""


_DEFAULT_GROUP = MutuallyExclusiveCallbackGroup()


class _DefaultContext:
    """`rclpy.utilities.get_default_context()`, which is valid while nodes run."""

    def ok(self) -> bool:
        """Returns True."""
        return True

    def on_shutdown(self, callback: Callable[[], None]) -> None:
        """Does nothing: `destroy_node` is called at the end of a run."""

    def shutdown(self) -> None:
        """Does nothing: Volery destroys nodes."""

    try_shutdown = shutdown


_CONTEXT = _DefaultContext()


def get_default_context(*, shutting_down: bool = False) -> _DefaultContext:  # noqa: ARG001
    """Returns the only context."""
    return _CONTEXT


class SignalHandlerOptions(IntEnum):
    """Has no effect: Volery handles signals."""

    NO = 0
    SIGINT = 1
    SIGTERM = 2
    ALL = 3


class TransitionCallbackReturn(IntEnum):
    """See `rclpy.lifecycle`; a lifecycle node is refused."""

    SUCCESS = 97
    FAILURE = 98
    ERROR = 99


class TimeoutException(Exception):  # noqa: N818
    """Never raised: nothing waits."""


class ShutdownException(Exception):  # noqa: N818
    """Never raised."""


class ExternalShutdownException(Exception):  # noqa: N818  # rclpy's name
    """Never raised: Volery ends nodes by `destroy_node`."""


class ROSInterruptException(Exception):  # noqa: N818
    """Never raised."""


class QoSPolicyKind(IntEnum):
    """Policies of a profile."""

    INVALID = 1
    DURABILITY = 2
    DEADLINE = 4
    LIVELINESS = 8
    RELIABILITY = 16
    HISTORY = 32
    LIFESPAN = 64
    DEPTH = 128
    LIVELINESS_LEASE_DURATION = 256
    AVOID_ROS_NAMESPACE_CONVENTIONS = 512


class QoSPresetProfiles(Enum):
    """Profiles by name; see `rclpy.qos`."""

    SENSOR_DATA = qos.qos_profile_sensor_data
    SYSTEM_DEFAULT = qos.QoSProfile()
    SERVICES_DEFAULT = qos.QoSProfile(reliability=qos.ReliabilityPolicy.RELIABLE)
    PARAMETERS = qos.QoSProfile(depth=1000, reliability=qos.ReliabilityPolicy.RELIABLE)
    ACTION_STATUS_DEFAULT = qos.QoSProfile(
        depth=1,
        reliability=qos.ReliabilityPolicy.RELIABLE,
        durability=qos.DurabilityPolicy.TRANSIENT_LOCAL,
    )
    BEST_AVAILABLE = qos.QoSProfile(
        reliability=qos.ReliabilityPolicy.BEST_AVAILABLE,
        durability=qos.DurabilityPolicy.BEST_AVAILABLE,
    )
    DEFAULT = UNKNOWN = SYSTEM_DEFAULT
    PARAMETER_EVENTS = PARAMETERS

    @classmethod
    def short_keys(cls) -> list[str]:
        """Returns the names in lower case."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> qos.QoSProfile:
        """Returns the profile of a name, whatever its case."""
        return cls[name.upper()].value


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
        "LivelinessPolicy": qos.LivelinessPolicy,
        "QoSLivelinessPolicy": qos.LivelinessPolicy,
    }
    profiles = {
        f"qos_profile_{name.lower()}": preset.value
        for name, preset in QoSPresetProfiles.__members__.items()
    }
    errors = {
        f"{name}Exception": GraphError
        for name in (
            *("InvalidParameter", "InvalidParameterType", "InvalidParameterValue"),
            *("InvalidNamespace", "InvalidNodeName", "InvalidServiceName", "InvalidTopicName"),
            *("NameValidation", "NotInitialized", "Parameter", "ParameterImmutable"),
            *("NoTypeSupportImported",),
        )
    }
    spins = ("spin", "spin_once", "spin_until_future_complete", "get_global_executor")
    return {
        "rclpy": {
            "init": _init,
            "shutdown": _shutdown,
            "try_shutdown": _shutdown,
            "ok": _ok,
            "create_node": Node,
            "get_default_context": get_default_context,
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
        "rclpy.impl.rcutils_logger": {"RcutilsLogger": logger.NodeLogger},
        "rclpy.lifecycle": {
            "LifecycleNode": LifecycleNode,
            "Node": LifecycleNode,
            "Publisher": handles.NodePublisher,
            "State": object,
            "LifecycleState": object,
            "TransitionCallbackReturn": TransitionCallbackReturn,
        },
        "rclpy.parameter_client": {"AsyncParameterClient": AsyncParameterClient},
        "rclpy.serialization": {
            "serialize_message": _serialize,
            "deserialize_message": _deserialize,
        },
        "rclpy.signals": {"SignalHandlerOptions": SignalHandlerOptions},
        "rclpy.wait_for_message": {
            "wait_for_message": _refusal(
                "simulated time stands still in a callback, which cannot wait for a message: "
                "subscribe, and go on in the callback"
            )
        },
        "rclpy.utilities": {
            "get_default_context": get_default_context,
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
            "QoSPolicyKind": QoSPolicyKind,
            "QoSPresetProfiles": QoSPresetProfiles,
            "InvalidQoSProfileException": GraphError,
            **policies,
            **profiles,
        },
        "rclpy.time": {"Time": ros_time.Time, "Duration": ros_time.Duration},
        "rclpy.duration": {"Duration": ros_time.Duration, "Infinite": ros_time.INFINITE},
        "rclpy.clock": {
            "Clock": ros_time.Clock,
            "ROSClock": ros_time.ROSClock,
            "ClockChange": ros_time.ClockChange,
            "ClockType": ros_time.ClockType,
            "Duration": ros_time.Duration,
            "JumpHandle": ros_time.JumpHandle,
            "JumpThreshold": ros_time.JumpThreshold,
            "Time": ros_time.Time,
        },
        "rclpy.clock_type": {"ClockType": ros_time.ClockType},
        "rclpy.constants": {"S_TO_NS": 10**9},
        "rclpy.logging": {
            "LoggingSeverity": logger.LoggingSeverity,
            "get_logger": _free_logger,
            "get_logging_severity_from_string": _severity,
            "set_logger_level": _refusal(
                "Volery has no loggers by name: call get_logger().set_level(..) in the node"
            ),
        },
        "rclpy.timer": {"Timer": Timer},
        "rclpy.publisher": {"Publisher": handles.NodePublisher},
        "rclpy.subscription": {"Subscription": handles.NodeSubscription},
        "rclpy.service": {"Service": handles.NodeService},
        "rclpy.client": {"Client": Client},
        "rclpy.task": {"Future": Future, "Task": Task},
        "rclpy.callback_groups": {
            "CallbackGroup": CallbackGroup,
            "MutuallyExclusiveCallbackGroup": MutuallyExclusiveCallbackGroup,
            "ReentrantCallbackGroup": ReentrantCallbackGroup,
        },
        "rclpy.executors": {
            "ExternalShutdownException": ExternalShutdownException,
            "ShutdownException": ShutdownException,
            "TimeoutException": TimeoutException,
            "Executor": Executor,
            "SingleThreadedExecutor": Executor,
            "MultiThreadedExecutor": Executor,
        },
        "rclpy.exceptions": {
            "ParameterNotDeclaredException": parameters.ParameterNotDeclaredError,
            "ParameterAlreadyDeclaredException": parameters.ParameterAlreadyDeclaredError,
            "ParameterUninitializedException": parameters.ParameterUninitializedError,
            "ROSInterruptException": ROSInterruptException,
            **errors,
        },
    }


def _serialize(message: Any) -> bytes:
    """Returns a message in CDR."""
    return encode_cdr(message, message.__msgtype__)


def _deserialize(serialized_message: bytes, message_type: Any) -> Any:
    """Returns the message in bytes in CDR."""
    return decode_cdr(serialized_message, message_type.__msgtype__)


def _severity(log_severity: str) -> logger.LoggingSeverity:
    """Returns the level of a name, whatever its case."""
    return logger.LoggingSeverity[log_severity.upper()]


def _free_logger(name: str) -> logger.NodeLogger:
    """Returns a logger without node, with wall time and without `/rosout`."""
    import time

    return logger.NodeLogger(name, time.time_ns, None)
