"""What a program needs of a graph that lies elsewhere, whoever carries the messages."""

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
    """One client's connection to a graph; the nearest one is `graph.session.Session`.

    This is the contract of all of them; an implementation documents only what it adds. Any thread
    may call any method; replies and wakes come from a thread of the link. `advertise`, `subscribe`
    and `offer` raise `GraphError` for a wrong type, and once the link is closed.
    """

    name: str

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announce that this client publishes on `topic`; a second call replaces the type."""

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message of the announced type. `GraphError` where none was announced."""

    def unadvertise(self, topic: str) -> None:
        """Publish on `topic` no more. `GraphError` where it was not announced."""

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Receive the messages of `topic` in the mailbox that is returned.

        Parameters
        ----------
        topic
            Absolute name.
        msgtype
            None: the type that the topic has; `GraphError` where the topic does not exist.
        depth, reliable
            How many messages wait, and what happens to more: see `SubscriptionQueue`. The newest
            message of each latched publisher is the first.
        wake
            Called from a thread of the link when a message comes to an empty mailbox. It must not
            block.

        """

    def unsubscribe(self, mailbox: SubscriptionQueue) -> None:
        """Receive no more; messages that wait can still be taken."""

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Call a service; `reply` gets the response or a `GraphError`, in another thread.

        Without a request the service gets an empty one.
        """

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """Serve `service`: `handler(request, reply)` is called in a thread of the link."""

    def close(self) -> None:
        """End all publishers, subscriptions, calls and services of this client."""


@runtime_checkable
class TellsTopics(Protocol):
    """A link whose own protocol tells what topics there are."""

    def topic_types(self) -> dict[str, str]:
        """Topics of the graph and their types, by name. `GraphError` where no answer comes."""


@runtime_checkable
class TellsServices(Protocol):
    """A link whose own protocol tells what services there are."""

    def service_types(self) -> dict[str, str]:
        """Services of the graph and their types, by name. `GraphError` where no answer comes."""


@runtime_checkable
class HostsNodes(Protocol):
    """A link on which a node is seen by its own name, with its parameters."""

    def host_node(self, name: str, parameters: Parameters, post: Callable[[Any], Any]) -> None:
        """Be this node; parameters are set by what is handed to `post`."""


def call_and_wait(
    link: GraphConnection, service: str, request: Any | None, timeout_s: float
) -> Any:
    """Call a service and wait for its response, at most `timeout_s` of wall time.

    Not for the thread from which the link's replies come. `GraphError` with the reason where there
    is no response.
    """
    come = threading.Event()
    outcome: list[Any] = []

    def take(what: Any) -> None:
        outcome.append(what)
        come.set()

    link.call(service, request, ServiceReply(take, take))
    if not come.wait(timeout_s):
        raise GraphError(f"service '{service}' did not answer within {timeout_s:g} s")
    if isinstance(outcome[0], GraphError):
        raise outcome[0]
    return outcome[0]
