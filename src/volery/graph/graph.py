"""Topics and services of one simulation.

Delivery is deterministic: a publication joins a queue, and `deliver` hands queued messages to
subscribers first come, first served, in the order of subscription. What a callback publishes joins
the end of the queue.

A latched publisher's last message is kept and handed to everyone who subscribes later, as ROS 1
latches and ROS 2 does with durability TRANSIENT_LOCAL and depth 1.

Messages are published, and requests handled, in the simulation's thread alone. Who takes part may
be changed by any thread: `graph.session` does so for clients outside.
"""

from __future__ import annotations

import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, MutableSequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from volery.core.errors import GraphError, NodeError, VoleryError
from volery.graph.actions import Actions
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Published, message_type, type_name
from volery.graph.parameters import Parameters
from volery.graph.qos import DEFAULT_QOS, QoSProfile
from volery.graph.service_reply import ServiceReply

Callback = Callable[[Published], None]
AsyncHandler = Callable[[Any, ServiceReply], None]
"""Takes a request and answers through the reply, at once or later."""

_log = logging.getLogger(__name__)

MAX_ANSWERS_IN_A_ROW = 10_000
"""Messages each published in answer to the one before, at one simulated instant; more are nodes
that answer each other, or themselves, without end."""
_MAX_ANSWERS_AT_ONCE = 1_000_000
"""Of one topic at one simulated instant: where each message is answered by several."""
_ANSWERS_NAMED = 50

MOST_UNUSED = 1000
"""Topics that are remembered though nobody takes part in them any more."""


@dataclass(frozen=True)
class TopicInfo:
    """What is known of a topic."""

    name: str
    msgtype: str
    publishers: int
    subscribers: int
    messages: int
    latched: bool
    """Whether a publisher's last message awaits those who subscribe later."""


class _Topic:
    def __init__(self, name: str, msgtype: str) -> None:
        self.name = name
        self.msgtype = msgtype
        self.callbacks: list[Callback] = []
        self.outside: list[Callback] = []  # those of them that other threads have attached
        self.attached = 0  # how many did so far
        self.publishers = 0
        self.messages = 0
        self.answer_ns = -1  # when the last message was published in answer to another one ...
        self.answers = 0  # ... and how many such there were at that instant
        self.latched = False
        self.kept: dict[Publisher, Published] = {}  # the last delivered one of each latched one

    @property
    def used(self) -> bool:
        """Whether anybody takes part."""
        return bool(self.publishers or self.callbacks)


class Publisher:
    """A right to publish one type on one topic."""

    def __init__(self, graph: Graph, topic: _Topic, *, latched: bool = False) -> None:
        self._graph = graph
        self._topic = topic
        self.latched = latched
        self.owner = ""
        """Full name of the node that it belongs to; empty: none."""
        self.lasting = False
        """Whether what it publishes is no part of kept states.

        It comes although another state is restored before its delivery, and never twice.
        """
        self.cancelled = False
        """Whether it publishes no more."""

    @property
    def msgtype(self) -> str:
        """Type of its messages."""
        return self._topic.msgtype

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self._topic.name

    @property
    def wanted(self) -> bool:
        """Whether anybody would receive a message; what is not wanted need not be built."""
        return bool(
            self.latched or self._topic.callbacks or self._graph.is_recorded(self._topic.name)
        )

    def publish(self, message: Any) -> None:
        """Queue a message for delivery; nothing after `cancel`."""
        if not self.cancelled:
            self._graph.enqueue(self, self._topic, message)

    def check(self, message: Any) -> None:
        """`GraphError` for a message that is not of the topic's type."""
        name = getattr(message, "__msgtype__", None)
        if name != self.msgtype:
            raise GraphError(f"topic '{self.topic}' carries {self.msgtype}, not {name}")

    def publish_posted(self, message: Any) -> None:
        """Queue a message that was published before `cancel`, even if it gets here after that."""
        self._graph.enqueue(self, self._topic, message)

    @property
    def subscriptions(self) -> int:
        """How many subscribe to this very topic."""
        return len(self._topic.callbacks)

    @property
    def heard(self) -> bool:
        """Whether a node inside subscribes to this very topic: who takes everything is none."""
        return len(self._topic.callbacks) > len(self._topic.outside)

    @property
    def watched(self) -> bool:
        """Whether a client outside receives the topic."""
        return bool(self._topic.outside)

    @property
    def watchers_so_far(self) -> int:
        """How many clients outside have begun to receive the topic: more means somebody is new."""
        return self._topic.attached

    def show(self, message: Any) -> None:
        """Hand a message to the clients outside, at once; nothing in the simulation sees it.

        What follows wall time, or who is watching, is told like this: nodes, digests and recorders
        cannot come to depend on it.
        """
        if not self.cancelled:
            self._graph.show(self, self._topic, message)

    @property
    def keeps(self) -> bool:
        """Whether its last message awaits those who subscribe later."""
        return self.latched and not self.cancelled

    def cancel(self) -> None:
        """Publish no more; what it latched is forgotten."""
        if not self.cancelled:
            self.cancelled = True
            self._graph.dismiss(self, self._topic)


