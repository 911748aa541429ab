"""Provides a node's publishers, subscriptions and services, with the interface of rclpy."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, NamedTuple, Self

from volery.graph.codecs.cdr import decode_cdr
from volery.graph.message_copies import message_checker, message_copier
from volery.graph.messages import message_type
from volery.graph.nodes.deferred_execution import DeferredExecutor
from volery.graph.nodes.qos_events import configure_introspection
from volery.graph.qos import QoSProfile
from volery.graph.topics import Publisher, Subscription

Callback = Callable[..., Any]


class NodeEndpoints(NamedTuple):
    """Full names of the topics and services that a node uses at present."""

    publishes: frozenset[str]
    subscribes: frozenset[str]
    serves: frozenset[str]
    calls: frozenset[str]


class Handle:
    """A handle that a `with` statement destroys, as in rclpy."""

    def destroy(self) -> None:
        """Destroys what the handle stands for."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.destroy()


class NodePublisher(Publisher, Handle):
    """Publishes copies of messages, so that the node may change a message after publishing it.

    Messages that a node with a latency publishes in a callback leave when the latency has passed.
    """

    def __init__(
        self, publisher: Publisher, executor: DeferredExecutor | None, qos_profile: QoSProfile
    ) -> None:
        self._publisher = publisher
        self.qos_profile = qos_profile
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

    def wait_for_all_acked(self, timeout: Any = None) -> bool:  # noqa: ARG002
        """Returns True: inside the simulation no message is lost."""
        return True

    def cancel(self) -> None:
        """Stops publishing."""
        self._publisher.cancel()

    destroy = cancel


class NodeSubscription(Handle):
    """A subscription of a node; `callback` may be replaced, as in rclpy."""

    def __init__(
        self,
        topic: str,
        msg_type: type[Any],
        callback: Callback,
        qos_profile: QoSProfile,
        num_publishers: Callable[[], int],
    ) -> None:
        self.topic = topic
        self.msg_type = msg_type
        self.qos_profile = qos_profile
        self._num_publishers = num_publishers
        self._subscription: Subscription | None = None
        self._wants_info = False
        self.callback = callback

    @property
    def callback(self) -> Callback:
        """Receives the message, or the message and a dict of its times."""
        return self._callback

    @callback.setter
    def callback(self, callback: Callback) -> None:
        self._callback = callback
        self._wants_info = not _accepts(callback, 1) and _accepts(callback, 2)

    def attach(self, subscription: Subscription) -> None:
        """Sets the subscription of the graph, which `cancel` ends."""
        self._subscription = subscription

    def call(self, message: Any, source_ns: int, received_ns: int) -> Any:
        """Calls the callback; times of publication and arrival, ns, are rclpy's message info."""
        if not self._wants_info:
            return self._callback(message)
        info = {
            "source_timestamp": source_ns,
            "received_timestamp": received_ns,
            "publication_sequence_number": None,
            "reception_sequence_number": None,
        }
        return self._callback(message, info)

    def get_publisher_count(self) -> int:
        """Returns the number of publishers of the topic."""
        return self._num_publishers()

    @property
    def topic_name(self) -> str:
        """Name of the topic."""
        return self.topic

    def cancel(self) -> None:
        """Stops receiving."""
        if self._subscription is not None:
            self._subscription.cancel()

    destroy = cancel


class NodeService(Handle):
    """A service of a node."""

    def __init__(self, name: str, srv_type: str, withdraw: Callable[[], None]) -> None:
        self.srv_name = self.service_name = name
        self.srv_type = srv_type
        self._withdraw = withdraw

    configure_introspection = staticmethod(configure_introspection)

    def destroy(self) -> None:
        """Destroys the service."""
        self._withdraw()


def _accepts(callback: Callback, count: int) -> bool:
    """Returns whether a callback may be called with `count` arguments; True if it does not say."""
    try:
        inspect.signature(callback).bind(*[None] * count)
    except TypeError:
        return False
    except ValueError:  # a function of C
        return True
    return True
