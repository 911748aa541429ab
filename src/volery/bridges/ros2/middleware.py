"""What the bridge and nodes need of a middleware: the endpoints of one ROS 2 participant.

A participant is one process's part in the graph and may hold several nodes. Bytes that cross this
line are CDR with its header, of plain messages: what a middleware adds to requests stays behind it.
All methods may be called by any thread; what comes in is told in threads of the participant's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

from volery.bridges.ros2.names import NodeName

DEFAULT_DEPTH = 10


class Profile(NamedTuple):
    """Quality of service of a publisher or subscription, as far as the field varies it."""

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
    """A publisher of somebody else."""

    topic: str
    msgtype: str
    profile: Profile
    type_hash: str | None = None
    """None where it does not tell."""


class Handle(Protocol):
    """Something that takes part in the graph until it is closed."""

    def close(self) -> None:
        """Leave; a second time nothing happens."""


class Writer(Handle, Protocol):
    """A publisher."""

    def write(self, cdr: bytes) -> None:
        """Send one message; never waits for a subscriber."""

    @property
    def matched(self) -> bool:
        """Whether anybody subscribes."""


Answer = Callable[[bytes], None]
"""Sends the response of one request."""
TakeMessage = Callable[[bytes], None]
TakeRequest = Callable[[bytes, Answer], None]


class Caller(Handle, Protocol):
    """A client of a service."""

    @property
    def ready(self) -> bool:
        """Whether a server is there."""

    @property
    def problem(self) -> str:
        """Why nobody answers though a server is there; empty where that is not known."""

    def call(self, request: bytes, on_response: TakeMessage, on_loss: Callable[[], None]) -> None:
        """Send a request; one of the two is called once, the second if the server has left."""


class Participant(Protocol):
    """One process's part in a ROS 2 graph."""

    @property
    def where(self) -> str:
        """Middleware and domain, for people."""

    def add_node(self, node: NodeName) -> None:
        """Have a node appear."""

    def remove_node(self, node: NodeName) -> None:
        """Have a node disappear; its endpoints are closed by whoever made them."""

    def announce(self) -> None:
        """Tell others of nodes and endpoints that came and went, where that is not told at once."""

    def writer(self, spec: TopicSpec) -> Writer:
        """Publish."""

    def reader(self, spec: TopicSpec, take: TakeMessage) -> Handle:
        """Subscribe; what this participant itself publishes does not come."""

    def server(self, spec: ServiceSpec, take: TakeRequest) -> Handle:
        """Offer a service."""

    def caller(self, spec: ServiceSpec) -> Caller:
        """Become a client of a service."""

    def publishers(self) -> list[RemotePublisher]:
        """Publishers of others."""

    def topic_types(self) -> Mapping[str, str]:
        """Topics that others publish or subscribe to, and their types."""

    def service_types(self) -> Mapping[str, str]:
        """Services that others offer, and their types."""

    def when_changed(self, tell: Callable[[], None]) -> None:
        """Have `tell` called when others come or go."""

    def close(self) -> None:
        """Leave the graph with everything."""
