"""Topics of one client of a ROS-TCP endpoint: what it publishes and what it receives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.client_line import Line
from volery.bridges.ros_tcp.wire import Frame
from volery.core.errors import BridgeError, GraphError
from volery.graph.cdr import known
from volery.graph.mailbox import Mailbox, MailboxInfo, Wake
from volery.graph.messages import Published, stamp_of
from volery.graph.qos import check_depth
from volery.graph.reply import Reply
from volery.graph.ros1_names import ros2_name

QUEUE_SIZE = 100
"""Messages of a topic that the endpoint lets wait for whom it passes them on to."""


@dataclass
class _Subscription:
    msgtype: str
    mailboxes: list[Mailbox] = field(default_factory=list)
    depth: int = 1
    reliable: bool = False


class ClientTopics:
    """What was announced and subscribed to, also when there is no connection."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._announced: dict[str, tuple[str, bool]] = {}
        self._subscriptions: dict[str, _Subscription] = {}
        self._listings: list[Reply] = []

    def repeat(self) -> None:
        """Announce and subscribe everything, on a connection that is new."""
        for topic, (msgtype, latched) in self._announced.items():
            self._announce(topic, msgtype, latched)
        for topic, subscription in self._subscriptions.items():
            self._subscribe(topic, subscription)

    def lose(self, why: str) -> None:
        """The connection is gone: nobody answers any more what was asked."""
        with self._line.lock:
            listings, self._listings = self._listings, []
        for reply in listings:
            reply.fail(GraphError(why))

    # ------------------------------------------------------------------------------ publications

    def advertise(self, topic: str, msgtype: str, latched: bool) -> None:
        """Announce a topic. `GraphError` for an unknown type."""
        known(msgtype)
        with self._line.lock:
            if self._announced.get(topic) != (msgtype, latched):
                self._announced[topic] = (msgtype, latched)
                self._announce(topic, msgtype, latched)

    def unadvertise(self, topic: str, who: str) -> None:
        """Take an announcement back; endpoints that cannot be told so keep it."""
        with self._line.lock:
            if self._announced.pop(topic, None) is None:
                raise GraphError(f"{who} does not publish '{topic}'")
            self._remove("publisher", topic)

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
        if not self._line.open:
            self._line.dropped += 1
            return
        self._line.message(topic, self._line.payloads.encode(message, msgtype))

    # ----------------------------------------------------------------------------- subscriptions

    def subscribe(
        self, topic: str, msgtype: str, depth: int, reliable: bool, wake: Wake
    ) -> Mailbox:
        """Begin to receive a topic. `GraphError` for an unknown type, or a second one."""
        known(msgtype)
        check_depth(depth)
        mailbox = Mailbox(topic, depth, wake, reliable=reliable)
        with self._line.lock:
            found = self._subscriptions.setdefault(topic, _Subscription(msgtype))
            if found.msgtype != msgtype:
                raise GraphError(f"topic '{topic}' carries {found.msgtype}, not {msgtype}")
            found.mailboxes.append(mailbox)
            found.depth = max(found.depth, depth)
            found.reliable = found.reliable or reliable
            self._subscribe(topic, found)
        return mailbox

    def unsubscribe(self, mailbox: Mailbox) -> None:
        """Receive no more; what an endpoint that cannot be told so sends is passed over."""
        with self._line.lock:
            found = self._subscriptions.get(mailbox.topic)
            if found is None or mailbox not in found.mailboxes:
                return
            found.mailboxes.remove(mailbox)
            if not found.mailboxes:
                del self._subscriptions[mailbox.topic]
                self._remove("subscriber", mailbox.topic)

    def take(self, frame: Frame) -> None:
        """Hand a message to who wants it. `GraphError` where it is none."""
        with self._line.lock:
            found = self._subscriptions.get(frame.destination)
            mailboxes = tuple(found.mailboxes) if found else ()
        if found is None:
            return
        message = self._line.payloads.decode(frame.payload, found.msgtype)
        published = Published(frame.destination, found.msgtype, stamp_of(message), message)
        for mailbox in mailboxes:
            mailbox.put(published)

    @property
    def info(self) -> tuple[tuple[str, ...], tuple[MailboxInfo, ...]]:
        """Announced topics, and how the subscriptions fare."""
        with self._line.lock:
            boxes = [m.info for s in self._subscriptions.values() for m in s.mailboxes]
            return tuple(self._announced), tuple(boxes)

    # ------------------------------------------------------------------------------------- lists

    def ask_list(self, reply: Reply) -> None:
        """Ask for topics and their types; the reply gets a dictionary by name."""
        with self._line.lock:
            if self._line.open:
                self._listings.append(reply)
                self._line.command("topic_list")
                return
        reply.fail(GraphError("there is no connection"))

    def take_list(self, fields: dict[str, Any]) -> None:
        """Answer everybody who asked. `BridgeError` where the list is none."""
        try:
            pairs = zip(fields["topics"], fields["types"], strict=True)
            found = {str(topic): ros2_name(msgtype) for topic, msgtype in sorted(pairs)}
        except (KeyError, TypeError, ValueError, GraphError) as error:
            self.lose(f"the endpoint's list of topics makes no sense: {error}")
            raise BridgeError(f"topic_list: {error}") from None
        with self._line.lock:
            listings, self._listings = self._listings, []
        for reply in listings:
            reply.answer(found)

    # ------------------------------------------------------------------------------------- words

    def _announce(self, topic: str, msgtype: str, latched: bool) -> None:
        self._line.command(
            "publish",
            topic=topic,
            message_name=self._line.payloads.short(msgtype),
            queue_size=QUEUE_SIZE,
            latch=latched,
        )

    def _subscribe(self, topic: str, subscription: _Subscription) -> None:
        fields: dict[str, Any] = {"message_name": self._line.payloads.short(subscription.msgtype)}
        if ros_tcp.QUEUE_SIZE in self._line.features:
            fields["queue_size"] = 0 if subscription.reliable else subscription.depth
        self._line.command("subscribe", topic=topic, **fields)

    def _remove(self, what: str, topic: str) -> None:
        if ros_tcp.REMOVE in self._line.features:
            self._line.command(f"remove_{what}", topic=topic)
