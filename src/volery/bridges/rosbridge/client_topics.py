"""Publications and subscriptions of a remote client, independent of the protocol."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from volery.core.errors import GraphError
from volery.graph.messages import Published, stamp_of
from volery.graph.qos import check_depth
from volery.graph.subscription_queue import SubscriptionQueue, SubscriptionQueueInfo, Wake


@dataclass
class Subscription:
    """A topic's subscription, shared by all its queues."""

    msgtype: str
    queues: list[SubscriptionQueue] = field(default_factory=list)
    depth: int = 1
    """Largest depth of its queues."""
    reliable: bool = False
    """Whether a queue has requested reliable delivery."""


class RemoteTopics(ABC):
    """Holds advertisements and subscriptions, also without a connection.

    A subclass implements the protocol: the `_send_...` methods send a change to the server, with
    the lock held, and do nothing without a connection; `_send` sends a message.

    Parameters
    ----------
    lock
        Held during changes of advertisements and subscriptions.
    check_type
        Raises `GraphError` for an unknown message type.

    """

    def __init__(self, lock: threading.RLock, check_type: Callable[[str], None]) -> None:
        self._lock = lock
        self._check_type = check_type
        self._announced: dict[str, tuple[str, bool]] = {}
        self._subscriptions: dict[str, Subscription] = {}

    def repeat_topics(self) -> None:
        """Repeats all advertisements and subscriptions on a new connection; needs the lock."""
        for topic, (msgtype, latched) in self._announced.items():
            self._send_advertised(topic, msgtype, latched)
        for topic, subscription in self._subscriptions.items():
            self._send_subscribed(topic, subscription)

    # ------------------------------------------------------------------------------ publications

    def advertise(self, topic: str, msgtype: str, latched: bool) -> None:
        """Advertises a topic. Raises `GraphError` for an unknown type.

        A latched topic stays so until `unadvertise`.
        """
        self._check_type(msgtype)
        with self._lock:
            latched = latched or self._announced.get(topic, ("", False))[1]
            if self._announced.get(topic) != (msgtype, latched):
                self._announced[topic] = (msgtype, latched)
                self._send_advertised(topic, msgtype, latched)

    def unadvertise(self, topic: str, client_name: str) -> None:
        """Ends an advertisement. Raises `GraphError` if there was none."""
        with self._lock:
            if self._announced.pop(topic, None) is None:
                raise GraphError(f"{client_name} does not publish '{topic}'")
            self._send_unadvertised(topic)

    def published_type(self, topic: str) -> str | None:
        """Returns the advertised type of a topic."""
        found = self._announced.get(topic)
        return None if found is None else found[0]

    def publish(self, topic: str, message: Any, client_name: str) -> None:
        """Sends a message of the advertised type; drops it without a connection."""
        msgtype = self.published_type(topic)
        if msgtype is None:
            raise GraphError(f"{client_name} has not advertised '{topic}'")
        name = getattr(message, "__msgtype__", None)
        if name != msgtype:
            raise GraphError(f"topic '{topic}' carries {msgtype}, not {name}")
        self._send(topic, message, msgtype)

    @property
    def announced(self) -> tuple[str, ...]:
        """Names of the advertised topics."""
        with self._lock:
            return tuple(self._announced)

    # ----------------------------------------------------------------------------- subscriptions

    def subscribe(
        self, topic: str, msgtype: str, depth: int, reliable: bool, wake: Wake
    ) -> SubscriptionQueue:
        """Subscribes to a topic. Raises `GraphError` for an unknown or a second type."""
        self._check_type(msgtype)
        check_depth(depth)
        queue = SubscriptionQueue(topic, depth, wake, reliable=reliable)
        with self._lock:
            found = self._subscriptions.setdefault(topic, Subscription(msgtype))
            if found.msgtype != msgtype:
                raise GraphError(f"topic '{topic}' carries {found.msgtype}, not {msgtype}")
            found.queues.append(queue)
            found.depth = max(found.depth, depth)
            found.reliable = found.reliable or reliable
            self._send_subscribed(topic, found)
        return queue

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Ends a queue's subscription; the last one of a topic also ends that of the server."""
        with self._lock:
            found = self._subscriptions.get(queue.topic)
            if found is None or queue not in found.queues:
                return
            found.queues.remove(queue)
            if not found.queues:
                del self._subscriptions[queue.topic]
                self._send_unsubscribed(queue.topic)

    @property
    def queues(self) -> tuple[SubscriptionQueueInfo, ...]:
        """State of the subscriptions."""
        with self._lock:
            return tuple(m.info for s in self._subscriptions.values() for m in s.queues)

    def _deliver(self, topic: str, decode: Callable[[str], Any]) -> None:
        """Passes a received message to its queues; `decode` decodes it for a type.

        Does not call `decode` without queues; its `GraphError` passes to the caller.
        """
        with self._lock:
            found = self._subscriptions.get(topic)
            queues = tuple(found.queues) if found else ()
        if found is None:
            return
        message = decode(found.msgtype)
        published = Published(topic, found.msgtype, stamp_of(message), message)
        for queue in queues:
            queue.put(published)

    # ------------------------------------------------------------------------------------- words

    @abstractmethod
    def _send(self, topic: str, message: Any, msgtype: str) -> None:
        """Sends a message of this type; without a connection counts it as dropped."""

    @abstractmethod
    def _send_advertised(self, topic: str, msgtype: str, latched: bool) -> None:
        """Sends an advertisement."""

    @abstractmethod
    def _send_unadvertised(self, topic: str) -> None:
        """Sends the end of an advertisement."""

    @abstractmethod
    def _send_subscribed(self, topic: str, subscription: Subscription) -> None:
        """Subscribes with the subscription's current options; may repeat an earlier request."""

    @abstractmethod
    def _send_unsubscribed(self, topic: str) -> None:
        """Unsubscribes."""
