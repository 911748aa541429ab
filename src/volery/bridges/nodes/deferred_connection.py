"""A link for nodes that are started before their graph is there.

So a node's own complaints, as of its parameters, come at once and not after a wait for the graph.

    link = DeferredConnection("watcher", lambda: await_link(via, "watcher"))
    host = NodeHost(link)
    node = Watcher(context=host.context())      # what is wrong with it is told here
    link.join()                                 # here the graph is waited for
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

_MOST_PUBLISHED = 1000
"""The newest so many messages are kept until the graph is there (modelling choice)."""


class DeferredConnection:
    """A `GraphConnection` that announces and publishes at `join` what came before it.

    open_link: joins the graph. Who calls a service before `join` has it joined then.
    """

    def __init__(self, name: str, open_link: Callable[[], GraphConnection]) -> None:
        self.name = name
        self._open_link = open_link
        self._link: GraphConnection | None = None
        self._announced: list[Action] = []
        self._published: deque[Action] = deque(maxlen=_MOST_PUBLISHED)
        self._lock = threading.RLock()

    def join(self) -> GraphConnection:
        """Join the graph, unless that is done; the link to it."""
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
        """As of `GraphConnection`."""
        self._announce(lambda link: link.advertise(topic, msgtype, latched=latched))

    def publish(self, topic: str, message: Any) -> None:
        """As of `GraphConnection`."""
        with self._lock:
            if self._link is None:
                self._published.append(lambda link: link.publish(topic, message))
                return
        self._link.publish(topic, message)

    def unadvertise(self, topic: str) -> None:
        """As of `GraphConnection`."""
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
        """As `GraphConnection.subscribe`; the mailbox is empty until there is a graph."""
        mailbox = _LateMailbox(topic, depth, wake, reliable=reliable)

        def fill(link: GraphConnection) -> None:
            mailbox.real = link.subscribe(topic, msgtype, depth=depth, reliable=reliable, wake=wake)

        self._announce(fill)
        return mailbox

    def unsubscribe(self, mailbox: SubscriptionQueue) -> None:
        """As of `GraphConnection`."""

        def empty(link: GraphConnection) -> None:
            if isinstance(mailbox, _LateMailbox) and mailbox.real is not None:
                link.unsubscribe(mailbox.real)

        self._announce(empty)

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """As of `GraphConnection`."""
        self.join().call(service, request, reply)

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """As of `GraphConnection`."""
        self._announce(lambda link: link.offer(service, srvtype, handler))

    def host_node(self, name: str, parameters: Parameters, post: Callable[[Any], Any]) -> None:
        """As of `HostsNodes`, where the link to the graph is one."""

        def host(link: GraphConnection) -> None:
            if isinstance(link, HostsNodes):
                link.host_node(name, parameters, post)

        self._announce(host)

    def close(self) -> None:
        """As of `GraphConnection`; without a graph nothing happens."""
        if self._link is not None:
            self._link.close()

    def _announce(self, action: Action) -> None:
        with self._lock:
            if self._link is None:
                self._announced.append(action)
                return
        action(self._link)


class _LateMailbox(SubscriptionQueue):
    """Stands for one that a link to the graph fills."""

    real: SubscriptionQueue | None = None

    @property
    def failure(self) -> str | None:
        """As of `SubscriptionQueue`."""
        return None if self.real is None else self.real.failure

    def take_numbered(self, most: int | None = None) -> list[tuple[int, Published]]:
        """As of `SubscriptionQueue`."""
        return [] if self.real is None else self.real.take_numbered(most)
