"""A connection for nodes that start before their graph.

The errors of a node itself, such as wrong parameters, are then reported without a wait for the
graph.

    link = DeferredConnection("watcher", lambda: await_link(via, "watcher"))
    host = NodeHost(link)
    node = Watcher(context=host.context())   # raises the node's own errors
    link.join()         # waits for the graph
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from volery.graph.connection import GraphConnection, HostsNodes
from volery.graph.messages import Published
from volery.graph.parameters import Parameters
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler
from volery.graph.subscription_queue import SubscriptionQueue, Wake

Action = Callable[[GraphConnection], None]

_MAX_PUBLISHED = 1000
"""Number of newest messages stored until the graph is connected (modelling choice)."""


class DeferredConnection:
    """A `GraphConnection` that repeats earlier advertisements and messages at `join`.

    open_link: joins the graph. A service call before `join` joins the graph.
    """

    def __init__(self, name: str, open_link: Callable[[], GraphConnection]) -> None:
        self.name = name
        self._open_link = open_link
        self._link: GraphConnection | None = None
        self._announced: list[Action] = []
        self._published: deque[Action] = deque(maxlen=_MAX_PUBLISHED)
        self._lock = threading.RLock()

    def join(self) -> GraphConnection:
        """Joins the graph, if not done yet; returns the connection."""
        if self._link is None:
            link = self._open_link()
            with self._lock:
                for action in (*self._announced, *self._published):
                    action(link)
                self._announced.clear()
                self._published.clear()
                self._link = link
        return self._link

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Implements `GraphConnection.advertise`."""
        self._announce(lambda link: link.advertise(topic, msgtype, latched=latched))

    def publish(self, topic: str, message: Any) -> None:
        """Implements `GraphConnection.publish`."""
        with self._lock:
            if self._link is None:
                self._published.append(lambda link: link.publish(topic, message))
                return
        self._link.publish(topic, message)

    def unadvertise(self, topic: str) -> None:
        """Implements `GraphConnection.unadvertise`."""
        self._announce(lambda link: link.unadvertise(topic))

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Implements `GraphConnection.subscribe`.

        The queue is empty until the graph is connected.
        """
        queue = _DeferredQueue(topic, depth, wake, reliable=reliable)

        def fill(link: GraphConnection) -> None:
            queue.real = link.subscribe(topic, msgtype, depth=depth, reliable=reliable, wake=wake)

        self._announce(fill)
        return queue

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Implements `GraphConnection.unsubscribe`."""

        def empty(link: GraphConnection) -> None:
            if isinstance(queue, _DeferredQueue) and queue.real is not None:
                link.unsubscribe(queue.real)

        self._announce(empty)

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Implements `GraphConnection.call`."""
        self.join().call(service, request, reply)

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Implements `GraphConnection.create_service`."""
        self._announce(lambda link: link.create_service(service, srvtype, handler))

    def host_node(self, name: str, parameters: Parameters, post: Callable[[Any], Any]) -> None:
        """Implements `HostsNodes.host_node`, if the connection to the graph does."""

        def host(link: GraphConnection) -> None:
            if isinstance(link, HostsNodes):
                link.host_node(name, parameters, post)

        self._announce(host)

    def close(self) -> None:
        """Implements `GraphConnection.close`; does nothing without a graph."""
        if self._link is not None:
            self._link.close()

    def _announce(self, action: Action) -> None:
        with self._lock:
            if self._link is None:
                self._announced.append(action)
                return
        action(self._link)


class _DeferredQueue(SubscriptionQueue):
    """Forwards to the queue of the connection to the graph."""

    real: SubscriptionQueue | None = None

    @property
    def failure(self) -> str | None:
        """Implements `SubscriptionQueue.failure`."""
        return None if self.real is None else self.real.failure

    def take_numbered(self, max_count: int | None = None) -> list[tuple[int, Published]]:
        """Implements `SubscriptionQueue.take_numbered`."""
        return [] if self.real is None else self.real.take_numbered(max_count)
