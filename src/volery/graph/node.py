"""The node contract: the shape of an rclpy node, run in lock step inside the simulation.

A node is a class with subscriptions, publishers, timers and parameters. It never asks whether it is
in a simulation:

    class Watcher(Node):
        def __init__(self, **options):
            super().__init__("watcher", **options)
            self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
            self.create_subscription(LaserScan, "laser/horizontal/scan", self.on_scan, 5)

Relative names live below the node's namespace (`/uav1`), names that start with `/` are absolute,
names that start with `~/` belong to the node.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, Protocol

from volery.core.errors import GraphError, NodeError, VoleryError
from volery.graph.graph import Graph, Publisher, Subscription, check_period
from volery.graph.messages import Published, message_type


class Timers(Protocol):
    """Whoever can call back at simulated times."""

    def every(self, period_s: float, callback: Callable[[], None]) -> None:
        """Call `callback` each period, first after one period."""


class Context:
    """What a node stands on: a graph, a clock, timers."""

    def __init__(self, graph: Graph, timers: Timers, now_ns: Callable[[], int]) -> None:
        self.graph = graph
        self.timers = timers
        self.now_ns = now_ns


class Clock:
    """The node's clock: simulated time."""

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        """Nanoseconds since the start of the run."""
        return self._now_ns()


class Parameter:
    """A declared parameter and its value."""

    def __init__(self, name: str, value: Any) -> None:
        self.name = name
        self.value = value


class Client:
    """Calls one service."""

    def __init__(self, graph: Graph, service: str) -> None:
        self._graph = graph
        self.service = service

    def service_is_ready(self) -> bool:
        """Whether somebody offers the service."""
        return self._graph.has_service(self.service)

    def call(self, request: Any | None = None) -> Any:
        """Call and return the response; inside the simulation it comes at once."""
        return self._graph.call(self.service, request)


class Node:
    """Base of all nodes. Subclasses accept `**options` and pass them on."""

    def __init__(
        self,
        node_name: str,
        *,
        context: Context,
        namespace: str = "",
        parameter_overrides: Mapping[str, Any] | None = None,
    ) -> None:
        self._name = node_name
        self._namespace = namespace.rstrip("/")
        self._context = context
        self._overrides = dict(parameter_overrides or {})
        self._parameters: dict[str, Parameter] = {}

    # ------------------------------------------------------------------------------ the contract

    def get_name(self) -> str:
        """Name without namespace."""
        return self._name

    def get_namespace(self) -> str:
        """Namespace, such as `/uav1`."""
        return self._namespace or "/"

    def get_clock(self) -> Clock:
        """The clock that stamps are compared with."""
        return Clock(self._context.now_ns)

    def create_publisher(
        self, msg_type: type[Any], topic: str, qos: int = 10, *, latched: bool = False
    ) -> Publisher:
        """Publish `msg_type` on `topic`; `qos` is the queue depth of outside subscribers.

        `latched` hands the last message to those who subscribe later, as rclpy's durability
        TRANSIENT_LOCAL does.
        """
        _check_depth(qos)
        return self._context.graph.advertise(self.resolve(topic), msg_type, latched=latched)

    def create_subscription(
        self, msg_type: type[Any], topic: str, callback: Callable[[Any], None], qos: int = 10
    ) -> Subscription:
        """Call `callback(message)` for each message of `topic`."""
        _check_depth(qos)

        def receive(published: Published) -> None:
            self._guarded(lambda: callback(published.message), f"message on {published.topic}")

        return self._context.graph.subscribe(self.resolve(topic), receive, msg_type)

    def create_timer(self, period_s: float, callback: Callable[[], None]) -> None:
        """Call `callback` each `period_s` of simulated time."""
        check_period(period_s)
        self._context.timers.every(period_s, lambda: self._guarded(callback, "timer"))

    def create_service(
        self, srv_type: str, service: str, callback: Callable[[Any, Any], Any]
    ) -> None:
        """Offer a service: `callback(request, response)` returns the response."""
        response_type = message_type(f"{srv_type}_Response")

        def handle(request: Any) -> Any:
            return callback(request, _blank(response_type))

        self._context.graph.offer(self.resolve(service), srv_type, handle)

    def create_client(self, srv_type: str, service: str) -> Client:
        """Client of a service of type `srv_type`, e.g. `std_srvs/srv/Trigger`."""
        message_type(f"{srv_type}_Request")
        return Client(self._context.graph, self.resolve(service))

    def declare_parameter(self, name: str, default: Any) -> Parameter:
        """Declare a parameter; an override given at start wins over the default."""
        value = self._overrides.pop(name, default)
        if default is not None and not _same_kind(value, default):
            raise GraphError(
                f"node {self._name}: parameter '{name}' must be like {default!r}, not {value!r}"
            )
        parameter = self._parameters[name] = Parameter(name, value)
        return parameter

    def get_parameter(self, name: str) -> Parameter:
        """A declared parameter."""
        try:
            return self._parameters[name]
        except KeyError:
            raise GraphError(f"node {self._name}: parameter '{name}' is not declared") from None

    # ----------------------------------------------------------------------------------- helpers

    def _guarded(self, callback: Callable[[], None], occasion: str) -> None:
        """Call back; a failure becomes a `NodeError` that tells whose it was."""
        try:
            callback()
        except VoleryError:
            raise
        except Exception as error:
            at = f"{self._context.now_ns() / 1e9:.3f} s"
            raise NodeError(
                f"node {self.get_namespace()}/{self._name} failed at {at} in its {occasion}: "
                f"{type(error).__name__}: {error}"
            ) from error

    def resolve(self, name: str) -> str:
        """Absolute name of a topic or service."""
        if name.startswith("/"):
            return name
        if name.startswith("~/"):
            return f"{self._namespace}/{self._name}/{name[2:]}"
        return f"{self._namespace}/{name}"

    def unused_overrides(self) -> list[str]:
        """Overrides that no `declare_parameter` asked for: most likely misspelt."""
        return sorted(self._overrides)

    def declared_parameters(self) -> list[str]:
        """Names of all declared parameters."""
        return sorted(self._parameters)


def _check_depth(qos: int) -> None:
    if qos < 1:
        raise GraphError(f"queue depth must be at least 1, not {qos}")


def _same_kind(value: Any, default: Any) -> bool:
    if isinstance(default, bool) or isinstance(value, bool):
        return isinstance(default, bool) and isinstance(value, bool)
    if isinstance(default, float):
        return isinstance(value, int | float)
    return isinstance(value, type(default))


def _blank(response_type: type[Any]) -> Any:
    zero = {"bool": False, "str": "", "int": 0, "float": 0.0}
    names = [f for f in fields(response_type) if not f.name.startswith("__")]
    return response_type(**{f.name: zero.get(str(f.type)) for f in names})
