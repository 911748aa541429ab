"""Connects a program to the graph of a remote server and keeps the connection.

A remote client has the methods of `graph.session.Session`. If the connection breaks, the client
reconnects and repeats its advertisements, subscriptions and services.
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
from volery.core.errors import GraphError, UnreachableError
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler
from volery.graph.subscription_queue import SubscriptionQueue, Wake

T = TypeVar("T")

_ANSWER_TIMEOUT_S = 5.0


class RemoteServices(Protocol):
    """Services that a client calls and offers, also without a connection."""

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; without a request the server is first asked for its type."""

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service. Raises `GraphError` for an unknown type or an existing service."""

    def destroy_service(self, service: str, client_name: str) -> None:
        """Destroys a service; its open requests fail. Raises `GraphError` if it does not exist."""


class RemoteClient(ABC):
    """Connects one program to a remote graph. Any thread may call the methods.

    The client runs an asyncio loop in its own thread, which calls wakes, replies and handlers.

    A subclass defines `_PROTOCOL` and `_SERVER`, sets `_topics` and `_services` before it calls
    `_start`, the last step of its `__init__`, and implements the abstract methods. In the loop,
    `_keep_connected` calls `_joined` after the server has received all requests, calls `_lose`
    when the connection breaks, and stores the reason of a failure in `_why`.

    Parameters
    ----------
    name
        Name of the client, for messages.
    where
        Address of the server, for messages.

    """

    _PROTOCOL: ClassVar[str]
    """Name of the protocol; in lower case part of the thread's name."""
    _SERVER: ClassVar[str]
    """Name of the protocol's server, for messages."""

    _topics: RemoteTopics
    """Publications and subscriptions, repeated on every connection."""
    _services: RemoteServices
    """Calls and services, likewise."""

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
        """Starts to connect. Raises `BridgeError` if no server answers in time; 0: do not wait."""
        self._main = self._loop.create_task(self._keep_connected())
        name = f"{self.name}-{self._PROTOCOL.lower()}"
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()
        if connect_timeout_s:
            try:
                self.wait_until_connected(connect_timeout_s)
            except BaseException:  # also after Ctrl-C, or its thread runs into the end of Python
                self.close()
                raise

    # --------------------------------------------------------------------------------- connection

    @property
    def connected(self) -> bool:
        """Whether the server is connected."""
        return self._connected.is_set()

    @property
    def connections(self) -> int:
        """Number of connections so far."""
        return self._connections

    def wait_until_connected(self, timeout_s: float) -> None:
        """Waits for the server. Raises `BridgeError` if it does not answer in time."""
        if not self._connected.wait(timeout_s):
            raise UnreachableError(f"no {self._PROTOCOL} server at {self._where}: {self._why}")

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Advertises `topic`. Raises `GraphError` for a wrong type."""
        self._check_open()
        self._topics.advertise(topic, msgtype, latched)

    def unadvertise(self, topic: str) -> None:
        """Ends the publication of `topic`. Raises `GraphError` if there was none."""
        self._topics.unadvertise(topic, self.name)

    def published_type(self, topic: str) -> str | None:
        """Returns the advertised type of `topic`; None if it is not advertised."""
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
        """Subscribes like `GraphConnection.subscribe`.

        Without a type the client asks the server for it.
        """
        self._check_open()
        if msgtype is None:
            msgtype = self._type_of(topic)
            if not msgtype:
                raise GraphError(f"no topic '{topic}'; give a type to subscribe before it exists")
        return self._topics.subscribe(topic, msgtype, depth, reliable, wake)

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Ends a subscription; queued messages remain available."""
        self._topics.unsubscribe(queue)

    @abstractmethod
    def _type_of(self, topic: str) -> str | None:
        """Asks the server for the type of a topic; None or empty if there is no such topic."""

    def _ask(self, ask: Callable[[Future[T]], object], silence: str) -> T:
        """Sends a request with `ask` and waits for the answer.

        Raises `GraphError` with the text `silence` if no answer arrives, and also in the client's
        own thread, which would wait for itself.
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
        """Calls a service; `reply` receives the response or a `GraphError` in the client's thread.

        Calls that are open when the connection breaks fail.
        """
        self._check_open()
        self._services.call(service, request, reply)

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service; `handler(request, reply)` is called in the client's thread."""
        self._check_open()
        self._services.create_service(service, srvtype, handler)

    def destroy_service(self, service: str) -> None:
        """Destroys a service. Raises `GraphError` if it does not exist."""
        self._services.destroy_service(service, self.name)

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Disconnects; further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        self._loop.call_soon_threadsafe(self._leave)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _check_open(self) -> None:
        if self._closed:
            raise GraphError(f"{self.name} is closed")

    # ------------------------------------------------------------------------------- its thread

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._main)
        except asyncio.CancelledError:
            pass
        finally:
            self._lose(f"{self.name} is closed")
            self._loop.close()

    @abstractmethod
    async def _keep_connected(self) -> None:
        """Connects, and reconnects after each break, until `_leave` ends it."""

    def _joined(self) -> None:
        """Marks the client as connected, after the server has received all requests."""
        self._connections += 1
        self._connected.set()

    def _lose(self, why: str) -> None:
        """Marks the client as disconnected."""
        self._connected.clear()
        self._drop(why)

    @abstractmethod
    def _drop(self, why: str) -> None:
        """Drops queued messages and fails open requests with the reason."""

    def _leave(self) -> None:
        """Ends `_keep_connected`, after `close`."""
        self._main.cancel()