class Subscription:
    """A running subscription; `cancel` ends it, and tells `left` so."""

    def __init__(
        self,
        callbacks: MutableSequence[Any],
        callback: Callback,
        left: Callable[[], None] = lambda: None,
    ) -> None:
        self._callbacks = callbacks
        self._callback = callback
        self._left = left

    def cancel(self) -> None:
        """Stop receiving."""
        if self._callback in self._callbacks:
            self._callbacks.remove(self._callback)
            self._left()


class _Listener:
    """A callback for all topics that match."""

    def __init__(self, callback: Callback, matches: Callable[[str], bool]) -> None:
        self.matches = matches
        self._callback = callback

    def __call__(self, published: Published) -> None:
        self._callback(published)


def _match_all(_topic: str) -> bool:
    return True


class _Letter(NamedTuple):
    """A message under way; `only` is the late subscriber that a kept one is meant for."""

    topic: _Topic
    published: Published
    sender: Publisher
    only: Callback | None = None
    client: str = ""
    """The external client whose command caused it."""
    answers: int = 0
    """How many messages in a row have answered each other, this one included."""


@dataclass(frozen=True)
class _Service:
    """A service: answered at once by `handler`, or some time by `ask`."""

    srvtype: str
    handler: Callable[[Any], Any] | None
    ask: AsyncHandler


