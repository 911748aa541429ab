"""Defines topics, their publishers and subscriptions."""

from __future__ import annotations

from collections.abc import Callable, MutableSequence
from dataclasses import dataclass
from typing import Any, Protocol

from volery.core.errors import GraphError
from volery.graph.messages import Published

Callback = Callable[[Published], None]


@dataclass(frozen=True)
class TopicInfo:
    """Describes a topic."""

    name: str
    msgtype: str
    publishers: int
    subscribers: int
    messages: int
    latched: bool
    """Whether later subscribers receive a publisher's last message."""


class Topic:
    """A topic of a graph, with its subscribers and latched messages."""

    def __init__(self, name: str, msgtype: str) -> None:
        self.name = name
        self.msgtype = msgtype
        self.callbacks: list[Callback] = []
        self.recorders: tuple[Callback, ...] = ()  # those of the graph that receive the topic, ...
        self.seen_changes = -1  # ... at this number of the graph's changes
        self.external: list[Callback] = []  # the callbacks that other threads have attached
        self.passive: list[Callback] = []  # the callbacks that publish and call nothing
        self.on_ended: list[Callable[[str], None]] = []  # learn why external subscriptions end
        self.num_attached = 0  # number of external subscriptions so far
        self.publishers = 0
        self.num_local = 0  # number of publishers that only this machine of a divided run has
        self.messages = 0
        self.answer_ns = -1  # time of the last message published in response to another one ...
        self.answers = 0  # ... and the number of such messages at that instant
        self.latched = False
        self.last_messages: dict[Publisher, Published] = {}  # of each latched publisher

    @property
    def used(self) -> bool:
        """Whether the topic has publishers or subscribers."""
        return bool(self.publishers or self.callbacks)

    @property
    def is_decided(self) -> bool:
        """Whether its type cannot change: it has a publisher, or a subscriber of the simulation."""
        return bool(self.publishers or len(self.callbacks) > len(self.external))

    @property
    def has_acting_subscribers(self) -> bool:
        """Whether a subscriber of the simulation may publish or call when it receives a message."""
        return len(self.callbacks) > len(self.external) + len(self.passive)

    def end(self, reason: str) -> None:
        """Notifies the external subscribers that they will receive no message."""
        for on_end in tuple(self.on_ended):
            on_end(reason)


class _Delivery(Protocol):
    """Delivers the messages of publishers: a graph."""

    changes: int
    """Number of changes of publishers and subscriptions so far."""

    def is_recorded(self, topic: str) -> bool:
        """Returns whether a recorder or digest receives the messages of a topic."""

    def must_cross(self, topic: str) -> bool:
        """Returns whether another machine of a divided run receives the messages of a topic."""

    def enqueue(self, sender: Publisher, topic: Topic, message: Any) -> None:
        """Queues a message."""

    def publish_external(self, sender: Publisher, topic: Topic, message: Any) -> None:
        """Passes a message to external clients only."""

    def remove_publisher(self, publisher: Publisher, topic: Topic) -> None:
        """Removes a publisher."""


class Publisher:
    """Publishes messages of one type on one topic."""

    def __init__(
        self, graph: _Delivery, topic: Topic, *, latched: bool = False, local: bool = False
    ) -> None:
        self._graph = graph
        self._topic = topic
        self.latched = latched
        self.local = local
        """Whether only this machine of a divided run has the publisher; see `Graph.advertise`."""
        self._seen_changes, self._has_receivers = -1, False
        self.owner = ""
        """Full name of the publisher's node; empty: none."""
        self.lasting = False
        """Whether snapshots exclude its messages.

        A queued message stays queued when another state is restored, and is delivered once.
        """
        self.cancelled = False
        """Whether the publisher has been cancelled."""

    @property
    def msgtype(self) -> str:
        """Type of the messages."""
        return self._topic.msgtype

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self._topic.name

    @property
    def has_subscribers(self) -> bool:
        """Whether a message would be delivered or latched; otherwise it need not be built."""
        changes = self._graph.changes
        if changes != self._seen_changes:
            topic = self._topic
            self._has_receivers = bool(topic.callbacks or self._graph.is_recorded(topic.name))
            self._seen_changes = changes
        return self.latched or self._has_receivers

    def publish(self, message: Any) -> None:
        """Queues a message for delivery; has no effect after `cancel`."""
        if not self.cancelled:
            self._graph.enqueue(self, self._topic, message)

    def check(self, message: Any) -> None:
        """Raises `GraphError` if the message is not of the topic's type."""
        name = getattr(message, "__msgtype__", None)
        if name != self.msgtype:
            found = name or f"a {type(message).__name__}"
            raise GraphError(f"topic '{self.topic}' carries {self.msgtype}, not {found}")

    def publish_posted(self, message: Any) -> None:
        """Queues a message published before `cancel` that arrives later, even after `cancel`."""
        self._graph.enqueue(self, self._topic, message)

    @property
    def subscriptions(self) -> int:
        """Number of subscribers to this topic by name."""
        return len(self._topic.callbacks)

    @property
    def has_internal_subscribers(self) -> bool:
        """Whether a node of the simulation subscribes to this topic by name."""
        return len(self._topic.callbacks) > len(self._topic.external)

    @property
    def causes_actions(self) -> bool:
        """Whether a message may have others follow at its instant, or crosses to another machine.

        Subscribers of other threads respond later, with commands.
        """
        topic = self._topic
        return topic.has_acting_subscribers or self._graph.must_cross(topic.name)

    @property
    def has_external_subscribers(self) -> bool:
        """Whether an external client receives the topic."""
        return bool(self._topic.external)

    @property
    def num_external_subscriptions(self) -> int:
        """Number of external subscriptions so far; a greater number means a new subscriber."""
        return self._topic.num_attached

    def publish_external(self, message: Any) -> None:
        """Passes a message to the external clients, at once; the simulation does not receive it.

        This is for messages that depend on wall time or on the connected clients: nodes, digests
        and recorders must not depend on them.
        """
        if not self.cancelled:
            self._graph.publish_external(self, self._topic, message)

    @property
    def is_latching(self) -> bool:
        """Whether later subscribers receive its last message."""
        return self.latched and not self.cancelled

    def cancel(self) -> None:
        """Stops publishing and discards the latched message."""
        if not self.cancelled:
            self.cancelled = True
            self._graph.remove_publisher(self, self._topic)


class Subscription:
    """A running subscription; `cancel` ends it and calls `left`."""

    def __init__(
        self,
        callbacks: MutableSequence[Any],
        callback: Callback,
        left: Callable[[], None] = lambda: None,
    ) -> None:
        self._callbacks = callbacks
        self._callback = callback
        self._left = left

    def cancel(self) -> None:
        """Stops receiving."""
        if self._callback in self._callbacks:
            self._callbacks.remove(self._callback)
            self._left()
