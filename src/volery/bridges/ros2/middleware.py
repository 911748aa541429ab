"""Interface of a middleware for the bridge and nodes: the endpoints of one ROS 2 participant.

A participant belongs to one process and may hold several nodes. Bytes that cross this interface are
CDR with its header, of plain messages, without the middleware's additions to requests. Any thread
may call the methods; callbacks run in threads of the participant.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

from volery.bridges.ros2.names import NodeName

DEFAULT_DEPTH = 10


class Profile(NamedTuple):
    """Quality of service of a publisher or subscription, as far as it varies in practice."""

    reliable: bool = True
    latched: bool = False
    """Durability: transient local."""
    depth: int = DEFAULT_DEPTH
    """History: keep last, always."""


class TopicSpec(NamedTuple):
    """One publisher or subscription."""

    node: NodeName
    topic: str
    msgtype: str
    profile: Profile = Profile()


class ServiceSpec(NamedTuple):
    """One server or client of a service."""

    node: NodeName
    service: str
    srvtype: str
    """`std_srvs/srv/Trigger`, or a service of an action: `pkg/action/Name_SendGoal`."""


class RemotePublisher(NamedTuple):
    """A publisher of another participant."""

    topic: str
    msgtype: str
    profile: Profile
    type_hash: str | None = None
    """None if unknown."""


class Handle(Protocol):
    """An endpoint that is active until it is closed."""

    def close(self) -> None:
        """Closes the endpoint; further calls do nothing."""


class Writer(Handle, Protocol):
    """A publisher."""

    def write(self, cdr: bytes) -> None:
        """Sends one message, as CDR; never waits for a subscriber."""

    @property
    def matched(self) -> bool:
        """Whether the topic has subscribers."""


Answer = Callable[[bytes], None]
"""Sends the response of one request."""
TakeMessage = Callable[[bytes], None]
TakeRequest = Callable[[bytes, Answer], None]


class Caller(Handle, Protocol):
    """A client of a service."""

    @property
    def ready(self) -> bool:
        """Whether the service has a server."""

    @property
    def problem(self) -> str:
        """Why a connected server does not answer; empty if unknown."""

    def call(self, request: bytes, on_response: TakeMessage, on_loss: Callable[[], None]) -> None:
        """Sends a request; calls one of the two once, `on_loss` if the server has left."""


class Participant(Protocol):
    """One process's participant in a ROS 2 graph."""

    @property
    def where(self) -> str:
        """Middleware and domain, for messages."""

    def add_node(self, node: NodeName) -> None:
        """Adds a node."""

    def remove_node(self, node: NodeName) -> None:
        """Removes a node; its endpoints are closed by their owners."""

    def announce(self) -> None:
        """Publishes changes of nodes and endpoints, if the middleware does not do so at once."""

    def writer(self, spec: TopicSpec) -> Writer:
        """Creates a publisher."""

    def reader(self, spec: TopicSpec, take: TakeMessage) -> Handle:
        """Creates a subscription, which does not receive this participant's own messages."""

    def server(self, spec: ServiceSpec, take: TakeRequest) -> Handle:
        """Creates a service."""

    def caller(self, spec: ServiceSpec) -> Caller:
        """Creates a client of a service."""

    def publishers(self) -> list[RemotePublisher]:
        """Returns publishers of others."""

    def topic_types(self) -> Mapping[str, str]:
        """Returns topics that others publish or subscribe to, and their types."""

    def service_types(self) -> Mapping[str, str]:
        """Returns services of others, and their types."""

    def when_changed(self, callback: Callable[[], None]) -> None:
        """Calls `callback` when others appear or leave."""

    def close(self) -> None:
        """Leaves the graph."""
