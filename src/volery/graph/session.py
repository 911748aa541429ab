"""Provides the graph to clients in other threads; every bridge is built on it.

A bridge opens one `Session` for each of its clients. Its methods are thread-safe. A client's
publications and calls are posted to the simulation's thread, which processes them between two
ticks, in the order of arrival; messages for the client wait in a bounded `SubscriptionQueue` of the
newest. A client that does not read loses its own messages and delays no other client.

    session = gateway.open("rosbridge 127.0.0.1:51234")
    queue = session.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=loop_wakes_up)
    ...
    for published in queue.take():
        send(published.cdr)
"""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

from volery.core.errors import GraphError, NodeError, VoleryError
from volery.graph.graph import Graph, Refusal
from volery.graph.messages import message_type
from volery.graph.nodes.failures import report_failure
from volery.graph.qos import DEFAULT_DEPTH, check_depth
from volery.graph.read_budget import ReadBudgets, ReadScope, write_budgets
from volery.graph.rotor_layout import RotorLayout
from volery.graph.service_reply import ServiceReply
from volery.graph.subscription_queue import (
    SubscriptionQueue,
    SubscriptionQueueInfo,
    Wake,
    message_bytes,
)
from volery.graph.topics import Publisher, Subscription

Post = Callable[[Callable[[], Any]], "Future[Any]"]
"""Runs a function in the simulation's thread; the future holds its result or error."""
Handler = Callable[[Any, ServiceReply], None]
"""Receives a request in the simulation's thread, must not block, and responds through the reply."""

_log = logging.getLogger(__name__)

_MAX_FAILURES_LOGGED = 20
"""Topics and services of one client; each is logged once."""

_REFUSAL_PERIOD_S = 1.0
_MAX_REFUSALS = 20
"""Different refusals reported within that time."""

MAX_LATCHED_BYTES = 128 * 1024 * 1024
"""Limit of the latched messages of one client, which the graph stores for late subscribers."""
_MAX_NAMES = 20_000
"""Limit of the stored names of commanded UAVs; more than any fleet has."""


class ClientCommand(NamedTuple):
    """Describes a client's command, in the simulation's thread just before it takes effect.

    kind: `call`, `publish`, `refused`, ... as in `volery_interfaces/msg/CommandRecord`.
    """

    client: str
    kind: str
    name: str
    type: str
    content: Any = None
    """The message, request or response; the reason of a failure."""
    latched: bool = False
    request: int = 0
    """Number of the request to the service that is responded to."""


Watch = Callable[[ClientCommand], None]
"""Receives the commands of clients; raises `GraphError` to refuse a command."""


@dataclass(frozen=True)
class SessionInfo:
    """Describes one client session."""

    name: str
    publishes: tuple[str, ...]
    queues: tuple[SubscriptionQueueInfo, ...]
    offers: tuple[str, ...]


