"""Connects a program to a ROS 2 graph, with the methods of `graph.session.Session`.

    link = Ros2Client(Ros2Environment(domain_id=7), "/uav1/gap_following")
    queue = link.subscribe("/uav1/laser/horizontal/scan", wake=woken.set)

A node that runs on it (`volery node ... --via ros2`) is a ROS 2 node of its own name, with its
parameters.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

from volery.bridges.ros2.environment import Ros2Environment, join_ros2
from volery.bridges.ros2.middleware import (
    Caller,
    Handle,
    Profile,
    ServiceSpec,
    TopicSpec,
    Writer,
)
from volery.bridges.ros2.names import NodeName, check_name
from volery.bridges.ros2.parameters import ParameterServices
from volery.bridges.ros2.services import answerer, ask_server, wait_for
from volery.bridges.ros2.subscriptions import Subscriptions
from volery.bridges.ros2.warning_filter import WarningFilter
from volery.bridges.ros2.writer_thread import Ros2WriterThread
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type, type_name
from volery.graph.parameters import Parameters
from volery.graph.qos import DEFAULT_DEPTH, check_depth
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler, SessionInfo
from volery.graph.subscription_queue import SubscriptionQueue, Wake

_FIRST_LOOK_S = 1.0
"""Time for the discovery of others after joining."""
_LONGEST_LOOK_S = 3.0
_LATCHED_DEPTH = 1
_PUBLISHED_DEPTH = 100


class Ros2Client:
    """One participant in a ROS 2 graph as a `GraphConnection`.

    name: of the ROS 2 node until a node of Volery sets its own name. Raises `BridgeError` if the
    graph cannot be joined.
    """

    def __init__(self, terms: Ros2Environment | None = None, name: str = "/volery_node") -> None:
        check_name(name)
        self._participant = join_ros2(terms or Ros2Environment())
        self._joined = time.monotonic()
        self.name = f"ROS 2 node {name}"
        self._node = NodeName.of(name)
        self._named = False
        self._participant.add_node(self._node)
        self._participant.announce()
        self._worker = Ros2WriterThread()
        self._warnings = WarningFilter()
        self._lock = threading.RLock()
        self._publishers: dict[str, _Publisher] = {}
        self._subscriptions = Subscriptions(self._participant, self._node)
        self._servers: dict[str, Handle] = {}
        self._callers: dict[str, tuple[ServiceSpec, Caller]] = {}
        self._parameters: ParameterServices | None = None
        self._closed = False
        self._participant.when_changed(lambda: self._worker.post(self._adapt))

    @property
    def where(self) -> str:
        """Middleware and domain, for messages."""
        return self._participant.where

    def host_node(self, name: str, parameters: Parameters, post: Callable[[Any], Any]) -> None:
        """Becomes the ROS 2 node of this name; its parameters are set through `post`."""
        check_name(name)

        def set_value(node: str, parameter: str, value: Any, done: Callable[[str], None]) -> None:
            def set_it() -> None:
                try:
                    parameters.get(node, parameter).set(value)
                except GraphError as error:
                    done(str(error))
                else:
                    done("")

            post(set_it)

        node = NodeName.of(name)
        if not self._named:
            self._participant.remove_node(self._node)
            self._named = True
        self._participant.add_node(node)
        self._node, self.name = node, f"ROS 2 node {name}"
        self._subscriptions.move(node)
        if self._parameters is None:
            self._parameters = ParameterServices(
                self._participant, parameters, set_value, node, self._worker, time.time_ns
            )
        self._parameters.survey()
        self._participant.announce()

    # ------------------------------------------------------------------------------------ topics

    def topic_types(self) -> dict[str, str]:
        """Returns topics that others publish or subscribe to, and their types."""
        self._look_around()
        return dict(self._participant.topic_types())

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Advertises `topic`. Raises `GraphError` for a wrong type."""
        check_name(topic)
        _known(msgtype)
        depth = _LATCHED_DEPTH if latched else _PUBLISHED_DEPTH
        with self._lock:
            self._check_open()
            old = self._publishers.get(topic)
            if old is not None and (old.msgtype, old.latched) == (msgtype, latched):
                return
            if old is not None:
                old.writer.close()
            spec = TopicSpec(self._node, topic, msgtype, Profile(latched=latched, depth=depth))
            self._publishers[topic] = _Publisher(self._participant.writer(spec), msgtype, latched)
        self._participant.announce()

    def unadvertise(self, topic: str) -> None:
        """Ends the publication of `topic`. Raises `GraphError` if there was none."""
        with self._lock:
            publisher = self._publishers.pop(topic, None)
        if publisher is None:
            raise GraphError(f"{self.name} does not publish '{topic}'")
        publisher.writer.close()
        self._participant.announce()

    def published_type(self, topic: str) -> str | None:
        """Returns the advertised type of `topic`; None if it is not advertised."""
        publisher = self._publishers.get(topic)
        return None if publisher is None else publisher.msgtype

    def publish(self, topic: str, message: Any) -> None:
        """Publishes a message of the advertised type."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            raise GraphError(f"{self.name} has not advertised '{topic}'")
        if type_name(type(message)) != publisher.msgtype:
            raise GraphError(f"topic '{topic}' carries {publisher.msgtype}")
        if publisher.latched or publisher.writer.matched:
            publisher.writer.write(encode_cdr(message, publisher.msgtype))

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Subscribes as `GraphConnection.subscribe`; messages get the wall time of their arrival.

        The middleware delivers reliably if all publishers do; `reliable` applies to the queue only.
        """
        check_depth(depth)
        check_name(topic)
        found = msgtype or self._type_of(topic)
        _known(found)
        queue = SubscriptionQueue(topic, depth, wake, reliable=reliable)
        with self._lock:
            self._check_open()
            self._subscriptions.open(queue, found, depth)
        self._participant.announce()
        return queue

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Ends a subscription; queued messages remain available."""
        self._subscriptions.close(queue)
        self._participant.announce()

    def _type_of(self, topic: str) -> str:
        found = self.topic_types().get(topic)
        if found is None:
            raise GraphError(f"no topic '{topic}'; give a type to subscribe before it exists")
        return found

    def _adapt(self) -> None:
        self._subscriptions.adapt()
        self._participant.announce()

    # ---------------------------------------------------------------------------------- services

    def service_types(self) -> dict[str, str]:
        """Returns services of others, and their types."""
        self._look_around()
        return dict(self._participant.service_types())

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; `reply` receives the response or a `GraphError`, in another thread."""

        def ask() -> None:
            try:
                spec, caller = self._caller(service)
                wanted = f"{spec.srvtype}_Request"
                content = zero_message(wanted) if request is None else request
                if type_name(type(content)) != wanted:
                    raise GraphError(f"service '{service}' needs {wanted}")
                ask_server(caller, spec, content, reply)
            except GraphError as error:
                reply.fail(error)

        threading.Thread(target=ask, name=f"volery-ros2 {service}", daemon=True).start()

    def _caller(self, service: str) -> tuple[ServiceSpec, Caller]:
        """Returns a client of an existing service.

        Raises `GraphError` if it has no server in time.
        """
        with self._lock:
            known = self._callers.get(service)
        if known is not None:
            return known
        check_name(service)
        types = self._participant.service_types
        if not wait_for(lambda: service in types(), _LONGEST_LOOK_S):
            raise GraphError(f"service '{service}' has no server")
        srvtype = types()[service]
        _known(f"{srvtype}_Request")
        with self._lock:
            self._check_open()
            spec = ServiceSpec(self._node, service, srvtype)
            if service not in self._callers:
                self._callers[service] = spec, self._participant.caller(spec)
            return self._callers[service]

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service; `handler(request, reply)` is called in a thread of the connection."""
        check_name(service)
        _known(f"{srvtype}_Request")
        with self._lock:
            self._check_open()
            if service in self._servers:
                raise GraphError(f"{self.name} has a service '{service}' already")
            take = answerer(self._worker, srvtype, handler, self._warnings)
            spec = ServiceSpec(self._node, service, srvtype)
            self._servers[service] = self._participant.server(spec, take)
        self._participant.announce()

    def destroy_service(self, service: str) -> None:
        """Destroys a service. Raises `GraphError` if it does not exist."""
        with self._lock:
            server = self._servers.pop(service, None)
        if server is None:
            raise GraphError(f"{self.name} has no service '{service}'")
        server.close()
        self._participant.announce()

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Leaves the graph; further calls do nothing."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        with contextlib.suppress(RuntimeError):
            self._worker.close()
        handles: list[Handle] = [p.writer for p in self._publishers.values()]
        handles += [*self._servers.values(), *(caller for _, caller in self._callers.values())]
        for handle in handles:
            handle.close()
        self._subscriptions.close_all()
        if self._parameters is not None:
            self._parameters.close()
        self._participant.close()

    @property
    def info(self) -> SessionInfo:
        """Returns the current state of the client."""
        with self._lock:
            return SessionInfo(
                self.name,
                tuple(self._publishers),
                self._subscriptions.infos,
                tuple(self._servers),
            )

    def _check_open(self) -> None:
        if self._closed:
            raise GraphError(f"{self.name} is closed")

    def _look_around(self) -> None:
        """Waits for the discovery of others, if the client joined just now."""
        time.sleep(max(self._joined + _FIRST_LOOK_S - time.monotonic(), 0.0))


class _Publisher:
    """A publisher on a topic."""

    def __init__(self, writer: Writer, msgtype: str, latched: bool) -> None:
        self.writer = writer
        self.msgtype = msgtype
        self.latched = latched


def _known(msgtype: str) -> None:
    try:
        message_type(msgtype)
    except KeyError:
        raise GraphError(f"message type '{msgtype}' is not known") from None
