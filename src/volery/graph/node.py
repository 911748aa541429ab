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

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, Protocol

from volery.core.errors import GraphError, NodeError, VoleryError
from volery.graph.client import Client
from volery.graph.graph import Graph, Publisher, Subscription, check_period
from volery.graph.messages import Published, message_type
from volery.graph.parameters import Parameter, Within
from volery.graph.qos import DEFAULT_DEPTH, QoSProfile, profile_of
from volery.graph.thinking import Deferring, DelayedPublisher, Thinker
from volery.scenario.access import ScenarioAccess

_log = logging.getLogger(__name__)


class Timers(Deferring, Protocol):
    """Whoever can call back at simulated times."""

    def every(
        self,
        period_s: float,
        callback: Callable[[], None],
        *,
        wanted: Callable[[], bool] | None = None,
    ) -> None:
        """Call `callback` each period, first after one period; not where `wanted()` is false."""


@dataclass(frozen=True)
class Context:
    """What a node stands on: a graph, timers, a clock, and the simulated time it takes to think.

    With `latency_ns` above 0 the node's callbacks run on a worker and what they publish is
    released that much later; see `graph.thinking`.
    """

    graph: Graph
    timers: Timers
    now_ns: Callable[[], int]
    latency_ns: int = 0
    remap: Mapping[str, str] = field(default_factory=dict)
    """Other names for topics and services: absolute name of the node's to that of the graph."""
    access: ScenarioAccess = field(default_factory=ScenarioAccess)
    """What the scenario that names the node may reach."""