class Gateway:
    """Opens sessions for the clients of bridges; `watch` receives the clients' commands."""

    def __init__(
        self,
        graph: Graph,
        post: Post,
        watch: Watch | None = None,
        *,
        open_queue: Callable[[], Post] | None = None,
        is_busy: Callable[[], bool] = lambda: False,
        is_late: Callable[[], bool] = lambda: False,
        rotor_layouts: Callable[[], Mapping[str, RotorLayout]] = dict,
        reduce_latency: Callable[[], None] | None = None,
    ) -> None:
        """Configures how sessions post: each through an `open_queue()`, else through `post`.

        Actions of one queue run in order and within the client's share of time: a client that uses
        too much of the simulation's thread has to wait. `is_busy()` returns whether the simulation
        has no time to spare for reading from clients, `is_late()` whether it is behind its
        real-time factor; see `read_budget`. `rotor_layouts()` returns the rotors of each UAV by its
        name, in any thread. `reduce_latency()` is called by `use_low_latency`.
        """
        self.read_budgets = ReadBudgets(is_busy)
        self.write_budgets = write_budgets(is_late)
        self.graph = graph
        self.watch: Watch = watch or _look_away
        self.rotor_layouts = rotor_layouts
        self._post = post
        self._open_queue = open_queue
        self._reduce_latency = reduce_latency
        self._sessions: list[Session] = []
        self._lock = threading.Lock()
        self._lost = 0
        graph.on_refused = self._note_refused
        self.commands = 0
        """Number of external publications and calls on names within a namespace."""
        self.commanded_ns: dict[str, int] = {}
        """Simulated time, ns, of the last such command by namespace, such as a UAV's name."""

    def open(self, name: str, *, inside: bool = False) -> Session:
        """Opens the session of one client; `name` identifies the client to users.

        inside: the session belongs to a part of Volery whose commands follow from those of clients.
        """
        post = self._post if inside or self._open_queue is None else self._open_queue()
        session = Session(self, name, None if inside else self.watch, post)
        with self._lock:
            self._sessions.append(session)
        return session

    def sessions(self) -> list[SessionInfo]:
        """Returns all open sessions, in the order of opening."""
        with self._lock:
            return [session.info for session in self._sessions]

    @property
    def dropped(self) -> int:
        """Number of messages dropped because clients were too slow, closed sessions included."""
        present = (box.dropped for session in self.sessions() for box in session.queues)
        return self._lost + sum(present)

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Runs `action()` in the simulation's thread."""
        return self._post(action)

    def use_low_latency(self) -> None:
        """Reduces the wall time until commands act, for clients that wait for responses.

        Costs a few tenths of a core in a simulation with a real-time factor; results stay the same.
        """
        if self._reduce_latency is not None:
            self._reduce_latency()

    def note_command(self, name: str) -> None:
        """Counts an external use of a topic or service of a UAV; in the simulation's thread.

        Names without a namespace are not counted.
        """
        uav, below, _ = name[1:].partition("/")
        if below:
            self.commands += 1
            self.commanded_ns.pop(uav, None)  # newest last
            self.commanded_ns[uav] = self.graph.now_ns()
            if len(self.commanded_ns) > _MAX_NAMES:
                del self.commanded_ns[next(iter(self.commanded_ns))]

    def _note_refused(self, refusal: Refusal) -> None:
        """Records that a client's message is refused, and reports it to the client."""
        client, topic, msgtype, reason = refusal
        with suppress(GraphError):  # the run has ended
            self.watch(ClientCommand(client, "refused", topic, msgtype, reason))
        with self._lock:
            sessions = [session for session in self._sessions if session.name == client]
        for session in sessions:
            session.report_refusal(topic, reason)

    def note_lost(self, messages: int) -> None:
        """Adds the dropped messages of a subscription that ends; used by `Session`."""
        with self._lock:
            self._lost += messages

    def forget(self, session: Session) -> None:
        """Removes a session that has ended; used by `Session`."""
        with self._lock:
            if session in self._sessions:
                self._sessions.remove(session)


