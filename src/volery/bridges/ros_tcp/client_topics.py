"""Publications and subscriptions of one client of a ROS-TCP endpoint."""

from __future__ import annotations

from typing import Any

from volery.bridges.remote_topics import RemoteTopics, Subscription
from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.client_outbox import ClientOutbox
from volery.bridges.ros_tcp.wire import RosTcpFrame
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.cdr import known
from volery.graph.codecs.ros1_names import ros2_name
from volery.graph.service_reply import ServiceReply

QUEUE_SIZE = 100
"""Messages of a topic that the endpoint queues for its subscribers."""


class ClientTopics(RemoteTopics):
    """Advertisements and subscriptions, also without a connection.

    Endpoints without removal keep ended advertisements, and continue to send unsubscribed topics,
    whose messages are ignored.
    """

    def __init__(self, line: ClientOutbox) -> None:
        super().__init__(line.lock, known)
        self._line = line
        self._listings: list[ServiceReply] = []

    def lose(self, why: str) -> None:
        """Fails open requests after the loss of the connection."""
        with self._line.lock:
            listings, self._listings = self._listings, []
        for reply in listings:
            reply.fail(GraphError(why))

    def take(self, frame: RosTcpFrame) -> None:
        """Passes a message to its queues. Raises `GraphError` if it is invalid."""
        self._deliver(
            frame.destination,
            lambda msgtype: self._line.payloads.decode(frame.payload, msgtype),
        )

    # ------------------------------------------------------------------------------------- lists

    def ask_list(self, reply: ServiceReply) -> None:
        """Requests topics and their types; the reply receives a dictionary by name."""
        with self._line.lock:
            if self._line.open:
                self._listings.append(reply)
                self._line.command("topic_list")
                return
        reply.fail(GraphError("there is no connection"))

    def take_list(self, fields: dict[str, Any]) -> None:
        """Answers all requests for the list. Raises `BridgeError` if the list is invalid."""
        try:
            pairs = zip(fields["topics"], fields["types"], strict=True)
            found = {str(topic): ros2_name(msgtype) for topic, msgtype in sorted(pairs)}
        except (KeyError, TypeError, ValueError, GraphError) as error:
            self.lose(f"the endpoint's list of topics is invalid: {error}")
            raise BridgeError(f"topic_list: {error}") from None
        with self._line.lock:
            listings, self._listings = self._listings, []
        for reply in listings:
            reply.answer(found)

    # ------------------------------------------------------------------------------------- words

    def _send(self, topic: str, message: Any, msgtype: str) -> None:
        if not self._line.open:
            self._line.dropped += 1
            return
        self._line.message(topic, self._line.payloads.encode(message, msgtype))

    def _send_advertised(self, topic: str, msgtype: str, latched: bool) -> None:
        self._line.command(
            "publish",
            topic=topic,
            message_name=self._line.payloads.short(msgtype),
            queue_size=QUEUE_SIZE,
            latch=latched,
        )

    def _send_unadvertised(self, topic: str) -> None:
        self._remove("publisher", topic)

    def _send_subscribed(self, topic: str, subscription: Subscription) -> None:
        fields: dict[str, Any] = {"message_name": self._line.payloads.short(subscription.msgtype)}
        if ros_tcp.QUEUE_SIZE in self._line.features:
            fields["queue_size"] = 0 if subscription.reliable else subscription.depth
        self._line.command("subscribe", topic=topic, **fields)

    def _send_unsubscribed(self, topic: str) -> None:
        self._remove("subscriber", topic)

    def _remove(self, what: str, topic: str) -> None:
        if ros_tcp.REMOVE in self._line.features:
            self._line.command(f"remove_{what}", topic=topic)
