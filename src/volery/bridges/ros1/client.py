"""Connects a program to a ROS 1 graph, with the methods of `graph.session.Session`.

Its methods:

    link = Ros1Client(node_name="gap_following")
    queue = link.subscribe("/uav1/laser/horizontal/scan", wake=woken.set)
"""

from __future__ import annotations

import logging
import threading
import time
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any

from volery.bridges.ros1.node import Receive, join_ros1
from volery.bridges.ros1.raw_messages import raw_message_class
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.messages import Published, message_type, type_name
from volery.graph.qos import DEFAULT_DEPTH, check_depth
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler, SessionInfo
from volery.graph.subscription_queue import SubscriptionQueue, Wake

_MASTER_EACH_S = 1.0
_SERVICE_TIMEOUT_S = 30.0

_log = logging.getLogger(__name__)


class Ros1Client:
    """One ROS 1 node as a `GraphConnection`; wakes and requests come from rospy's threads.

    Parameters and `BridgeError` are those of `ros1.node.join_ros1`.
    """

    def __init__(
        self,
        master_uri: str | None = None,
        node_name: str = "volery_node",
        *,
        host: str | None = None,
        anywhere: bool = False,
    ) -> None:
        self._node = join_ros1(node_name, master_uri=master_uri, host=host, anywhere=anywhere)
        self.name = f"ROS 1 node {self._node.name}"
        self._codec = ros1_codec()
        self._lock = threading.RLock()
        self._publishers: dict[str, _Publisher] = {}
        self._queues: dict[SubscriptionQueue, Any] = {}
        self._offers: dict[str, Any] = {}
        self._closed = threading.Event()
        threading.Thread(target=self._watch, name="volery-ros1-master", daemon=True).start()

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Advertises `topic`. Raises `GraphError` for a wrong type."""
        with self._lock:
            self._check_open()
            old = self._publishers.get(topic)
            if old is not None and (old.msgtype, old.latched) == (msgtype, latched):
                return
            self._codec.learn(msgtype)
            if old is not None:
                old.handle.unregister()
            self._publishers[topic] = _Publisher(
                self._node.publisher(topic, msgtype, latched=latched), msgtype, latched
            )

    def unadvertise(self, topic: str) -> None:
        """Ends the publication of `topic`. Raises `GraphError` if there was none."""
        with self._lock:
            publisher = self._publishers.pop(topic, None)
        if publisher is None:
            raise GraphError(f"{self.name} does not publish '{topic}'")
        publisher.handle.unregister()

    def published_type(self, topic: str) -> str | None:
        """Returns the advertised type of `topic`; None if it is not advertised."""
        publisher = self._publishers.get(topic)
        return None if publisher is None else publisher.msgtype

    def publish(self, topic: str, message: Any) -> None:
        """Publishes a message of the advertised type; does nothing without subscribers."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            raise GraphError(f"{self.name} has not advertised '{topic}'")
        if type_name(type(message)) != publisher.msgtype:
            raise GraphError(f"topic '{topic}' carries {publisher.msgtype}")
        publisher.publish(message)

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Subscribes as `GraphConnection.subscribe`.

        Messages get the wall time of their arrival.
        """
        check_depth(depth)
        found = msgtype or self._node.topic_type(topic)
        if found is None:
            raise GraphError(f"no topic '{topic}'; give a type to subscribe before it exists")
        self._codec.learn(found)
        queue = SubscriptionQueue(topic, depth, wake, reliable=reliable)
        with self._lock:
            self._check_open()
            receive = self._receiver(topic, found, queue)
            self._queues[queue] = self._node.subscriber(topic, found, receive)
        return queue

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Ends a subscription; queued messages remain available."""
        with self._lock:
            subscriber = self._queues.pop(queue, None)
        if subscriber is not None:
            subscriber.unregister()

    def _receiver(self, topic: str, msgtype: str, queue: SubscriptionQueue) -> Receive:
        def receive(data: bytes, sender: str, _latched: bool) -> None:
            try:
                message = self._codec.decode(data, msgtype)
            except GraphError as error:
                _log.warning("ROS 1 topic %s, from %s: %s", topic, sender, error)
                return
            queue.put(Published(topic, msgtype, time.time_ns(), message))

        return receive

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; `reply` receives the response or a `GraphError`, in another thread."""

        def ask() -> None:
            try:
                srvtype = self._node.service_type(service)
                wanted = f"{srvtype}_Request"
                content = message_type(wanted)() if request is None else request
                if type_name(type(content)) != wanted:
                    raise GraphError(f"service '{service}' needs {wanted}")
                reply.answer(self._node.call(service, srvtype, content))
            except GraphError as error:
                reply.fail(error)
            except Exception as error:  # report any error to the caller
                reply.fail(GraphError(f"service '{service}': {type(error).__name__}: {error}"))

        threading.Thread(target=ask, name=f"volery-ros1 {service}", daemon=True).start()

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service; `handler(request, reply)` is called in the request's own thread."""

        def handle(request: Any) -> Any:
            come: Future[Any] = Future()
            handler(request, ServiceReply(come.set_result, come.set_exception))
            try:
                return come.result(_SERVICE_TIMEOUT_S)
            except FutureTimeout:
                raise GraphError(f"{self.name} did not answer") from None

        with self._lock:
            self._check_open()
            if service in self._offers:
                raise GraphError(f"{self.name} has a service '{service}' already")
            self._offers[service] = self._node.service(service, srvtype, handle)

    def destroy_service(self, service: str) -> None:
        """Destroys a service. Raises `GraphError` if it does not exist."""
        with self._lock:
            offered = self._offers.pop(service, None)
        if offered is None:
            raise GraphError(f"{self.name} has no service '{service}'")
        offered.shutdown()

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Unregisters all topics and services; the node itself ends with the process."""
        self._closed.set()
        with self._lock:
            topics, queues = tuple(self._publishers), tuple(self._queues)
            services = tuple(self._offers)
        for topic in topics:
            self.unadvertise(topic)
        for queue in queues:
            self.unsubscribe(queue)
        for service in services:
            self.destroy_service(service)

    @property
    def info(self) -> SessionInfo:
        """Returns the current state of the client."""
        with self._lock:
            return SessionInfo(
                self.name,
                tuple(self._publishers),
                tuple(queue.info for queue in self._queues),
                tuple(self._offers),
            )

    def _check_open(self) -> None:
        if self._closed.is_set():
            raise GraphError(f"{self.name} is closed")
        if not self._node.alive:
            raise GraphError(f"{self.name} was ended by another node of its name")

    def _watch(self) -> None:
        """Registers again with a restarted master."""
        while not self._closed.wait(_MASTER_EACH_S) and self._node.alive:
            if not threading.main_thread().is_alive():
                self.close()  # else rospy's threads would keep the process alive
                return
            try:
                self._node.register_again()
            except (OSError, BridgeError):  # the master is away
                continue


class _Publisher:
    """A publisher and its count of messages."""

    def __init__(self, handle: Any, msgtype: str, latched: bool) -> None:
        self.handle = handle
        self.msgtype = msgtype
        self.latched = latched
        self._raw = raw_message_class(msgtype)
        self._encode = ros1_codec().encode
        self._lock = threading.Lock()
        self._sequence = 0

    def publish(self, message: Any) -> None:
        """Sends a message; a latched one also to later subscribers."""
        if not (self.latched or self.handle.get_num_connections()):
            return
        with self._lock:
            data = self._encode(message, self.msgtype, self._sequence)
            self._sequence += 1
            self.handle.publish(self._raw(data))
