"""Provides `Node`: an rclpy node's interface, run in lock step inside the simulation.

A node is a class with subscriptions, publishers, timers and parameters. The same class runs in and
outside of a simulation:

    class Watcher(Node):
        def __init__(self):
            super().__init__("watcher")
            self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
            self.create_subscription(LaserScan, "laser/horizontal/scan", self.on_scan, 5)

Relative names resolve in the node's namespace (`/uav1`), names that start with `/` are absolute,
names that start with `~/` are private to the node. Without a sourced ROS, the class may be imported
as `rclpy.node.Node`: see `graph.nodes.imports`.
"""

from __future__ import annotations

import logging
import pkgutil
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from volery.core.errors import FAILURES, GraphError, NodeError, VoleryError
from volery.graph.graph import check_period
from volery.graph.message_copies import copy_message, receive_message
from volery.graph.messages import Published, message_type
from volery.graph.nodes.coroutines import advance, is_coroutine, result_of
from volery.graph.nodes.deferred_execution import DeferredExecutor
from volery.graph.nodes.failures import add_frames, location_of
from volery.graph.nodes.handles import (
    NodeEndpoints,
    NodePublisher,
    NodeService,
    NodeSubscription,
)
from volery.graph.nodes.launch import Context, present_launch
from volery.graph.nodes.logger import LOG_TYPE, ROSOUT, NodeLogger
from volery.graph.nodes.parameter_methods import ParameterMethods
from volery.graph.nodes.ros_time import Clock
from volery.graph.nodes.service_client import Client
from volery.graph.nodes.timer import Timer, Timers
from volery.graph.parameters import ParameterSetting
from volery.graph.qos import DEFAULT_DEPTH, QoSProfile, profile_of
from volery.graph.topics import Subscription

__all__ = ["Clock", "Context", "Node", "Timers"]

_log = logging.getLogger(__name__)