class Graph:
    """All topics and services.

    `now_ns` tells the simulated time of a publication. `post` has a function called in the thread
    of the simulation: what comes from other threads gets there through it.
    """

    def __init__(
        self,
        now_ns: Callable[[], int],
        post: Callable[[Callable[[], Any]], Any] | None = None,
    ) -> None:
        self._now_ns = now_ns
        self._post = post
        self._topics: dict[str, _Topic] = {}
        self._unused: dict[str, _Topic] = {}
        self._services: dict[str, _Service] = {}
        self.actions = Actions()
        """Goals that take their time."""
        self.parameters = Parameters()
        """What the nodes have declared."""
        self._to_all: list[_Listener] = []
        self._queue: deque[_Letter] = deque()
        self._answers = 0  # in a row, that what is published now would be the last of
        self._endless: set[tuple[str, str]] = set()
        self.acting_client = ""
        """The external client whose command is being carried out; empty: none. A failure of what
        receives a message that a client caused is logged, and does not end the run."""
        self._members = threading.RLock()
        """Held by whoever changes topics, publishers, subscribers or services."""

    def now_ns(self) -> int:
        """Simulated time."""
        return self._now_ns()

    def post(self, action: Callable[[], Any]) -> None:
        """Have `action()` called in the simulation's thread; `GraphError` where that has none."""
        if self._post is None:
            raise GraphError("this graph has no thread of its own to post to")
        self._post(action)

    def enter(self, node: str) -> None:
        """Note that a node of this full name stands on the graph."""
        self.parameters.enter(node)

    # ---------------------------------------------------------------------------------- topics

    def is_recorded(self, topic: str) -> bool:
        """Whether a recorder or digest wants the messages of a topic."""
        return any(listener.matches(topic) for listener in self._to_all)

    def advertise(
        self, topic: str, msgtype: str | type[Any], *, latched: bool = False
    ) -> Publisher:
        """Announce a publisher. `GraphError` if the topic exists with another type.

        The last message of a `latched` one also goes to those who subscribe after it.
        """
        with self._members:
            found = self._topic(topic, msgtype)
            found.publishers += 1
            found.latched = found.latched or latched
        return Publisher(self, found, latched=latched)

    def dismiss(self, publisher: Publisher, topic: _Topic) -> None:
        """Strike a publisher off; used by `Publisher`."""
        with self._members:
            topic.publishers -= 1
            topic.kept.pop(publisher, None)
            self._drop_unused(topic)

    def subscribe(
        self,
        topic: str,
        callback: Callback,
        msgtype: str | type[Any] | None = None,
        *,
        qos: QoSProfile = DEFAULT_QOS,  # noqa: ARG002
    ) -> Subscription:
        """Call `callback` with each message of `topic`, which must exist or be given a type.

        qos: counts where messages have to wait, which in lock step none ever does. What latched
        publishers sent before comes first, with the next delivery; its `time_ns` is that of this
        subscription.
        """
        with self._members:
            found = self._known_topic(topic, msgtype)
            found.callbacks.append(callback)
        self._send_kept([found], callback)
        return Subscription(found.callbacks, callback, lambda: self._drop_unused(found))

    def attach(
        self, topic: str, put: Callback, msgtype: str | type[Any] | None = None
    ) -> Subscription:
        """Like `subscribe`, for a `put` that any thread may call: what was latched comes at once.

        Its order among other subscribers changes nothing in the simulation.
        """
        with self._members:
            found = self._known_topic(topic, msgtype)
            for kept in tuple(found.kept.values()):
                put(kept)
            found.callbacks.append(put)
            found.outside.append(put)
            found.attached += 1

        def leave() -> None:
            found.outside.remove(put)
            self._drop_unused(found)

        return Subscription(found.callbacks, put, leave)

    def subscribe_all(
        self, callback: Callback, matches: Callable[[str], bool] | None = None
    ) -> Subscription:
        """Call `callback` with every message, before the topics' subscribers.

        What latched publishers sent before comes first, as for `subscribe`.

        matches: whether a topic is meant, by its name; without it all are. Messages of other topics
        are not made for it.
        """
        listener = _Listener(callback, matches or _match_all)
        self._to_all.append(listener)
        meant = [topic for topic in self._topics.values() if listener.matches(topic.name)]
        self._send_kept(meant, listener)
        return Subscription(self._to_all, listener)

    def topics(self) -> list[TopicInfo]:
        """All topics, by name."""
        with self._members:
            return [
                TopicInfo(t.name, t.msgtype, t.publishers, len(t.callbacks), t.messages, t.latched)
                for _, t in sorted(self._topics.items())
            ]

    def publishers(self, topic: str) -> int:
        """How many publish on a topic."""
        found = self._topics.get(topic)
        return 0 if found is None else found.publishers

    def subscribers(self, topic: str) -> int:
        """How many subscribe to a topic."""
        found = self._topics.get(topic)
        return 0 if found is None else len(found.callbacks)

    def topic_type(self, topic: str) -> str | None:
        """Type of a topic; None where there is no such topic."""
        found = self._topics.get(topic)
        return None if found is None else found.msgtype

    def enqueue(self, sender: Publisher, topic: _Topic, message: Any) -> None:
        """Queue a message; used by `Publisher`."""
        sender.check(message)
        topic.messages += 1
        if sender.wanted:
            published = Published(topic.name, topic.msgtype, self._now_ns(), message)
            client, answers = self.acting_client, self._answers
            if answers and self._is_endless(sender, topic, published, answers):
                return
            self._queue.append(_Letter(topic, published, sender, None, client, answers))

    def _is_endless(
        self, sender: Publisher, topic: _Topic, published: Published, answers: int
    ) -> bool:
        """Whether nodes answer each other without end; `NodeError` unless a client began it."""
        topic.answers = topic.answers + 1 if topic.answer_ns == published.time_ns else 1
        topic.answer_ns = published.time_ns
        if answers > MAX_ANSWERS_IN_A_ROW - _ANSWERS_NAMED:
            self._endless.add((published.topic, sender.owner))
        if answers <= MAX_ANSWERS_IN_A_ROW and topic.answers <= _MAX_ANSWERS_AT_ONCE:
            return False
        named = {*self._endless, (published.topic, sender.owner)}
        self._endless.clear()
        topics = ", ".join(sorted({f"'{name}'" for name, _ in named}))
        nodes = ", ".join(sorted({owner for _, owner in named if owner})) or "callbacks"
        reason = (
            f"messages answer each other without end at {published.time_ns / 1e9:.3f} s: "
            f"on {topics}, published by {nodes}; answer at a later time, by a timer, or not at all"
        )
        if not self.acting_client:
            raise NodeError(reason)
        _log.warning("%s (begun by %s): the rest is dropped", reason, self.acting_client)
        return True

    def show(self, sender: Publisher, topic: _Topic, message: Any) -> None:
        """Hand a message to clients outside alone; used by `Publisher`."""
        sender.check(message)
        topic.messages += 1
        published = Published(topic.name, topic.msgtype, self._now_ns(), message)
        for put in tuple(topic.outside):
            put(published)

    def show_to_all(self, sender: Publisher, message: Any) -> None:
        """Hand a message to recorders and clients outside, at once; for the last words of a run."""
        published = Published(sender.topic, sender.msgtype, self._now_ns(), message)
        with self._members:
            topic = self._topics.get(sender.topic)
            puts = (*self._to_all, *(topic.outside if topic is not None else ()))
        for put in puts:
            put(published)

    def show_kept(self) -> None:
        """Hand everything that is latched to the clients outside again: the world has jumped."""
        with self._members:
            topics = [(tuple(t.kept.values()), tuple(t.outside)) for t in self._topics.values()]
        for kept, outside in topics:
            for put in outside:
                for published in kept:
                    put(published)

    def deliver(self) -> None:
        """Hand out all queued messages, those published meanwhile included."""
        before = self._answers
        try:
            self._deliver()
        finally:
            self._answers = before

    def _deliver(self) -> None:
        while self._queue:
            topic, published, sender, only, client, answers = self._queue.popleft()
            self._answers = answers + 1
            if only is not None:
                if only in topic.callbacks or only in self._to_all:
                    only(published)
                continue
            with self._members:  # who attaches meanwhile gets it once
                if sender.keeps:
                    topic.kept[sender] = published
                watching = [c for c in self._to_all if c.matches(topic.name)]
                callbacks = tuple(topic.callbacks)
            for listener in watching:
                listener(published)
            if client:
                self._hand_on_for(client, callbacks, published)
                continue
            for callback in callbacks:
                callback(published)

    def _hand_on_for(
        self, client: str, callbacks: Iterable[Callback], published: Published
    ) -> None:
        """Hand out a message that a client caused: what it breaks does not end the run."""
        with self.on_behalf_of(client):
            for callback in callbacks:
                try:
                    callback(published)
                except Exception as error:
                    _log.warning(
                        "topic '%s': a message caused by %s is not taken: %s",
                        published.topic,
                        client,
                        error,
                        exc_info=not isinstance(error, VoleryError),
                    )

    @contextmanager
    def on_behalf_of(self, client: str) -> Iterator[None]:
        """Context in which all that is published is caused by an external client."""
        before, self.acting_client = self.acting_client, client
        try:
            yield
        finally:
            self.acting_client = before

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps: undelivered and latched messages, how many each topic has seen."""
        with self._members:
            topics = {name: (t.messages, dict(t.kept)) for name, t in self._topics.items()}
        queue = [letter for letter in self._queue if not letter.sender.lasting]
        return {"queue": queue, "topics": topics}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state; topics, subscribers and services stay as they are.

        What nodes had published that have been destroyed since then is left out.
        """
        lasting = [letter for letter in self._queue if letter.sender.lasting]
        kept = [letter for letter in state["queue"] if not _has_gone(letter.sender)]
        self._queue = deque([*lasting, *kept])
        with self._members:
            for name, topic in self._topics.items():
                messages, latched = state["topics"].get(name, (0, {}))
                topic.messages = messages
                topic.kept = {p: m for p, m in latched.items() if not _has_gone(p)}

    @contextmanager
    def in_place_of(self, state: dict[str, Any]) -> Iterator[None]:
        """Queue what is published meanwhile where `state` has what destroyed nodes published."""
        queue = state["queue"]
        first = next((k for k, letter in enumerate(queue) if _has_gone(letter.sender)), len(queue))
        behind = sum(not _has_gone(letter.sender) for letter in queue[first:])
        after = [self._queue.pop() for _ in range(behind)]
        try:
            yield
        finally:
            self._queue.extend(reversed(after))

    def _drop_unused(self, topic: _Topic) -> None:
        """Forget the oldest unused topics where clients have left very many."""
        with self._members:
            if not topic.used:
                self._unused[topic.name] = topic
            if len(self._unused) > MOST_UNUSED:
                oldest = self._unused.pop(next(iter(self._unused)))
                if not oldest.used:
                    del self._topics[oldest.name]

    def _send_kept(self, topics: list[_Topic], callback: Callback) -> None:
        """Put what was kept before everything under way, which is newer."""
        now_ns = self._now_ns()
        letters = [
            _Letter(topic, replace(published, time_ns=now_ns), sender, callback)
            for topic in topics
            for sender, published in topic.kept.items()
        ]
        self._queue.extendleft(reversed(letters))

    def _known_topic(self, name: str, msgtype: str | type[Any] | None) -> _Topic:
        if msgtype is not None:
            return self._topic(name, msgtype)
        if name not in self._topics:
            raise GraphError(f"no topic '{name}'; give a type to subscribe before it exists")
        return self._topics[name]

    def _topic(self, name: str, msgtype: str | type[Any]) -> _Topic:
        wanted = msgtype if isinstance(msgtype, str) else type_name(msgtype)
        _check_name(name)
        topic = self._topics.get(name)
        if topic is None:
            try:
                message_type(wanted)
            except KeyError:
                raise GraphError(f"topic '{name}': unknown message type '{wanted}'") from None
            topic = self._topics[name] = _Topic(name, wanted)
        if topic.msgtype != wanted:
            raise GraphError(f"topic '{name}' carries {topic.msgtype}, not {wanted}")
        return topic

    # -------------------------------------------------------------------------------- services

    def offer(self, service: str, srvtype: str, handler: Callable[[Any], Any]) -> None:
        """Offer a service: `handler(request)` returns the response message."""

        def ask(request: Any, reply: ServiceReply) -> None:
            reply.answer(handler(request))

        self._add_service(service, _Service(srvtype, handler, ask))

    def offer_async(self, service: str, srvtype: str, ask: AsyncHandler) -> None:
        """Offer a service whose answers come later; only `call_async` can call it."""
        self._add_service(service, _Service(srvtype, None, ask))

    def withdraw(self, service: str) -> None:
        """Offer a service no more."""
        with self._members:
            self._services.pop(service, None)

    def call(self, service: str, request: Any | None = None) -> Any:
        """Call a service and return its response. `GraphError` if nobody offers it."""
        found = self._service(service)
        if found.handler is None:
            raise GraphError(f"service '{service}' is offered from outside: use call_async")
        return found.handler(_request(found, request))

    def call_async(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Call a service that may take its time. `GraphError` if nobody offers it."""
        found = self._service(service)
        found.ask(_request(found, request), reply)

    def has_service(self, service: str) -> bool:
        """Whether the service is offered."""
        return service in self._services

    def service_type(self, service: str) -> str:
        """Type of a service. `GraphError` if nobody offers it."""
        return self._service(service).srvtype

    def services(self) -> dict[str, str]:
        """Service names and their types."""
        with self._members:
            return {name: s.srvtype for name, s in sorted(self._services.items())}

    def _add_service(self, name: str, service: _Service) -> None:
        _check_name(name)
        with self._members:
            if name in self._services:
                raise GraphError(f"service '{name}' is offered already")
            self._services[name] = service

    def _service(self, name: str) -> _Service:
        found = self._services.get(name)
        if found is None:
            raise GraphError(f"nobody offers service '{name}'")
        return found


def _request(service: _Service, request: Any | None) -> Any:
    """The request, or one of zeros."""
    if request is None:
        return zero_message(f"{service.srvtype}_Request")
    return request


def _has_gone(sender: Publisher) -> bool:
    """Whether a publisher was of a node that has been destroyed."""
    return bool(sender.owner) and sender.cancelled


def _check_name(name: str) -> None:
    parts = name.split("/")
    if not name.startswith("/") or not all(p.isidentifier() for p in parts[1:]):
        raise GraphError(
            f"'{name}' is no valid name: absolute, of letters, digits and _ between slashes"
        )


def check_period(period_s: float) -> None:
    """Refuse a timer period that is not a positive finite number of seconds."""
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise GraphError(f"a timer period must be a positive number of seconds, not {period_s}")
