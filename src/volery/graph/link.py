"""What a program needs of a graph that lies elsewhere, whoever carries the messages."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

from volery.core.errors import GraphError
from volery.graph.mailbox import Mailbox, Wake
from volery.graph.parameters import Parameters
from volery.graph.reply import Reply
from volery.graph.session import Handler


class Link(Protocol):
    """One client's part in a graph; see `graph.session.Session`, which is the nearest one.

    All methods may be called by any thread; replies and wakes come from the link's own.
    """

    name: str

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announce that messages will be published on `topic`."""

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message of the announced type."""

    def unadvertise(self, topic: str) -> None:
        """Publish on `topic` no more."""

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = ...,
        reliable: bool = ...,
        wake: Wake,
    ) -> Mailbox:
        """Begin to receive `topic`."""

    def unsubscribe(self, mailbox: Mailbox) -> None:
        """Receive no more."""

    def call(self, service: str, request: Any | None, reply: Reply) -> None:
        """Call a service of the graph."""

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """Offer a service to the graph."""

    def close(self) -> None:
        """Take back everything."""


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


def call_and_wait(link: Link, service: str, request: Any | None, timeout_s: float) -> Any:
    """Call a service and wait for its response, at most `timeout_s` of wall time.

    Not for the thread from which the link's replies come. `GraphError` with the reason where there
    is no response.
    """
    come = threading.Event()
    outcome: list[Any] = []

    def take(what: Any) -> None:
        outcome.append(what)
        come.set()

    link.call(service, request, Reply(take, take))
    if not come.wait(timeout_s):
        raise GraphError(f"service '{service}' did not answer within {timeout_s:g} s")
    if isinstance(outcome[0], GraphError):
        raise outcome[0]
    return outcome[0]
