"""A program's part in a graph that a server elsewhere offers, over a connection that is kept.

It has the methods and the meaning of `graph.session.Session`. When the connection breaks it comes
back by itself, and announces, subscribes to and offers everything again.
"""

from __future__ import annotations

import asyncio
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import Any, ClassVar, Protocol, TypeVar

from volery.bridges.remote_topics import RemoteTopics
from volery.core.errors import BridgeError, GraphError, UnreachableError
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler
from volery.graph.subscription_queue import SubscriptionQueue, Wake

T = TypeVar("T")

_ANSWER_TIMEOUT_S = 5.0


class RemoteServices(Protocol):
    """Services that a client calls and offers, also when there is no connection."""

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Call a service; without a request the server is asked for its type first."""

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """Offer a service. `GraphError` for an unknown type, or if it is offered already."""

    def withdraw(self, service: str, who: str) -> None:
        """Offer a service no more; its open requests fail. `GraphError` if it was not offered."""


class RemoteClient(ABC):
    """One program's part in a remote graph. All methods may be called by any thread.

    It has an asyncio loop in a thread of its own; wakes, replies and requests come from there.

    A subclass says `_PROTOCOL` and `_SERVER`, sets `_topics` and `_services` before it calls
    `_start`, the last step of its `__init__`, and has the abstract methods. Of these
    `_keep_connected`, in the loop, calls `_joined` when a connection stands and everything has
    been asked for, `_lose` when it is gone, and keeps in `_why` what made it fail.

    Parameters
    ----------
    name
        Who it is, for people.
    where
        Address of the server, for people.

    """

    _PROTOCOL: ClassVar[str]
    """Its name, as people write it; in small letters it ends the thread's name."""
    _SERVER: ClassVar[str]
    """What people call a server of the protocol."""

    _topics: RemoteTopics
    """What is published and received, told to the server with every connection anew."""
    _services: RemoteServices
    """What is called and offered, likewise."""

    def __init__(self, name: str, where: str) -> None:
        self.name = name
        self._where = where
        self._why = "no answer"
        """Why there is no connection."""
        self._loop = asyncio.new_event_loop()
        self._connected = threading.Event()
        self._connections = 0
        self._closed = False

    def _start(self, connect_timeout_s: float) -> None:
        """Begin to connect. `BridgeError` where nobody answers in time; 0: do not wait."""
        self._main = self._loop.create_task(self._keep_connected())
        name = f"{self.name}-{self._PROTOCOL.lower()}"
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()
        if connect_timeout_s:
            try:
                self.wait_until_connected(connect_timeout_s)
            except BridgeError:
                self.close()
                raise

    # --------------------------------------------------------------------------------- connection

    @property
    def connected(self) -> bool:
        """Whether the server is there at the moment."""
        return self._connected.is_set()

    @property
    def connections(self) -> int:
        """How often it has been connected."""
        return self._connections

    def wait_until_connected(self, timeout_s: float) -> None:
        """Wait for the server. `BridgeError` where it does not answer in time."""
        if not self._connected.wait(timeout_s):
            raise UnreachableError(f"nobody speaks {self._PROTOCOL} at {self._where}: {self._why}")

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announce that messages will be published on `topic`. `GraphError` for a wrong type."""
        self._check_open()
        self._topics.advertise(topic, msgtype, latched)

    def unadvertise(self, topic: str) -> None:
        """Publish on `topic` no more. `GraphError` if it did not."""
        self._topics.unadvertise(topic, self.name)

    def published_type(self, topic: str) -> str | None:
        """Type that was announced for `topic`; None if it was not."""
        return self._topics.published_type(topic)

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message of the announced type.

        Without a connection it is dropped; of what the network is too slow for, the oldest.
        """
        self._check_open()
        self._topics.publish(topic, message, self.name)

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """As `Link.subscribe`; without a type the client asks the server for it."""
        self._check_open()
        if msgtype is None:
            msgtype = self._type_of(topic)
            if not msgtype:
                raise GraphError(f"no topic '{topic}'; give a type to subscribe before it exists")
        return self._topics.subscribe(topic, msgtype, depth, reliable, wake)

    def unsubscribe(self, mailbox: SubscriptionQueue) -> None:
        """Receive no more; what waits can still be taken."""
        self._topics.unsubscribe(mailbox)

    @abstractmethod
    def _type_of(self, topic: str) -> str | None:
        """Ask the server for the type of a topic; None or empty where there is no such topic."""

    def _ask(self, ask: Callable[[Future[T]], object], silence: str) -> T:
        """Have the server asked by `ask`, and wait for what that gets as an answer.

        `GraphError` with `silence` as its text where no answer comes, and in the client's own
        thread, which would wait for itself.
        """
        if threading.current_thread() is self._thread:
            raise GraphError(
                f"give a type: the client's own thread cannot wait for the {self._SERVER}"
            )
        found: Future[T] = Future()
        ask(found)
        try:
            return found.result(_ANSWER_TIMEOUT_S)
        except FutureTimeoutError:
            raise GraphError(silence) from None

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Call a service; `reply` gets the response or a `GraphError` in the client's thread.

        Calls that are open when the connection breaks fail.
        """
        self._check_open()
        self._services.call(service, request, reply)

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """Offer a service; `handler(request, reply)` is called in the client's thread."""
        self._check_open()
        self._services.offer(service, srvtype, handler)

    def withdraw(self, service: str) -> None:
        """Offer a service no more. `GraphError` if it was not offered."""
        self._services.withdraw(service, self.name)

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Leave; a second time nothing happens."""
        if self._closed:
            return
        self._closed = True
        self._loop.call_soon_threadsafe(self._leave)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _check_open(self) -> None:
        if self._closed:
            raise GraphError(f"{self.name} has left")

    # ------------------------------------------------------------------------------- its thread

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._main)
        except asyncio.CancelledError:
            pass
        finally:
            self._lose(f"{self.name} has left")
            self._loop.close()

    @abstractmethod
    async def _keep_connected(self) -> None:
        """Connect, and again whenever the connection breaks, until `_leave` ends it."""

    def _joined(self) -> None:
        """A connection stands, and everything has been asked for."""
        self._connections += 1
        self._connected.set()

    def _lose(self, why: str) -> None:
        """The connection is gone, or there will be none any more."""
        self._connected.clear()
        self._drop(why)

    @abstractmethod
    def _drop(self, why: str) -> None:
        """Drop what waits to be sent; who waits for an answer is told why none will come."""

    def _leave(self) -> None:
        """Bring `_keep_connected` to an end, after `close`."""
        self._main.cancel()