class Node(ParameterMethods):
    """Base class of all nodes.

    The launch provides `context`, `namespace` and `parameter_overrides`, which need not be passed
    on; the other arguments are those of rclpy. Only `enable_rosout`, `allow_undeclared_parameters`
    and `automatically_declare_parameters_from_overrides` have an effect.
    """

    receives_copies: ClassVar[bool] = False
    """Whether received messages are copies with the sequences of rclpy (`number_sequence`); else
    they hold shared, read-only numpy arrays."""
    WARMUP_TASKS: ClassVar[tuple[str, ...]] = ()
    """Functions that compile the node's numba code, as `module:function`; see `warmup_tasks`."""

    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        namespace: str | None = None,
        parameter_overrides: Mapping[str, Any] | Iterable[ParameterSetting] | None = None,
        cli_args: Sequence[str] | None = None,  # noqa: ARG002
        use_global_arguments: bool = True,  # noqa: ARG002
        enable_rosout: bool = True,
        start_parameter_services: bool = True,  # noqa: ARG002
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        **_options: Any,
    ) -> None:
        launch = present_launch()
        if context is None:
            if launch is None:
                raise GraphError(
                    f"node {node_name}: it has no context; name its class in a scenario, run it "
                    "with `volery node`, or pass a context"
                )
            context, namespace = launch.context, launch.namespace or namespace
            parameter_overrides = _joined(parameter_overrides, launch.parameters)
        self._context = context
        self.__name = node_name
        self.__namespace = ("/" + namespace.strip("/")).rstrip("/") if namespace else ""
        self.__handles: dict[Any, Callable[[], None]] = {}
        """Handles that the node has created, and the functions that release them."""
        self.__timers: list[Timer] = []
        self.__destroyed = False
        self.__busy_s = 0.0
        self.__last_client = ""
        """External client and topic of the last message that a client caused."""
        self.__executor = (
            DeferredExecutor(node_name, context.latency_ns, context.timers, context.now_ns)
            if context.latency_ns
            else None
        )
        if launch is not None:
            launch.begun.append(partial(Node.destroy_node, self))
        super().__init__(
            node_name,
            self.full_name,
            context.graph.parameters,
            parameter_overrides,
            before_set=self.join,
            allow_undeclared=allow_undeclared_parameters,
        )
        context.graph.enter(self.full_name)
        publish = None
        if enable_rosout:
            publish = self.create_publisher(message_type(LOG_TYPE), ROSOUT, latched=True).publish
        self.__logger = NodeLogger(self.full_name[1:].replace("/", "."), self.__now_ns, publish)
        if automatically_declare_parameters_from_overrides:
            self.declare_overrides()

    # ------------------------------------------------------------------------------ the contract

    def endpoints(self) -> NodeEndpoints:
        """Returns the topics and services that the node uses."""
        return NodeEndpoints(
            frozenset(handle.topic for handle in self._handles(NodePublisher)),
            frozenset(handle.topic for handle in self._handles(NodeSubscription)),
            frozenset(handle.srv_name for handle in self._handles(NodeService)),
            frozenset(handle.service for handle in self._handles(Client)),
        )

    @classmethod
    def warmup_tasks(cls) -> Sequence[Callable[[], None]]:
        """Returns functions that compile the numba code that the node calls, each a part of it.

        A node with numba code names them in `WARMUP_TASKS`. The functions call the node's kernels
        with synthetic input whose arrays have the types and layouts of the real ones. They run
        before the clock of a run starts, in any order and possibly in another process, because
        later compilation would stall the flight. Those of Volery's own nodes run once after an
        installation, because the result is cached on disk; others run at each start.
        """
        return tuple(map(pkgutil.resolve_name, cls.WARMUP_TASKS))

    def get_name(self) -> str:
        """Returns the name without namespace."""
        return self.__name

    def get_namespace(self) -> str:
        """Returns the namespace, such as `/uav1`."""
        return self.__namespace or "/"

    @property
    def full_name(self) -> str:
        """Name with namespace, such as `/uav1/gap_following`."""
        return f"{self.__namespace}/{self.__name}"

    def get_fully_qualified_name(self) -> str:
        """Returns the name with namespace, such as `/uav1/gap_following`."""
        return self.full_name

    def get_clock(self) -> Clock:
        """Returns the clock, to compare with the stamps of messages."""
        return Clock(self.__now_ns)

    def get_logger(self) -> NodeLogger:
        """Returns the node's logger."""
        return self.__logger

    def create_publisher(
        self,
        msg_type: type[Any],
        topic: str,
        qos_profile: int | QoSProfile = DEFAULT_DEPTH,
        *,
        latched: bool = False,
        **_options: Any,
    ) -> NodePublisher:
        """Creates a publisher of `msg_type` on `topic`; subscribers choose their queue depth.

        `latched`, or durability TRANSIENT_LOCAL: later subscribers receive the last message.
        """
        profile = profile_of(qos_profile)
        latched = profile.latched or latched
        publisher = self._context.graph.advertise(
            self.resolve(topic), msg_type, latched=latched, local=True
        )
        publisher.owner = self.full_name
        handle = NodePublisher(publisher, self.__executor, profile)
        self.__handles[handle] = handle.cancel
        return handle

    def create_subscription(
        self,
        msg_type: type[Any],
        topic: str,
        callback: Callable[[Any], Any],
        qos_profile: int | QoSProfile = DEFAULT_DEPTH,
        *,
        moves: Sequence[str] = (),
        raw: bool = False,
        passive: bool = False,
        **_options: Any,
    ) -> NodeSubscription:
        """Calls `callback(message)` for each message of `topic`.

        A callback with two required arguments also receives a dict with the times of publication
        and arrival, as in rclpy.

        raw: passes the message's bytes in CDR.

        passive: the callback only updates what the node knows; it publishes, logs, calls and starts
        nothing (publishing and calling raise `GraphError`). The machines of a divided run then need
        not wait for each other at its messages. Without effect for a node with a latency.

        qos_profile: has an effect where messages arrive faster than the node processes them, which
        is possible only in a process of its own. A depth keeps that many of the newest; see
        `graph.qos.QoSProfile`.

        moves: UAVs that the messages move, if their names are not in that of the topic; operators
        who do not control them cannot publish on it.
        """
        name, graph, profile = self.resolve(topic), self._context.graph, profile_of(qos_profile)
        handle = NodeSubscription(name, msg_type, callback, profile, lambda: graph.publishers(name))
        occasion = f"message on {name}{_name_of(callback)}"

        def receive(published: Published) -> None:
            client = graph.acting_client
            if client:
                self.__last_client = f"{client} on {name}"
            received = published.cdr if raw else self.__received(published.message)
            call = partial(handle.call, received, published.time_ns, self.__now_ns())
            self.__run(call, occasion)

        subscription: Subscription = graph.subscribe(
            name, receive, msg_type, qos=profile, passive=passive and self.__executor is None
        )
        handle.attach(subscription)
        self.__handles[handle] = handle.cancel
        if moves:
            self.__declare_moves(name, moves)
        return handle

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], Any],
        callback_group: Any = None,  # noqa: ARG002
        clock: Any = None,  # noqa: ARG002
        autostart: bool = True,
    ) -> Timer:
        """Calls `callback` every `timer_period_sec` of simulated time."""
        check_period(timer_period_sec)
        occasion = f"timer{_name_of(callback)}"
        timer = Timer(
            timer_period_sec,
            callback,
            lambda: self.__run(timer.callback, occasion, heavy=True),
            self._context.timers,
            self.__now_ns,
            self.__defer,
            autostart=autostart,
            clock=self.get_clock(),
        )
        self.__handles[timer] = timer.destroy
        self.__timers.append(timer)
        return timer

    def create_service(
        self,
        srv_type: str | type[Any],
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        moves: Sequence[str] | None = None,
        **_options: Any,
    ) -> NodeService:
        """Creates a service: `callback(request, response)` returns the response, at once.

        srv_type: a class such as `std_srvs.srv.Trigger`, or its name, `std_srvs/srv/Trigger`.

        moves: UAVs that the service moves, by default the one in whose namespace the node is;
        operators who do not control them cannot call it.
        """
        kind, name, graph = service_type(srv_type), self.resolve(srv_name), self._context.graph
        response_type = message_type(f"{kind}_Response")
        occasion = f"service {name}{_name_of(callback)}"

        def respond(request: Any) -> Any:
            response = self.__guarded_service(
                lambda: callback(self.__received(request), response_type()), occasion, response_type
            )
            try:
                return copy_message(response)
            except GraphError as error:
                raise self.__failure(error, occasion) from None

        def handle(request: Any) -> Any:
            if self.__executor is None:
                return respond(request)
            return self.__executor.call(lambda: respond(request))

        graph.create_service(name, kind, handle)
        service = NodeService(name, kind, lambda: graph.destroy_service(name))
        self.__handles[service] = service.destroy
        own = [self.__namespace.split("/")[1]] if self.__namespace else []
        self.__declare_moves(name, own if moves is None else moves)
        return service

    def create_client(self, srv_type: str | type[Any], srv_name: str, **_options: Any) -> Client:
        """Creates a client of a service; `srv_type` is as for `create_service`."""
        kind = service_type(srv_type)
        message_type(f"{kind}_Request")
        client = Client(
            self._context.graph,
            self.resolve(srv_name),
            kind,
            self.__executor,
            later=self.__later,
            run=self.__run,
            receive=self.__received,
        )
        self.__handles[client] = client.destroy
        return client

    def destroy_publisher(self, publisher: NodePublisher) -> bool:
        """Destroys a publisher; returns whether it belonged to the node."""
        return self.__release(publisher)

    def destroy_subscription(self, subscription: NodeSubscription) -> bool:
        """Destroys a subscription; returns whether it belonged to the node."""
        return self.__release(subscription)

    def declare_folder(self, name: str, default: str) -> str:
        """Declares a read-only parameter that names a folder; returns its value.

        Raises `NodeError` if the scenario comes from a log or an upload and the folder is not below
        the working folder.
        """
        folder = str(self.declare_parameter(name, default).value)
        if not self._context.allows_folder(folder):
            raise NodeError(
                f"node {self.full_name}: parameter {name}: a scenario from a log or an upload may "
                "only name folders below the working folder"
            )
        return folder

    def find_file(self, name: str) -> Path:
        """Returns the path of a file that a parameter names, relative to the scenario's folder.

        Raises `VoleryError` if there is none that the node may read: scenarios from logs and
        uploads read only below their own folder.
        """
        return self._context.find_file(name)

    def destroy_timer(self, timer: Timer) -> bool:
        """Destroys a timer; returns whether it belonged to the node."""
        if timer in self.__timers:
            self.__timers.remove(timer)
        return self.__release(timer)

    def destroy_service(self, service: NodeService) -> bool:
        """Destroys a service; returns whether it belonged to the node."""
        return self.__release(service)

    def destroy_client(self, client: Client) -> bool:
        """Destroys a client; returns True."""
        self.__release(client)
        return True

    def destroy_node(self) -> None:
        """Destroys the node's publishers, subscriptions, timers, services and parameters.

        Passes on the first error after all others; what failed is tried again by the next call.
        """
        self._context.graph.parameters.forget(self.full_name)
        if self.__executor is not None:
            self.__executor.close()
        self.__destroyed = True
        handles, errors = self.__handles, []
        for handle, release in reversed(tuple(handles.items())):
            handles.pop(handle, None)
            try:
                release()
            except Exception as error:
                errors.append(error)
                handles[handle] = release
        if errors:
            raise errors[0]

    # ----------------------------------------------------------------------------------- helpers

    def join(self) -> None:
        """Waits until no callback of the node is running."""
        if self.__executor is not None:
            self.__executor.join()

    def _handles(self, kind: type[Any]) -> list[Any]:
        """Returns the node's handles of a kind, in the order of their creation."""
        return [handle for handle in self.__handles if isinstance(handle, kind)]

    def __declare_moves(self, name: str, uavs: Sequence[str]) -> None:
        withdraw = self._context.graph.moved_uavs.declare(name, uavs)
        self.__handles[withdraw] = withdraw

    def __now_ns(self) -> int:
        return self._context.now_ns() if self.__executor is None else self.__executor.now_ns()

    def __defer(self, action: Callable[[], Any]) -> None:
        """Runs `action` at once, or when the output of the current callback is released."""
        if self.__executor is None or not self.__executor.defer(action):
            action()

    def __later(self) -> Callable[[Callable[[], None]], None] | None:
        """Returns a function that defers to the first tick during the node's construction."""
        if present_launch() is None:
            return None
        timers, now_ns = self._context.timers, self._context.now_ns
        return lambda action: timers.at(now_ns(), lambda: self.__run(action, "first call"))

    def _call_soon(self, action: Callable[[], Any]) -> None:
        """Calls `action` as a callback of its own, at the same simulated time."""
        timers, now_ns = self._context.timers, self._context.now_ns
        timers.at(now_ns(), lambda: self.__run(action, f"later call{_name_of(action)}"))

    def __release(self, handle: Any) -> bool:
        release = self.__handles.pop(handle, None)
        if release is not None:
            self.__defer(release)
        return release is not None

    def __received(self, message: Any) -> Any:
        return receive_message(message) if self.receives_copies else message

    def __run(self, callback: Callable[[], Any], occasion: str, *, heavy: bool = False) -> None:
        if self.__destroyed:
            return
        if self.__executor is None:
            before = time.thread_time()
            try:
                self.__guarded(callback, occasion)
            finally:
                self.__busy_s += time.thread_time() - before
        else:
            client = self._context.graph.acting_client
            work = partial(self.__guarded, callback, occasion, client)
            self.__executor.submit(work, heavy=heavy)

    def __guarded(self, callback: Callable[[], Any], occasion: str, client: str = "") -> None:
        """Runs a callback; a failure becomes a `NodeError` with node, callback, time and line.

        client: the external client that caused the call, if it runs later than the client's
        command; a failure is then logged, and does not end the run.
        """
        try:
            result = callback()
            if is_coroutine(result):
                advance(result, lambda rest: self.__run(rest, occasion))
        except FAILURES as error:
            if client:
                cause = f"node {self.full_name}: {occasion}, caused by {client}"
                _log.warning("%s, failed", cause, exc_info=error)
                return
            if isinstance(error, NodeError) and error.node:
                raise
            raise self.__failure(error, occasion) from error

    def __guarded_service(
        self, callback: Callable[[], Any], occasion: str, response_type: type[Any]
    ) -> Any:
        """Returns the response; passes a `VoleryError` of the service on to the caller."""
        try:
            response = callback()
            if is_coroutine(response):
                response = result_of(response)
            if not isinstance(response, response_type):
                raise TypeError(f"returned {response!r}, not the response")
        except VoleryError:
            raise
        except FAILURES as error:
            raise self.__failure(error, occasion) from error
        return response

    def __failure(self, error: BaseException, occasion: str) -> NodeError:
        now_ns = self.__now_ns()
        what = str(error) if isinstance(error, VoleryError) else f"{type(error).__name__}: {error}"
        client = f"; its last message of a client came from {self.__last_client}"
        failure = NodeError(
            f"node {self.full_name} failed at {now_ns / 1e9:.3f} s in its {occasion}: "
            f"{what}{location_of(error)}{client if self.__last_client else ''}",
            node=self.full_name,
            time_ns=now_ns,
        )
        add_frames(failure, error)
        return failure

    def resolve(self, name: str) -> str:
        """Returns the absolute, remapped name of a topic or service."""
        if "{" in name:
            for part, value in (("node", self.__name), ("ns", ns := self.get_namespace())):
                name = name.replace(f"{{{part}}}", value)
            name = name.replace("{namespace}", ns).replace("//", "/")
        if name == "~" or name.startswith("~/"):
            name = f"{self.__namespace}/{self.__name}{name[1:]}"
        elif not name.startswith("/"):
            name = f"{self.__namespace}/{name}"
        return self._context.remap.get(name, name)

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:  # noqa: ARG002
        """Returns the absolute name of a topic."""
        return self.resolve(topic)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:  # noqa: ARG002
        """Returns the absolute name of a service."""
        return self.resolve(service)

    @property
    def busy_s(self) -> float:
        """CPU time that the node's callbacks have used so far, s."""
        return self.__busy_s if self.__executor is None else self.__executor.busy_s

    @property
    def has_worker(self) -> bool:
        """Whether the node's callbacks run on a thread of their own."""
        return self.__executor is not None

    def save_base_state(self) -> Any:
        """Returns the state that every node saves in a snapshot: parameters, timers, logger."""
        timers = [timer.get_state() for timer in self.__timers]
        return self.parameter_values(), timers, self.__logger.get_state()

    def restore_base_state(self, state: Any) -> None:
        """Restores what `save_base_state` returned."""
        values, timers, logger = state
        self.restore_parameters(values)
        for timer, kept in zip(self.__timers, timers, strict=False):
            timer.set_state(kept)
        self.__logger.set_state(logger)


def service_type(srv_type: str | type[Any]) -> str:
    """Returns the name of a service type, `std_srvs/srv/Trigger`, given its class or name."""
    if isinstance(srv_type, str):
        return srv_type
    name = getattr(srv_type, "__srvtype__", None)
    if name is None:
        raise GraphError(
            f"{srv_type!r} is not a service type of Volery; import it from PACKAGE.srv"
        )
    return str(name)


def _name_of(callback: Callable[..., Any]) -> str:
    """Returns ` (NAME)` of a callback that has a name."""
    name = getattr(callback, "__name__", "")
    return f" ({name})" if name and name != "<lambda>" else ""


def _joined(
    own: Mapping[str, Any] | Iterable[ParameterSetting] | None, launched: Mapping[str, Any]
) -> dict[str, Any]:
    """Returns the overrides of the node's code and of its launch, which take precedence."""
    given = own if isinstance(own, Mapping) else {s.name: s.value for s in own or ()}
    return {**given, **launched}
