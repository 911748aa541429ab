"""The graph for programs outside of the simulation's thread: what every bridge stands on.

A bridge opens one `Session` for each of its clients. All its methods may be called by any thread.
What a client publishes and calls is posted to the simulation's thread, which takes it in between
two ticks, in the order of arrival; what it receives waits in a bounded `SubscriptionQueue` that
keeps the newest. A client that does not read loses messages of its own and delays nobody.

    session = gateway.open("rosbridge 127.0.0.1:51234")
    mailbox = session.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=loop_wakes_up)
    ...
    for published in mailbox.take():
        send(published.cdr)
"""

from __future__ import annotations

import itertools
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, NamedTuple

from volery.core.errors import GraphError, NodeError, VoleryError
from volery.graph.graph import Graph, Publisher, Subscription
from volery.graph.messages import message_type
from volery.graph.nodes.failures import report_failure
from volery.graph.qos import DEFAULT_DEPTH, check_depth
from volery.graph.read_budget import ReadBudgets, Reading, write_budgets
from volery.graph.rotor_layout import RotorLayout
from volery.graph.service_reply import ServiceReply
from volery.graph.subscription_queue import (
    SubscriptionQueue,
    SubscriptionQueueInfo,
    Wake,
    message_bytes,
)

Post = Callable[[Callable[[], Any]], "Future[Any]"]
"""Has a function called by the simulation's thread; the future holds its result or error."""
Handler = Callable[[Any, ServiceReply], None]
"""Takes a request in the simulation's thread, at once, and answers through the reply later."""

_log = logging.getLogger(__name__)

_MAX_FAILURES_LOGGED = 20
"""Of topics and services of one client; each is logged once."""

MAX_LATCHED_BYTES = 128 * 1024 * 1024
"""Of the latched messages of one client, which the graph keeps for late subscribers."""
_MOST_NAMES = 20_000
"""Of UAVs that are remembered as commanded; more than any fleet has."""


class ClientCommand(NamedTuple):
    """What a client did, told in the simulation's thread just before it takes effect.

    kind: `call`, `publish`, `advertise`, ... as in `volery_interfaces/msg/CommandRecord`.
    """

    client: str
    kind: str
    name: str
    type: str
    content: Any = None
    """The message, request or response; the reason of a failure."""
    latched: bool = False
    request: int = 0
    """Which request to that service is answered."""


Watch = Callable[[ClientCommand], None]
"""Is told what clients do; the `GraphError` that it raises refuses it."""


@dataclass(frozen=True)
class SessionInfo:
    """Who is connected, and to what."""

    name: str
    publishes: tuple[str, ...]
    mailboxes: tuple[SubscriptionQueueInfo, ...]
    offers: tuple[str, ...]


class Gateway:
    """Where bridges open sessions for their clients; `watch` is told what those do."""

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
    ) -> None:
        """Take how sessions post: `open_queue()` is asked for each client, else all use `post`.

        What one client posts through its queue is done in its order, at its own expense: a client
        that costs the simulation's thread too much time waits for its turn. `is_busy()` tells
        whether the simulation has no time to spare for reading from clients, `is_late()` whether it
        does not keep its pace; see `read_budget`. `rotor_layouts()` returns the rotors of each
        UAV by its name, in any thread.
        """
        self.read_budgets = ReadBudgets(is_busy)
        self.write_budgets = write_budgets(is_late)
        self.graph = graph
        self.watch: Watch = watch or _look_away
        self.rotor_layouts = rotor_layouts
        self._post = post
        self._open_queue = open_queue
        self._sessions: list[Session] = []
        self._lock = threading.Lock()
        self._lost = 0
        self.commands = 0
        """How often somebody outside has published or called something below a name."""
        self.commanded_ns: dict[str, int] = {}
        """When that was last the case, by the name, such as a UAV's."""

    def open(self, name: str, *, inside: bool = False) -> Session:
        """Begin the session of one client; `name` tells people who it is.

        inside: it is no client but a part of Volery, whose doings follow from those of clients.
        """
        post = self._post if inside or self._open_queue is None else self._open_queue()
        session = Session(self, name, None if inside else self.watch, post)
        with self._lock:
            self._sessions.append(session)
        return session

    def sessions(self) -> list[SessionInfo]:
        """Everybody who is connected, in the order of arrival."""
        with self._lock:
            return [session.info for session in self._sessions]

    @property
    def dropped(self) -> int:
        """Messages that clients have lost because they were too slow, those that left included."""
        present = (box.dropped for session in self.sessions() for box in session.mailboxes)
        return self._lost + sum(present)

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Have `action()` called by the simulation's thread."""
        return self._post(action)

    def note_command(self, name: str) -> None:
        """Note that a topic or service of a UAV is used from outside; in the simulation's thread.

        Names outside of any namespace are nobody's.
        """
        uav, below, _ = name[1:].partition("/")
        if below:
            self.commands += 1
            self.commanded_ns.pop(uav, None)  # the newest last
            self.commanded_ns[uav] = self.graph.now_ns()
            if len(self.commanded_ns) > _MOST_NAMES:
                del self.commanded_ns[next(iter(self.commanded_ns))]

    def note_lost(self, messages: int) -> None:
        """Remember what a subscription that ends has lost; used by `Session`."""
        with self._lock:
            self._lost += messages

    def forget(self, session: Session) -> None:
        """Strike a session that has ended off the list; used by `Session`."""
        with self._lock:
            if session in self._sessions:
                self._sessions.remove(session)