class Session:
    """One external client of the graph; `close` ends all its publishers, queues and services."""

    def __init__(self, gateway: Gateway, name: str, watch: Watch | None, post: Post) -> None:
        self.name = name
        self._post = post
        self._posted = itertools.count(1)
        self._last_posted = 0
        self._taken = 0
        self.reading = ReadScope(gateway.read_budgets.open(), lambda: self.waiting)
        """Budget that a bridge checks before it continues to read from the client."""
        self.writing = ReadScope(gateway.write_budgets.open(), lambda: 0)
        """Budget that a bridge checks before it continues to write to the client."""
        self._latched_bytes: dict[str, int] = {}
        self._watch = watch or _look_away
        self._inside = watch is None
        self._note = _look_away if watch is None else gateway.note_command
        self._gateway = gateway
        self._graph = gateway.graph
        self._lock = threading.RLock()
        self._publishers: dict[str, Publisher] = {}
        self._queues: dict[SubscriptionQueue, Subscription] = {}
        self._offers: dict[str, set[ServiceReply]] = {}
        self._closed = False
        self._failed: set[str] = set()
        self.on_refused: Callable[[str], None] | None = None
        """Receives why a message of the client is not obeyed, in the simulation's thread; must not
        block. A bridge sets it where its protocol can name the client."""
        self._reported_s: dict[tuple[str, str], float] = {}
        """Wall time of the last refusals reported to the client, s."""

    @property
    def graph(self) -> Graph:
        """The graph, for queries about topics and services."""
        return self._graph

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Runs `action()` in the simulation's thread, in the order of the client's posts.

        The action may have to wait for the client's turn (`waiting`). Everything that a client
        causes is posted this way.
        """

        def act() -> Any:
            self._taken += 1  # in the simulation's thread only
            if self._inside:
                return action()
            with self._graph.on_behalf_of(self.name):
                return action()

        self._last_posted = next(self._posted)
        return self._post(act)

    @property
    def waiting(self) -> int:
        """Number of the client's posts that the simulation has not processed yet.

        A bridge bounds the client's memory by not reading from the client while this number is
        large.
        """
        return max(0, self._last_posted - self._taken)

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announces that the client publishes on `topic`. Raises `GraphError` for a wrong type.

        A second call with the same type has no effect, except that it may make the topic latched: a
        latched topic stays so until `unadvertise`.
        """
        with self._lock:
            self._check_open()
            old = self._publishers.get(topic)
            latched = latched or (old is not None and old.latched)
            if old is not None and old.msgtype == msgtype and old.latched == latched:
                return
            self._publishers[topic] = self._graph.advertise(topic, msgtype, latched=latched)
            if old is not None:
                old.cancel()
        self.record_command("advertise", topic, msgtype, latched=latched)

    def unadvertise(self, topic: str) -> None:
        """Stops publishing on `topic`. Raises `GraphError` if the client has not advertised it."""
        with self._lock:
            publisher = self._publishers.pop(topic, None)
            self._latched_bytes.pop(topic, None)
        if publisher is None:
            raise GraphError(f"{self.name} does not publish '{topic}'")
        self.record_command("unadvertise", topic, publisher.msgtype)
        publisher.cancel()

    def published_type(self, topic: str) -> str | None:
        """Returns the type that the client has advertised for `topic`, or None."""
        publisher = self._publishers.get(topic)
        return None if publisher is None else publisher.msgtype

    def publish(self, topic: str, message: Any) -> None:
        """Publishes a message of the advertised type; its arrays must not be modified later."""
        self.publish_all(((topic, message),))

    def publish_all(self, messages: Sequence[tuple[str, Any]]) -> None:
        """Publishes (topic, message) pairs in one post, in their order; see `publish`."""
        known = [(self._publisher(topic), message) for topic, message in messages]
        for publisher, message in known:
            if publisher.latched and not self._inside:
                self._count_latched(publisher.topic, message)

        def publish() -> None:
            for publisher, message in known:
                publisher.check(message)
                topic = publisher.topic
                self._note(topic)
                self._watch(ClientCommand(self.name, "publish", topic, publisher.msgtype, message))
                publisher.publish_posted(message)

        if known:
            topics = ", ".join(topic for topic, _ in messages)
            self.post(publish).add_done_callback(lambda done: self._log_failure(done, topics))

    def _count_latched(self, topic: str, message: Any) -> None:
        """Limits the bytes that the graph latches for the client; raises `GraphError` beyond."""
        size = message_bytes(message)
        with self._lock:
            others = sum(self._latched_bytes.values()) - self._latched_bytes.get(topic, 0)
            if others + size > MAX_LATCHED_BYTES:
                raise GraphError(
                    f"'{topic}': the latched messages of {self.name} would exceed "
                    f"{MAX_LATCHED_BYTES >> 20} MiB; unadvertise topics that are no longer used"
                )
            self._latched_bytes[topic] = size

    def _publisher(self, topic: str) -> Publisher:
        publisher = self._publishers.get(topic)
        if publisher is None:
            raise GraphError(f"{self.name} has not advertised '{topic}'")
        return publisher

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Like `GraphConnection.subscribe`; `wake` is called from the simulation's thread."""
        check_depth(depth)
        queue = SubscriptionQueue(topic, depth, wake, reliable=reliable)
        with self._lock:
            self._check_open()
            self._queues[queue] = self._graph.attach(topic, queue.put, msgtype, on_ended=queue.end)
        return queue

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Ends a subscription; messages in its queue can still be taken."""
        with self._lock:
            subscription = self._queues.pop(queue, None)
        if subscription is not None:
            subscription.cancel()
            self._gateway.note_lost(queue.info.dropped)

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; `reply` gets the response or a `GraphError`, in another thread."""

        def ask() -> None:
            self._note(service)
            try:
                srvtype = self._graph.service_type(service)
                self._watch(ClientCommand(self.name, "call", service, srvtype, request))
                self._graph.call_async(service, request, reply)
            except GraphError as error:
                reply.fail(error)
            except NodeError as error:
                report_failure(self._graph, error, is_raised=False)
                raise

        self.post(ask).add_done_callback(
            lambda asked: _pass_failure(asked, reply, service, self.name)
        )

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service. Raises `GraphError` if the service already has a server.

        `handler(request, reply)` is called in the simulation's thread and must not block. Requests
        that are pending when the client disconnects fail.
        """
        message_type(f"{srvtype}_Request")
        with self._lock:
            self._check_open()
            if service in self._offers:
                raise GraphError(f"{self.name} already serves '{service}'")
            pending: set[ServiceReply] = set()
            numbers = itertools.count()

            def handle(request: Any, reply: ServiceReply) -> None:
                relayed = self._relay(service, srvtype, reply, next(numbers))
                pending.add(relayed)
                relayed.when_done(lambda: pending.discard(relayed))
                handler(request, relayed)

            self._graph.create_async_service(service, srvtype, handle, owner=self.name)
            self._offers[service] = pending
        self.record_command("offer", service, srvtype)

    def destroy_service(self, service: str) -> None:
        """Destroys a service; pending requests fail. Raises `GraphError` if it does not exist."""
        with self._lock:
            pending = self._offers.pop(service, None)
        if pending is None:
            raise GraphError(f"{self.name} does not serve '{service}'")
        srvtype = self._graph.services().get(service, "")
        self._graph.destroy_service(service)
        for reply in tuple(pending):
            reply.fail(GraphError(f"service '{service}': {self.name} has left"))
        self.record_command("withdraw", service, srvtype)

    def _relay(self, service: str, srvtype: str, reply: ServiceReply, request: int) -> ServiceReply:
        """Returns a reply that passes the response to `reply` between two ticks.

        A response given at once, in the simulation's thread, is passed on at once.
        """
        here = threading.get_ident()

        def come(settle: Callable[[], None], kind: str, content: Any) -> None:
            def take() -> None:
                self._watch(
                    ClientCommand(self.name, kind, service, srvtype, content, request=request)
                )
                settle()

            if threading.get_ident() == here:
                take()
            else:
                self.post(take).add_done_callback(lambda done: self._log_failure(done, service))

        return ServiceReply(
            lambda response: come(lambda: reply.answer(response), "answer", response),
            lambda error: come(lambda: reply.fail(error), "failure", str(error)),
        )

    # --------------------------------------------------------------------------------------- end

    def record_command(
        self, kind: str, name: str, msgtype: str, content: Any = None, *, latched: bool = False
    ) -> None:
        """Passes a command to the watch, where the command itself is not posted."""
        self.post(
            lambda: self._watch(ClientCommand(self.name, kind, name, msgtype, content, latched))
        )

    def close(self) -> None:
        """Ends all publishers, subscriptions and services; a second call has no effect."""
        with self._lock:
            self._closed = True
            topics, queues = tuple(self._publishers), tuple(self._queues)
            services = tuple(self._offers)
        for topic in topics:
            self.unadvertise(topic)
        for queue in queues:
            self.unsubscribe(queue)
        for service in services:
            self.destroy_service(service)
        self.reading.close()
        self.writing.close()
        self._gateway.forget(self)

    @property
    def queues(self) -> tuple[SubscriptionQueueInfo, ...]:
        """Counts of the client's subscription queues."""
        with self._lock:
            return tuple(queue.info for queue in self._queues)

    @property
    def info(self) -> SessionInfo:
        """The client's current publishers, subscriptions and services."""
        with self._lock:
            publishes, offers = tuple(self._publishers), tuple(self._offers)
            return SessionInfo(self.name, publishes, self.queues, offers)

    def report_refusal(self, topic: str, reason: str) -> None:
        """Reports to the client that its message on `topic` is not obeyed.

        Each refusal is reported once per second, and at most 20 different ones: otherwise a stream
        of messages causes a stream of errors.
        """
        if self.on_refused is None:
            return
        now_s = time.monotonic()
        recent = {k: s for k, s in self._reported_s.items() if now_s - s < _REFUSAL_PERIOD_S}
        self._reported_s = recent
        if (topic, reason) not in recent and len(recent) < _MAX_REFUSALS:
            recent[topic, reason] = now_s
            self.on_refused(f"{topic}: {reason}")

    def _log_failure(self, done: Future[Any], name: str) -> None:
        """Logs the failure of a publication or response that nothing waits for."""
        error = None if done.cancelled() else done.exception()
        if isinstance(error, VoleryError) and not self._closed:
            self.report_refusal(name, str(error))
        known = name in self._failed or len(self._failed) >= _MAX_FAILURES_LOGGED
        if error is None or self._closed or known:
            return
        self._failed.add(name)
        ours = None if isinstance(error, VoleryError) else error
        _log.warning("'%s' from %s was rejected: %s", name, self.name, error, exc_info=ours)

    def _check_open(self) -> None:
        if self._closed:
            raise GraphError(f"{self.name} has left")


def _look_away(_what: object) -> None:
    """Ignores its argument."""


def _pass_failure(asked: Future[Any], reply: ServiceReply, service: str, client: str) -> None:
    """Fails the reply of a call that was never made, or that failed."""
    if asked.cancelled():
        reply.fail(GraphError("the simulation has ended"))
        return
    error = asked.exception()
    if isinstance(error, VoleryError):
        reply.fail(GraphError(str(error)))
    elif error is not None:
        _log.error("service '%s', called by %s, failed", service, client, exc_info=error)
        reply.fail(GraphError(f"service '{service}' failed; see the simulation's log"))
