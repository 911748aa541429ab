"""Provides a node's publishers, subscriptions and services, with the interface of rclpy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.graph.codecs.cdr import decode_cdr
from volery.graph.message_copies import message_checker, message_copier
from volery.graph.messages import message_type
from volery.graph.nodes.deferred_execution import DeferredExecutor
from volery.graph.nodes.qos_events import configure_introspection
from volery.graph.topics import Publisher, Subscription


class NodePublisher(Publisher):
    """Publishes copies of messages, so that the node may change a message after publishing it.

    Messages that a node with a latency publishes in a callback leave when the latency has passed.
    """

    def __init__(self, publisher: Publisher, executor: DeferredExecutor | None) -> None:
        self._publisher = publisher
        self._executor = executor
        self._copy = message_copier(publisher.msgtype)
        self._check = message_checker(publisher.msgtype)
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
        """Type of the messages."""
        return self._publisher.msgtype

    @property
    def msg_type(self) -> type[Any]:
        """Class of the messages."""
        return message_type(self._publisher.msgtype)

    @property
    def has_subscribers(self) -> bool:
        """Whether a message would be delivered or latched; otherwise it need not be built."""
        return self._publisher.has_subscribers

    def get_subscription_count(self) -> int:
        """Returns the number of subscribers to the topic."""
        return self._publisher.subscriptions

    def publish(self, message: Any) -> None:
        """Publishes a message.

        Raises `GraphError` if its type is not the topic's, or the type of a value not its field's,
        also without subscribers: otherwise the error would come with the first recording. Bytes are
        a message in CDR.
        """
        publisher = self._publisher
        if isinstance(message, bytes):
            message = decode_cdr(message, publisher.msgtype)
        publisher.check(message)
        if publisher.has_subscribers:
            message = self._copy(message)
        else:
            self._check(message)
        if self._executor is None or not self._executor.defer(lambda: publisher.publish(message)):
            publisher.publish(message)

    def assert_liveliness(self) -> None:
        """Does nothing: no publisher loses its liveliness."""

    def cancel(self) -> None:
        """Stops publishing."""
        self._publisher.cancel()

    destroy = cancel


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
        """Stops receiving."""
        self._subscription.cancel()

    destroy = cancel


class NodeService:
    """A service of a node."""

    def __init__(self, name: str, srv_type: str, withdraw: Callable[[], None]) -> None:
        self.srv_name = self.service_name = name
        self.srv_type = srv_type
        self._withdraw = withdraw

    configure_introspection = staticmethod(configure_introspection)

    def destroy(self) -> None:
        """Destroys the service."""
        self._withdraw()