class Session:
    """One outside client's part in the graph; `close` takes everything back."""

    def __init__(self, gateway: Gateway, name: str, watch: Watch | None, post: Post) -> None:
        self.name = name
        self._post = post
        self._posted = itertools.count(1)
        self._last_posted = 0
        self._taken = 0
        self.reading = Reading(gateway.read_budgets.open(), lambda: self.waiting)
        """What a bridge asks before it reads on from the client."""
        self.writing = Reading(gateway.write_budgets.open(), lambda: 0)
        """What it asks before it writes on."""
        self._latched_bytes: dict[str, int] = {}
        self._watch = watch or _look_away
        self._inside = watch is None
        self._note = _look_away if watch is None else gateway.note_command
        self._gateway = gateway
        self._graph = gateway.graph
        self._lock = threading.RLock()
        self._publishers: dict[str, Publisher] = {}
        self._mailboxes: dict[SubscriptionQueue, Subscription] = {}
        self._offers: dict[str, set[ServiceReply]] = {}
        self._closed = False
        self._failed: set[str] = set()

    @property
    def graph(self) -> Graph:
        """The graph, for questions about topics and services."""
        return self._graph

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Have `action()` called by the simulation's thread, in the order of the client's posts.

        It may have to wait for the client's turn (`waiting`); whatever a client causes there is
        posted like this.
        """

        def act() -> Any:
            self._taken += 1  # in the simulation's thread alone
            if self._inside:
                return action()
            with self._graph.on_behalf_of(self.name):
                return action()

        self._last_posted = next(self._posted)
        return self._post(act)

    @property
    def waiting(self) -> int:
        """How much the client has posted that the simulation has not taken yet.

        A bridge that reads no more of a client while this is large bounds the client's memory.
        """
        return max(0, self._last_posted - self._taken)

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announce that the client will publish on `topic`. `GraphError` for a wrong type.

        Again with the same type: nothing changes.
        """
        with self._lock:
            self._check_open()
            old = self._publishers.get(topic)
            if old is not None and old.msgtype == msgtype and old.latched == latched:
                return
            self._publishers[topic] = self._graph.advertise(topic, msgtype, latched=latched)
            if old is not None:
                old.cancel()
        self.tell("advertise", topic, msgtype, latched=latched)

    def unadvertise(self, topic: str) -> None:
        """Publish on `topic` no more. `GraphError` if it did not."""
        with self._lock:
            publisher = self._publishers.pop(topic, None)
            self._latched_bytes.pop(topic, None)
        if publisher is None:
            raise GraphError(f"{self.name} does not publish '{topic}'")
        self.tell("unadvertise", topic, publisher.msgtype)
        publisher.cancel()

    def published_type(self, topic: str) -> str | None:
        """Type that the client has announced for `topic`; None if it has not."""
        publisher = self._publishers.get(topic)
        return None if publisher is None else publisher.msgtype

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message of the announced type; its arrays must not be written to any more."""
        self.publish_all(((topic, message),))

    def publish_all(self, messages: Sequence[tuple[str, Any]]) -> None:
        """Like `publish`, of messages by topic that are taken in together, in their order."""
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
        """Bound what the graph keeps for late subscribers; `GraphError` where it is too much."""
        size = message_bytes(message)
        with self._lock:
            others = sum(self._latched_bytes.values()) - self._latched_bytes.get(topic, 0)
            if others + size > MAX_LATCHED_BYTES:
                raise GraphError(
                    f"'{topic}': the latched messages of {self.name} would have more than "
                    f"{MAX_LATCHED_BYTES >> 20} MiB; unadvertise topics that are done with"
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
        """As `graph.connection.Link.subscribe`; `wake` is called from the simulation's thread."""
        check_depth(depth)
        mailbox = SubscriptionQueue(topic, depth, wake, reliable=reliable)
        with self._lock:
            self._check_open()
            self._mailboxes[mailbox] = self._graph.attach(topic, mailbox.put, msgtype)
        return mailbox

    def unsubscribe(self, mailbox: SubscriptionQueue) -> None:
        """Receive no more; what waits can still be taken."""
        with self._lock:
            subscription = self._mailboxes.pop(mailbox, None)
        if subscription is not None:
            subscription.cancel()
            self._gateway.note_lost(mailbox.info.dropped)

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Call a service; `reply` gets the response or a `GraphError`, in some other thread."""

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
            lambda asked: _tell_failure(asked, reply, service, self.name)
        )

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """Offer a service. `GraphError` if somebody does so already.

        `handler(request, reply)` is called in the simulation's thread and must not block. Requests
        not answered when the client leaves fail.
        """
        message_type(f"{srvtype}_Request")
        with self._lock:
            self._check_open()
            if service in self._offers:
                raise GraphError(f"{self.name} offers service '{service}' already")
            pending: set[ServiceReply] = set()
            numbers = itertools.count()

            def handle(request: Any, reply: ServiceReply) -> None:
                relayed = self._relay(service, srvtype, reply, next(numbers))
                pending.add(relayed)
                relayed.when_done(lambda: pending.discard(relayed))
                handler(request, relayed)

            self._graph.offer_async(service, srvtype, handle)
            self._offers[service] = pending
        self.tell("offer", service, srvtype)

    def withdraw(self, service: str) -> None:
        """Offer a service no more; its open requests fail. `GraphError` if it was not offered."""
        with self._lock:
            pending = self._offers.pop(service, None)
        if pending is None:
            raise GraphError(f"{self.name} does not offer service '{service}'")
        srvtype = self._graph.services().get(service, "")
        self._graph.withdraw(service)
        for reply in tuple(pending):
            reply.fail(GraphError(f"service '{service}': {self.name} has left"))
        self.tell("withdraw", service, srvtype)

    def _relay(self, service: str, srvtype: str, reply: ServiceReply, request: int) -> ServiceReply:
        """A reply whose answer reaches `reply` between two ticks, as all that comes from outside.

        One that is given in the simulation's thread at once, as inside, goes on at once.
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

    def tell(
        self, kind: str, name: str, msgtype: str, content: Any = None, *, latched: bool = False
    ) -> None:
        """Have the watch told what the client does, where that is not posted anyway."""
        self.post(
            lambda: self._watch(ClientCommand(self.name, kind, name, msgtype, content, latched))
        )

    def close(self) -> None:
        """Take back everything; a second time nothing happens."""
        with self._lock:
            self._closed = True
            topics, mailboxes = tuple(self._publishers), tuple(self._mailboxes)
            services = tuple(self._offers)
        for topic in topics:
            self.unadvertise(topic)
        for mailbox in mailboxes:
            self.unsubscribe(mailbox)
        for service in services:
            self.withdraw(service)
        self.reading.close()
        self.writing.close()
        self._gateway.forget(self)

    @property
    def mailboxes(self) -> tuple[SubscriptionQueueInfo, ...]:
        """How its subscriptions fare."""
        with self._lock:
            return tuple(mailbox.info for mailbox in self._mailboxes)

    @property
    def info(self) -> SessionInfo:
        """What the client does at present."""
        with self._lock:
            publishes, offers = tuple(self._publishers), tuple(self._offers)
            return SessionInfo(self.name, publishes, self.mailboxes, offers)

    def _log_failure(self, done: Future[Any], name: str) -> None:
        """Log what became of a publication or an answer that nothing waits for."""
        error = None if done.cancelled() else done.exception()
        known = name in self._failed or len(self._failed) >= _MAX_FAILURES_LOGGED
        if error is None or self._closed or known:
            return
        self._failed.add(name)
        ours = None if isinstance(error, VoleryError) else error
        _log.warning("'%s' from %s is not taken: %s", name, self.name, error, exc_info=ours)

    def _check_open(self) -> None:
        if self._closed:
            raise GraphError(f"{self.name} has left")


def _look_away(_what: object) -> None:
    """Watch nothing."""


def _tell_failure(asked: Future[Any], reply: ServiceReply, service: str, client: str) -> None:
    """Answer a caller whose question was never asked, or broke in the asking."""
    if asked.cancelled():
        reply.fail(GraphError("the simulation has ended"))
        return
    error = asked.exception()
    if isinstance(error, VoleryError):
        reply.fail(GraphError(str(error)))
    elif error is not None:
        _log.error("service '%s', called by %s, failed", service, client, exc_info=error)
        reply.fail(GraphError(f"service '{service}' failed; the simulation's log says why"))
