"""The graph of a node's own process, which mirrors a remote graph."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from volery.core.errors import GraphError
from volery.graph.connection import GraphConnection, HostsNodes, call_and_wait
from volery.graph.graph import AsyncHandler, Graph
from volery.graph.messages import Published, type_name
from volery.graph.qos import DEFAULT_QOS, QoSProfile
from volery.graph.service_reply import ServiceReply
from volery.graph.subscription_queue import SubscriptionQueue
from volery.graph.topics import Callback, Publisher, Subscription

_CALL_TIMEOUT_S = 10.0


class MirroredGraph(Graph):
    """Publishes through a connection and receives remote messages through it.

    Callbacks run in the thread that calls `hand_out`; the connection's thread calls `wake` when
    there is work.
    """

    def __init__(
        self, link: GraphConnection, now_ns: Callable[[], int], wake: Callable[[], None]
    ) -> None:
        self._posted: list[Callable[[], Any]] = []
        super().__init__(now_ns, self._keep)
        self._link = link
        self._wake = wake
        self._queues: dict[str, SubscriptionQueue] = {}
        self._readers: dict[str, list[Callback]] = {}
        self._held: list[tuple[str, Published]] = []
        self._barrier: tuple[str, Callable[[Published], None]] | None = None

    def enter(self, node: str) -> None:
        """Registers a node here and, if the connection supports it, remotely."""
        super().enter(node)
        if isinstance(self._link, HostsNodes):
            self._link.host_node(node, self.parameters, self.post)

    # ------------------------------------------------------------------------------------ topics

    def advertise(
        self,
        topic: str,
        msgtype: str | type[Any],
        *,
        latched: bool = False,
        local: bool = False,
    ) -> Publisher:
        """Advertises a topic here and remotely."""
        name = msgtype if isinstance(msgtype, str) else type_name(msgtype)
        self._link.advertise(topic, name, latched=latched)
        own = super().advertise(topic, name, latched=latched, local=local)
        return _RemotePublisher(own, self._link, lambda: not self.publishers(topic))

    def subscribe(
        self,
        topic: str,
        callback: Callback,
        msgtype: str | type[Any] | None = None,
        *,
        qos: QoSProfile = DEFAULT_QOS,
        passive: bool = False,  # noqa: ARG002
    ) -> Subscription:
        """Calls `callback` with each message of the connection.

        The first subscriber of a topic determines the queue's options.
        """
        name = type_name(msgtype) if isinstance(msgtype, type) else msgtype
        if topic not in self._queues:
            self._queues[topic] = self._link.subscribe(
                topic, name, depth=qos.depth, reliable=qos.reliable, wake=self._wake
            )
        readers = self._readers.setdefault(topic, [])
        readers.append(callback)
        return _RemoteSubscription(readers, callback, lambda: self._leave(topic))

    def _leave(self, topic: str) -> None:
        """Ends a remote subscription without local subscribers."""
        if topic in self._queues and not self._readers[topic]:
            self._link.unsubscribe(self._queues.pop(topic))

    def hold_back(self, barrier: str, begin: Callable[[Published], None]) -> None:
        """Delivers messages only after a later message on `barrier`.

        `begin` is called with that message before the messages that it releases.
        """
        self._barrier = barrier, begin

    def hand_out(self) -> bool:
        """Delivers all received messages in the order of arrival; returns whether there were any.

        Messages that arrive meanwhile wait for the next call. Raises `GraphError` if a reliable
        subscription has lost messages: this process is too slow for it.
        """
        for queue in self._queues.values():
            if queue.failure is not None:
                raise GraphError(queue.failure)
        come = [
            (number, topic, published)
            for topic, queue in self._queues.items()
            for number, published in queue.take_numbered()
        ]
        self._held += [(topic, published) for _, topic, published in sorted(come, key=_number)]
        for topic, published in self._freed():
            for callback in tuple(self._readers[topic]):
                callback(published)
        posted = [self._posted.pop(0) for _ in range(len(self._posted))]
        for action in posted:
            action()
        return bool(come or posted)

    def _freed(self) -> Iterator[tuple[str, Published]]:
        """Returns messages to deliver now, in order."""
        if self._barrier is None:
            freed, self._held = self._held, []
            yield from freed
            return
        barrier, begin = self._barrier
        while barrier in (topics := [topic for topic, _ in self._held]):
            end = topics.index(barrier) + 1
            freed, self._held = self._held[:end], self._held[end:]
            begin(freed[-1][1])
            yield from freed

    def publish_at_end(self, sender: Publisher, message: Any) -> None:
        """Publishes a message."""
        sender.publish(message)

    # ---------------------------------------------------------------------------------- services

    def create_service(self, service: str, srvtype: str, handler: Callable[[Any], Any]) -> None:
        """Creates a remote service; its handler runs here, in `hand_out`."""

        def ask(request: Any, reply: ServiceReply) -> None:
            self.post(lambda: _answer(handler, request, reply))

        self._link.create_service(service, srvtype, ask)

    def create_async_service(
        self,
        service: str,
        srvtype: str,
        handler: AsyncHandler,
        *,
        owner: str = "",  # noqa: ARG002
    ) -> None:
        """Creates a service like `create_service`, for answers that come later."""
        self._link.create_service(
            service, srvtype, lambda q, reply: self.post(lambda: handler(q, reply))
        )

    def has_service(self, service: str) -> bool:  # noqa: ARG002
        """Returns True: only a call shows whether a remote server exists."""
        return True

    def call(self, service: str, request: Any | None = None) -> Any:
        """Calls a service and waits for the response. Raises `GraphError` after a timeout."""
        return call_and_wait(self._link, service, request, _CALL_TIMEOUT_S)

    def call_async(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; the answer comes from the connection's thread."""
        self._link.call(service, request, reply)

    def _keep(self, action: Callable[[], Any]) -> None:
        self._posted.append(action)
        self._wake()


