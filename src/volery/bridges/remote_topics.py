"""What a client of a remote graph publishes and receives there, whatever the protocol."""

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
    """A topic that is received, once for all its mailboxes."""

    msgtype: str
    mailboxes: list[SubscriptionQueue] = field(default_factory=list)
    depth: int = 1
    """The most that a mailbox has asked for."""
    reliable: bool = False
    """Whether a mailbox has asked for it."""


class RemoteTopics(ABC):
    """What was announced and subscribed to, also when there is no connection.

    A subclass has the words of its protocol: the `_tell_...` tell the server of a change, with the
    lock held, and do nothing without a connection; `_send` sends a message.

    Parameters
    ----------
    lock
        Held by whoever changes what the client wants of the server.
    check_type
        Raises `GraphError` for a message type that the graph does not know.

    """

    def __init__(self, lock: threading.RLock, check_type: Callable[[str], None]) -> None:
        self._lock = lock
        self._check_type = check_type
        self._announced: dict[str, tuple[str, bool]] = {}
        self._subscriptions: dict[str, Subscription] = {}

    def repeat_topics(self) -> None:
        """Announce and subscribe everything, on a connection that is new; with the lock held."""
        for topic, (msgtype, latched) in self._announced.items():
            self._tell_advertised(topic, msgtype, latched)
        for topic, subscription in self._subscriptions.items():
            self._tell_subscribed(topic, subscription)

    # ------------------------------------------------------------------------------ publications

    def advertise(self, topic: str, msgtype: str, latched: bool) -> None:
        """Announce a topic. `GraphError` for an unknown type."""
        self._check_type(msgtype)
        with self._lock:
            if self._announced.get(topic) != (msgtype, latched):
                self._announced[topic] = (msgtype, latched)
                self._tell_advertised(topic, msgtype, latched)

    def unadvertise(self, topic: str, who: str) -> None:
        """Take an announcement back. `GraphError` where there was none."""
        with self._lock:
            if self._announced.pop(topic, None) is None:
                raise GraphError(f"{who} does not publish '{topic}'")
            self._tell_unadvertised(topic)

    def published_type(self, topic: str) -> str | None:
        """Announced type of a topic."""
        found = self._announced.get(topic)
        return None if found is None else found[0]

    def publish(self, topic: str, message: Any, who: str) -> None:
        """Send a message of the announced type; without a connection it is dropped."""
        msgtype = self.published_type(topic)
        if msgtype is None:
            raise GraphError(f"{who} has not advertised '{topic}'")
        name = getattr(message, "__msgtype__", None)
        if name != msgtype:
            raise GraphError(f"topic '{topic}' carries {msgtype}, not {name}")
        self._send(topic, message, msgtype)

    @property
    def announced(self) -> tuple[str, ...]:
        """Names of the announced topics."""
        with self._lock:
            return tuple(self._announced)

    # ----------------------------------------------------------------------------- subscriptions

    def subscribe(
        self, topic: str, msgtype: str, depth: int, reliable: bool, wake: Wake
    ) -> SubscriptionQueue:
        """Begin to receive a topic. `GraphError` for an unknown type, or a second one."""
        self._check_type(msgtype)
        check_depth(depth)
        mailbox = SubscriptionQueue(topic, depth, wake, reliable=reliable)
        with self._lock:
            found = self._subscriptions.setdefault(topic, Subscription(msgtype))
            if found.msgtype != msgtype:
                raise GraphError(f"topic '{topic}' carries {found.msgtype}, not {msgtype}")
            found.mailboxes.append(mailbox)
            found.depth = max(found.depth, depth)
            found.reliable = found.reliable or reliable
            self._tell_subscribed(topic, found)
        return mailbox

    def unsubscribe(self, mailbox: SubscriptionQueue) -> None:
        """Receive no more; the server is told with the topic's last mailbox."""
        with self._lock:
            found = self._subscriptions.get(mailbox.topic)
            if found is None or mailbox not in found.mailboxes:
                return
            found.mailboxes.remove(mailbox)
            if not found.mailboxes:
                del self._subscriptions[mailbox.topic]
                self._tell_unsubscribed(mailbox.topic)

    @property
    def mailboxes(self) -> tuple[SubscriptionQueueInfo, ...]:
        """How the subscriptions fare."""
        with self._lock:
            return tuple(m.info for s in self._subscriptions.values() for m in s.mailboxes)

    def _deliver(self, topic: str, decode: Callable[[str], Any]) -> None:
        """Hand a message that has come to who wants it; `decode` makes it, of a type.

        Not called where nobody wants it; the `GraphError` that it raises is the caller's.
        """
        with self._lock:
            found = self._subscriptions.get(topic)
            mailboxes = tuple(found.mailboxes) if found else ()
        if found is None:
            return
        message = decode(found.msgtype)
        published = Published(topic, found.msgtype, stamp_of(message), message)
        for mailbox in mailboxes:
            mailbox.put(published)

    # ------------------------------------------------------------------------------------- words

    @abstractmethod
    def _send(self, topic: str, message: Any, msgtype: str) -> None:
        """Send a message of this type; without a connection count it as dropped."""

    @abstractmethod
    def _tell_advertised(self, topic: str, msgtype: str, latched: bool) -> None:
        """Tell that messages of a type will come."""

    @abstractmethod
    def _tell_unadvertised(self, topic: str) -> None:
        """Tell that no more messages will come."""

    @abstractmethod
    def _tell_subscribed(self, topic: str, subscription: Subscription) -> None:
        """Ask for messages, as many as the subscription says now; it may have been asked before."""

    @abstractmethod
    def _tell_unsubscribed(self, topic: str) -> None:
        """Ask for no more messages."""
