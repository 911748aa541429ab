"""What a node holds on a graph, in the shape of rclpy's handles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.graph.graph import Publisher, Subscription
from volery.graph.message_copies import message_copier
from volery.graph.nodes.deferred_execution import DeferredExecutor


class NodePublisher(Publisher):
    """Publishes copies: the node may go on with a message, as after rclpy has written it out.

    What a node with a latency publishes in a callback leaves when the callback's time is up.
    """

    def __init__(self, publisher: Publisher, thinker: DeferredExecutor | None) -> None:
        self._publisher = publisher
        self._thinker = thinker
        self._copy = message_copier(publisher.msgtype)
        self.latched = publisher.latched

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self._publisher.topic

    @property
    def topic_name(self) -> str:
        """Name of the topic."""
        return self._publisher.topic

    @property
    def msgtype(self) -> str:
        """Type of its messages."""
        return self._publisher.msgtype

    @property
    def wanted(self) -> bool:
        """Whether anybody would receive a message; what is not wanted need not be built."""
        return self._publisher.wanted

    def get_subscription_count(self) -> int:
        """How many subscribe to the topic."""
        return self._publisher.subscriptions

    def publish(self, message: Any) -> None:
        """Publish a message. `GraphError` for one of another type."""
        publisher = self._publisher
        if publisher.wanted:
            publisher.check(message)
            message = self._copy(message)
        if self._thinker is None or not self._thinker.hold_back(lambda: publisher.publish(message)):
            publisher.publish(message)

    def cancel(self) -> None:
        """Publish no more."""
        self._publisher.cancel()

    def destroy(self) -> None:
        """Publish no more."""
        self._publisher.cancel()


class NodeSubscription:
    """A subscription of a node."""

    def __init__(
        self, subscription: Subscription, topic: str, callback: Callable[[Any], Any]
    ) -> None:
        self._subscription = subscription
        self.topic = topic
        self.callback = callback

    @property
    def topic_name(self) -> str:
        """Name of the topic."""
        return self.topic

    def cancel(self) -> None:
        """Stop receiving."""
        self._subscription.cancel()

    def destroy(self) -> None:
        """Stop receiving."""
        self._subscription.cancel()


class NodeService:
    """A service that a node offers."""

    def __init__(self, name: str, srv_type: str, withdraw: Callable[[], None]) -> None:
        self.srv_name = self.service_name = name
        self.srv_type = srv_type
        self._withdraw = withdraw

    def destroy(self) -> None:
        """Offer it no more."""
        self._withdraw()
