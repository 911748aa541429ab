"""Defines the connection of a program to a graph in another thread or process."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

from volery.core.errors import GraphError
from volery.graph.parameters import Parameters
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler
from volery.graph.subscription_queue import SubscriptionQueue, Wake


class GraphConnection(Protocol):
    """One client's connection to a graph; in the same process, `graph.session.Session`.

    This protocol is the contract; implementations document only what they add. Any thread may call
    any method; replies and wakes come from a thread of the connection. `advertise`, `subscribe` and
    `create_service` raise `GraphError` for a wrong type, and after the connection is closed.
    """

    name: str

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announces that this client publishes on `topic`; a second call replaces the type."""

    def publish(self, topic: str, message: Any) -> None:
        """Publishes a message of the advertised type; raises `GraphError` if there is none."""

    def unadvertise(self, topic: str) -> None:
        """Stops publishing on `topic`. Raises `GraphError` if it was not advertised."""

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Subscribes to `topic` and returns the queue of its messages.

        Parameters
        ----------
        topic
            Absolute name.
        msgtype
            None: the type of the topic; raises `GraphError` if the topic does not exist.
        depth, reliable
            Length of the queue, and the handling of more messages: see `SubscriptionQueue`. The
            queue starts with the newest message of each latched publisher.
        wake
            Called from a thread of the connection when a message joins an empty queue. It must not
            block.

        """

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Ends a subscription; messages in its queue can still be taken."""

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; `reply` gets the response or a `GraphError`, in another thread.

        Without a request, the service receives an empty one.
        """

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates `service`: `handler(request, reply)` is called in a thread of the connection."""

    def close(self) -> None:
        """Ends all publishers, subscriptions, calls and services of this client."""


@runtime_checkable
class ListsTopics(Protocol):
    """A connection whose protocol lists the topics."""

    def topic_types(self) -> dict[str, str]:
        """Returns the types of all topics by name. Raises `GraphError` without a response."""


@runtime_checkable
class ListsServices(Protocol):
    """A connection whose protocol lists the services."""

    def service_types(self) -> dict[str, str]:
        """Returns the types of all services by name. Raises `GraphError` without a response."""


@runtime_checkable
class HostsNodes(Protocol):
    """A connection on which a node appears under its own name, with its parameters."""

    def host_node(self, name: str, parameters: Parameters, post: Callable[[Any], Any]) -> None:
        """Makes the connection appear as this node; passes `post` the setting of parameters."""


def call_and_wait(
    link: GraphConnection, service: str, request: Any | None, timeout_s: float
) -> Any:
    """Calls a service and waits for its response, at most `timeout_s` of wall time.

    Must not be called in the thread that delivers the connection's replies. Raises `GraphError`
    with the reason if there is no response.
    """
    come = threading.Event()
    outcome: list[Any] = []

    def take(what: Any) -> None:
        outcome.append(what)
        come.set()

    link.call(service, request, ServiceReply(take, take))
    if not come.wait(timeout_s):
        raise GraphError(f"service '{service}' did not respond within {timeout_s:g} s")
    if isinstance(outcome[0], GraphError):
        raise outcome[0]
    return outcome[0]