class Clock:
    """The node's clock: simulated time."""

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        """Nanoseconds since the start of the run."""
        return self._now_ns()


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
        self._held: list[Callable[[], None]] = []
        """What gives back a publisher, a subscription, a service."""
        self._destroyed = False
        self._busy_s = 0.0
        self._thinker = (
            Thinker(node_name, context.latency_ns, context.timers, context.now_ns)
            if context.latency_ns
            else None
        )
        context.graph.enter(self.full_name)

    # ------------------------------------------------------------------------------ the contract

    @classmethod
    def warm_ups(cls) -> Sequence[Callable[[], None]]:
        """Functions that let the kernels compile that the node calls, each some of them.

        A node with kernels overrides it. The functions are a module's, not made on the spot, and
        call what the node calls, with input made up for it, whose arrays have the types and layouts
        of the real ones. They are called before the clock of a run starts, in any order and maybe
        in another process, for what is compiled later stops the flight; those of Volery's own nodes
        once after an installation, for all is kept on disk, others at each start.
        """
        return ()

    def get_name(self) -> str:
        """Name without namespace."""
        return self._name

    def get_namespace(self) -> str:
        """Namespace, such as `/uav1`."""
        return self._namespace or "/"

    @property
    def full_name(self) -> str:
        """Name with namespace, such as `/uav1/gap_following`."""
        return f"{self._namespace}/{self._name}"

    def get_clock(self) -> Clock:
        """The clock that stamps are compared with."""
        return Clock(self._now_ns)

    def create_publisher(
        self,
        msg_type: type[Any],
        topic: str,
        qos: int | QoSProfile = DEFAULT_DEPTH,
        *,
        latched: bool = False,
    ) -> Publisher:
        """Publish `msg_type` on `topic`; each subscriber decides how messages wait for it.

        `latched`, or durability TRANSIENT_LOCAL, hands the last message to those who subscribe
        later.
        """
        latched = profile_of(qos).latched or latched
        publisher = self._context.graph.advertise(self.resolve(topic), msg_type, latched=latched)
        publisher.owner = self.full_name
        self._held.append(publisher.cancel)
        return publisher if self._thinker is None else DelayedPublisher(publisher, self._thinker)

    def create_subscription(
        self,
        msg_type: type[Any],
        topic: str,
        callback: Callable[[Any], None],
        qos: int | QoSProfile = DEFAULT_DEPTH,
    ) -> Subscription:
        """Call `callback(message)` for each message of `topic`.

        qos: what happens where messages come faster than they are taken, which can only be in a
        process of its own. A depth keeps the newest so many; see `graph.qos.QoSProfile`.
        """
        profile = profile_of(qos)

        name = self.resolve(topic)
        occasion = f"message on {name}"

        def receive(published: Published) -> None:
            self._run(partial(callback, published.message), occasion)

        subscription = self._context.graph.subscribe(name, receive, msg_type, qos=profile)
        self._held.append(subscription.cancel)
        return subscription

    def create_timer(self, period_s: float, callback: Callable[[], None]) -> None:
        """Call `callback` each `period_s` of simulated time."""
        check_period(period_s)
        self._context.timers.every(
            period_s,
            lambda: self._run(callback, "timer", heavy=True),
            wanted=lambda: not self._destroyed,
        )

    def create_service(
        self, srv_type: str, service: str, callback: Callable[[Any, Any], Any]
    ) -> None:
        """Offer a service: `callback(request, response)` returns the response, at once."""
        response_type = message_type(f"{srv_type}_Response")

        def handle(request: Any) -> Any:
            if self._thinker is None:
                return callback(request, _blank(response_type))
            return self._thinker.answer(lambda: callback(request, _blank(response_type)))

        name, graph = self.resolve(service), self._context.graph
        graph.offer(name, srv_type, handle)
        self._held.append(lambda: graph.withdraw(name))

    def create_client(self, srv_type: str, service: str) -> Client:
        """Client of a service of type `srv_type`, e.g. `std_srvs/srv/Trigger`."""
        message_type(f"{srv_type}_Request")
        return Client(self._context.graph, self.resolve(service), srv_type, self._thinker)

    def declare_parameter(
        self,
        name: str,
        default: Any,
        *,
        read_only: bool = True,
        least: float | None = None,
        most: float = math.inf,
    ) -> Parameter:
        """Declare a parameter; an override given at start wins over the default.

        Unless it is `read_only` it may be set while the node runs, which then reads
        `Parameter.value` each time anew. A number with a `least` value is finite, and `most` at
        most. `GraphError` for what does not fit.
        """
        value = self._overrides.pop(name, default)
        within = None if least is None else Within(least, most)
        try:
            parameter = Parameter(
                name, value, like=default, within=within, read_only=read_only, before_set=self.join
            )
        except GraphError as error:
            raise GraphError(f"node {self._name}: {error}") from None
        self._context.graph.parameters.declare(self.full_name, parameter)
        self._parameters[name] = parameter
        return parameter

    def declare_folder(self, name: str, default: str) -> str:
        """Declare a read-only parameter that names a folder of the node's files; its value.

        `NodeError` where the scenario comes from a log or an upload and the folder does not lie
        below the working folder.
        """
        folder = str(self.declare_parameter(name, default).value)
        if not self._context.access.allows_work_folder(folder):
            raise NodeError(
                f"node {self.full_name}: parameter {name}: a scenario of a log or of an upload may "
                "name folders below the working folder only"
            )
        return folder

    def get_parameter(self, name: str) -> Parameter:
        """A declared parameter."""
        try:
            return self._parameters[name]
        except KeyError:
            raise GraphError(f"node {self._name}: parameter '{name}' is not declared") from None

    def destroy_node(self) -> None:
        """Give back what the node holds; nothing of it runs afterwards."""
        self._context.graph.parameters.forget(self.full_name)
        if self._thinker is not None:
            self._thinker.close()
        self._destroyed = True
        while self._held:
            self._held.pop()()

    # ----------------------------------------------------------------------------------- helpers

    def join(self) -> None:
        """Wait until no callback of the node is running."""
        if self._thinker is not None:
            self._thinker.join()

    def _now_ns(self) -> int:
        return self._context.now_ns() if self._thinker is None else self._thinker.now_ns()

    def _run(self, callback: Callable[[], None], occasion: str, *, heavy: bool = False) -> None:
        if self._destroyed:
            return
        if self._thinker is None:
            before = time.thread_time()
            try:
                self._guarded(callback, occasion)
            finally:
                self._busy_s += time.thread_time() - before
        else:
            client = self._context.graph.acting_client
            self._thinker.think(partial(self._guarded, callback, occasion, client), heavy=heavy)

    def _guarded(self, callback: Callable[[], None], occasion: str, client: str = "") -> None:
        """Call back; a failure becomes a `NodeError` that tells whose it was.

        client: the external client that caused it, where this runs later than its command; then
        the failure is logged, and does not end the run.
        """
        try:
            callback()
        except Exception as error:
            if client:
                cause = f"node {self.full_name}: {occasion}, caused by {client}"
                _log.warning("%s, failed", cause, exc_info=error)
                return
            if isinstance(error, VoleryError):
                raise
            at = f"{self._now_ns() / 1e9:.3f} s"
            raise NodeError(
                f"node {self.full_name} failed at {at} in its {occasion}: "
                f"{type(error).__name__}: {error}"
            ) from error

    def resolve(self, name: str) -> str:
        """Absolute name of a topic or service, as the launch profile wants it."""
        if name.startswith("~/"):
            name = f"{self._namespace}/{self._name}/{name[2:]}"
        elif not name.startswith("/"):
            name = f"{self._namespace}/{name}"
        return self._context.remap.get(name, name)

    @property
    def busy_s(self) -> float:
        """CPU time that its callbacks have taken so far."""
        return self._busy_s if self._thinker is None else self._thinker.busy_s

    @property
    def has_worker(self) -> bool:
        """Whether its callbacks run on a thread of its own."""
        return self._thinker is not None

    def unused_overrides(self) -> list[str]:
        """Overrides that no `declare_parameter` asked for: most likely misspelt."""
        return sorted(self._overrides)

    def declared_parameters(self) -> list[str]:
        """Names of all declared parameters."""
        return sorted(self._parameters)

    def parameter_values(self) -> dict[str, Any]:
        """Values of the parameters that may be set while the node runs, by name."""
        return {k: p.value for k, p in self._parameters.items() if not p.read_only}

    def put_back_parameters(self, values: Mapping[str, Any]) -> None:
        """Set what `parameter_values` gave."""
        for name, value in values.items():
            self._parameters[name].value = value


def _blank(response_type: type[Any]) -> Any:
    zero = {"bool": False, "str": "", "int": 0, "float": 0.0}
    names = [f for f in fields(response_type) if not f.name.startswith("__")]
    return response_type(**{f.name: zero.get(str(f.type)) for f in names})