class _RemoteSubscription(Subscription):
    """One callback of a mirrored topic."""

    def __init__(
        self, readers: list[Callback], callback: Callback, leave: Callable[[], None]
    ) -> None:
        super().__init__(readers, callback)
        self._leave = leave

    def cancel(self) -> None:
        """Stops receiving; the last subscription ends the remote one."""
        super().cancel()
        self._leave()


class _RemotePublisher(Publisher):
    """Publishes through the connection; remote subscribers are unknown."""

    def __init__(
        self, local: Publisher, link: GraphConnection, is_last: Callable[[], bool]
    ) -> None:
        self._local = local
        self._link = link
        self._is_last = is_last
        self.latched = local.latched

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self._local.topic

    @property
    def msgtype(self) -> str:
        """Type of its messages."""
        return self._local.msgtype

    @property
    def has_subscribers(self) -> bool:
        """True, because remote subscribers are unknown."""
        return True

    @property
    def subscriptions(self) -> int:
        """Always 1, because remote subscribers are unknown."""
        return 1

    def publish(self, message: Any) -> None:
        """Sends a message."""
        name = getattr(message, "__msgtype__", None)
        if name != self.msgtype:
            raise GraphError(f"topic '{self.topic}' carries {self.msgtype}, not {name}")
        self._link.publish(self.topic, message)

    def cancel(self) -> None:
        """Ends the publication here, and remotely if no other node here publishes the topic."""
        if self._local.cancelled:
            return
        self._local.cancel()
        if self._is_last():
            self._link.unadvertise(self.topic)


def _number(entry: tuple[int, str, Published]) -> int:
    return entry[0]


def _answer(handler: Callable[[Any], Any], request: Any, reply: ServiceReply) -> None:
    try:
        reply.answer(handler(request))
    except Exception as error:  # an error for the caller, too
        reply.fail(GraphError(f"{type(error).__name__}: {error}"))
        raise
