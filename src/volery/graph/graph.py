"""Provides the topics and services of one simulation.

Delivery is deterministic: a published message joins a queue, and `deliver` passes queued messages
to subscribers in the order of publication and subscription. Messages that a callback publishes join
the end of the queue.

The graph stores the last message of a latched publisher and passes it to later subscribers, like a
latched ROS 1 topic or ROS 2 durability TRANSIENT_LOCAL with depth 1.

Messages are published, and requests handled, in the simulation's thread only. Any thread may add or
remove publishers, subscribers and services: `graph.session` does so for external clients.
"""

from __future__ import annotations

import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from volery.core.errors import GraphError, VoleryError
from volery.core.plurals import counted
from volery.graph.actions import Actions
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Published, message_type, type_name
from volery.graph.moved_uavs import MovedUavs
from volery.graph.parameters import Parameters
from volery.graph.qos import DEFAULT_QOS, QoSProfile
from volery.graph.response_chains import ResponseChains
from volery.graph.service_reply import ServiceReply
from volery.graph.topics import Callback, Publisher, Subscription, Topic, TopicInfo

AsyncHandler = Callable[[Any, ServiceReply], None]
"""Handles a request and responds through the reply, at once or later."""

_log = logging.getLogger(__name__)

MAX_UNUSED = 1000
"""Maximum number of topics stored without publisher or subscriber."""


class _Listener:
    """A callback for all matching topics."""

    def __init__(
        self, callback: Callback, matches: Callable[[str], bool], *, is_machine: bool
    ) -> None:
        self.matches = matches
        self.is_machine = is_machine
        self._callback = callback

    def __call__(self, published: Published) -> None:
        self._callback(published)


def _match_all(_topic: str) -> bool:
    return True


class _QueuedMessage(NamedTuple):
    """A queued message; `only` is the late subscriber that a latched message is for."""

    topic: Topic
    published: Published
    sender: Publisher
    only: Callback | None = None
    client: str = ""
    """External client whose command caused the message."""
    answers: int = 0
    """Length of the chain of messages in response to each other, this message included."""


class Refusal(NamedTuple):
    """States that a client's message is not obeyed."""

    client: str
    topic: str
    msgtype: str
    reason: str


@dataclass(frozen=True)
class _Service:
    """A service: `handler` responds at once, `async_handler` at once or later."""

    srvtype: str
    handler: Callable[[Any], Any] | None
    async_handler: AsyncHandler
    owner: str = ""


class Graph:
    """Holds all topics and services.

    `now_ns` returns the simulated time of a publication. `post` runs a function in the simulation's
    thread; it carries everything that comes from other threads.
    """

    def __init__(
        self,
        now_ns: Callable[[], int],
        post: Callable[[Callable[[], Any]], Any] | None = None,
    ) -> None:
        self._now_ns = now_ns
        self._post = post
        self._topics: dict[str, Topic] = {}
        self._unused: dict[str, Topic] = {}
        self._expected: dict[str, list[Topic]] = {}
        """Topics that external clients expect with other types than `_topics`, by their names."""
        self._services: dict[str, _Service] = {}
        self.actions = Actions()
        """Action servers."""
        self.parameters = Parameters()
        """Parameters that the nodes have declared."""
        self.moved_uavs = MovedUavs()
        """UAVs that topics and services move, as their receivers declare."""
        self._to_all: list[_Listener] = []
        self._queue: deque[_QueuedMessage] = deque()
        self._answers = 0  # length of the chain that a message published now extends
        self._chains = ResponseChains()
        self.acting_client = ""
        """External client whose command is being executed; empty: none. A subscriber that fails on
        a message caused by a client is logged, and does not end the run."""
        self.on_refused: Callable[[Refusal], None] = lambda _refusal: None
        """Receives what `refuse` says, in the simulation's thread."""
        self.on_node_call: Callable[[str, Any], None] = lambda _service, _request: None
        """Receives the service and the request of each call by a node, before the call."""
        self.sender: Publisher | None = None
        """Publisher of the message that is being delivered; None: none is."""
        self.changes = 0
        """Number of changes of publishers and subscriptions so far."""
        self._passive_topic = ""
        """Topic whose passive subscriber is being called; empty: none is."""
        self._members = threading.RLock()
        """Guards changes of topics, publishers, subscribers and services."""

    def __repr__(self) -> str:
        counts = counted(len(self._topics), "topic"), counted(len(self._services), "service")
        return f"<graph: {', '.join(counts)}>"

    def now_ns(self) -> int:
        """Returns the simulated time, ns."""
        return self._now_ns()

    def post(self, action: Callable[[], Any]) -> None:
        """Runs `action()` in the simulation's thread; raises `GraphError` if the graph has none."""
        if self._post is None:
            raise GraphError("this graph has no thread of its own to post to")
        self._post(action)

    def enter(self, node: str) -> None:
        """Registers a node by its full name."""
        self.parameters.enter(node)

    def count_change(self) -> None:
        """Counts a change of what some publisher's `has_subscribers` depends on."""
        with self._members:
            self.changes += 1

    # ---------------------------------------------------------------------------------- topics

    def is_recorded(self, topic: str) -> bool:
        """Returns whether a recorder or digest receives the messages of a topic."""
        return any(listener.matches(topic) for listener in self._to_all)

    def must_cross(self, topic: str) -> bool:
        """Returns whether another machine of a divided run receives the messages of a topic."""
        return any(each.is_machine and each.matches(topic) for each in self._to_all)

    def advertise(
        self,
        topic: str,
        msgtype: str | type[Any],
        *,
        latched: bool = False,
        local: bool = False,
    ) -> Publisher:
        """Adds a publisher. Raises `GraphError` if the topic has another type.

        The type prevails over that of subscriptions of other threads, which end; see `attach`.

        latched: later subscribers receive the publisher's last message. local: in a divided run,
        only this machine has the publisher, so that its messages cross to the others.
        """
        with self._members:
            found = self._decided_topic(topic, msgtype)
            found.publishers += 1
            self.changes += 1
            found.num_local += local
            found.latched = found.latched or latched
        return Publisher(self, found, latched=latched, local=local)

    def remove_publisher(self, publisher: Publisher, topic: Topic) -> None:
        """Removes a publisher; used by `Publisher`."""
        with self._members:
            topic.publishers -= 1
            self.changes += 1
            topic.num_local -= publisher.local
            topic.last_messages.pop(publisher, None)
            self._drop_unused(topic)

    def subscribe(
        self,
        topic: str,
        callback: Callback,
        msgtype: str | type[Any] | None = None,
        *,
        qos: QoSProfile = DEFAULT_QOS,  # noqa: ARG002
        passive: bool = False,
    ) -> Subscription:
        """Calls `callback` with each message of `topic`.

        Without `msgtype`, the topic must exist. As for `advertise`, the type prevails.

        passive: the callback publishes and calls nothing (which raises `GraphError` then), so that
        the machines of a divided run need not meet for its messages.

        qos: affects only messages that have to wait, which never happens in lock step. The next
        delivery starts with the messages that latched publishers sent before; their `time_ns` is
        the time of this subscription.
        """
        with self._members:
            found = self._decided_topic(topic, self._type_of(topic, msgtype))
            if passive:
                callback = self._passive(callback)
                found.passive.append(callback)
            found.callbacks.append(callback)
            self.changes += 1

        def leave() -> None:
            if passive:
                found.passive.remove(callback)
            self._drop_unused(found)

        self._send_latched([found], callback)
        return Subscription(found.callbacks, callback, leave)

    def attach(
        self,
        topic: str,
        callback: Callback,
        msgtype: str | type[Any] | None = None,
        *,
        on_ended: Callable[[str], None] = lambda _reason: None,
    ) -> Subscription:
        """Like `subscribe`, for a callback of any thread; passes latched messages at once.

        The order of the callback among the subscribers does not affect the simulation, and neither
        does its type: the subscription waits for a publisher, or a subscriber of the simulation,
        and ends with `on_ended(reason)`, which must not block, if that one has another type.
        """
        with self._members:
            found = self._expected_topic(topic, self._type_of(topic, msgtype))
            for published in tuple(found.last_messages.values()):
                callback(published)
            found.callbacks.append(callback)
            found.external.append(callback)
            found.on_ended.append(on_ended)
            found.num_attached += 1
            self.changes += 1

        def leave() -> None:
            found.external.remove(callback)
            found.on_ended.remove(on_ended)
            self._drop_unused(found)

        return Subscription(found.callbacks, callback, leave)

    def subscribe_all(
        self,
        callback: Callback,
        matches: Callable[[str], bool] | None = None,
        *,
        is_machine: bool = False,
    ) -> Subscription:
        """Calls `callback` with every message, before the subscribers of the topic.

        Latched messages come first, as for `subscribe`.

        matches: returns whether to receive a topic, given its name; without it, all topics. No
        messages are built for it on other topics. is_machine: it passes them to another machine of
        a divided run; see `must_cross`.
        """
        listener = _Listener(callback, matches or _match_all, is_machine=is_machine)
        self._to_all.append(listener)
        self.count_change()
        meant = [topic for topic in self._topics.values() if listener.matches(topic.name)]
        self._send_latched(meant, listener)
        return Subscription(self._to_all, listener, self.count_change)

    def topics(self) -> list[TopicInfo]:
        """Returns all topics, sorted by name."""
        with self._members:
            return [
                TopicInfo(t.name, t.msgtype, t.publishers, len(t.callbacks), t.messages, t.latched)
                for _, t in sorted(self._topics.items())
            ]

    def publishers(self, topic: str) -> int:
        """Returns the number of publishers of a topic."""
        found = self._topics.get(topic)
        return 0 if found is None else found.publishers

    def subscribers(self, topic: str) -> int:
        """Returns the number of subscribers to a topic."""
        found = self._topics.get(topic)
        return 0 if found is None else len(found.callbacks)

    def local_topics(self) -> dict[str, tuple[str, bool]]:
        """Returns type and latching of the topics with a publisher that only this machine has."""
        with self._members:
            return {t.name: (t.msgtype, t.latched) for t in self._topics.values() if t.num_local}

    def subscribed_topics(self) -> list[str]:
        """Returns the names of the topics with subscribers."""
        with self._members:
            return [topic.name for topic in self._topics.values() if topic.callbacks]

    def topic_type(self, topic: str) -> str | None:
        """Returns the type of a topic, or None if the topic does not exist."""
        found = self._topics.get(topic)
        return None if found is None else found.msgtype

    def enqueue(self, sender: Publisher, topic: Topic, message: Any) -> None:
        """Queues a message; used by `Publisher`."""
        self._check_may_act(f"publishes on '{topic.name}'")
        sender.check(message)
        topic.messages += 1
        if sender.has_subscribers:
            published = Published(topic.name, topic.msgtype, self._now_ns(), message)
            client, answers = self.acting_client, self._answers
            if answers and self._chains.is_endless(sender, topic, published, answers, client):
                return
            self._queue.append(_QueuedMessage(topic, published, sender, None, client, answers))

    def publish_external(self, sender: Publisher, topic: Topic, message: Any) -> None:
        """Passes a message to external clients only; used by `Publisher`."""
        sender.check(message)
        topic.messages += 1
        published = Published(topic.name, topic.msgtype, self._now_ns(), message)
        for callback in tuple(topic.external):
            callback(published)

    def publish_at_end(self, sender: Publisher, message: Any) -> None:
        """Passes a message to recorders and external clients at once, at the end of a run."""
        published = Published(sender.topic, sender.msgtype, self._now_ns(), message)
        with self._members:
            topic = self._topics.get(sender.topic)
            recorders = (c for c in self._to_all if c.matches(sender.topic))
            callbacks = (*recorders, *(topic.external if topic is not None else ()))
        for callback in callbacks:
            callback(published)

    def republish_latched(self) -> None:
        """Sends all latched messages to the external clients again, after the state has jumped."""
        with self._members:
            topics = [
                (tuple(t.external), tuple(t.last_messages.values())) for t in self._topics.values()
            ]
        for callbacks, messages in topics:
            for callback in callbacks:
                for published in messages:
                    callback(published)

    def deliver(self) -> None:
        """Delivers all queued messages, including those published meanwhile."""
        before = self._answers
        try:
            self._deliver()
        finally:
            self._answers, self.sender = before, None

    def _deliver(self) -> None:
        while self._queue:
            topic, published, sender, only, client, answers = self._queue.popleft()
            self._answers, self.sender = answers + 1, sender
            if only is not None:
                if only in topic.callbacks or only in self._to_all:
                    only(published)
                continue
            with self._members:  # a client that attaches meanwhile receives the message once
                if sender.is_latching:
                    topic.last_messages[sender] = published
                if topic.seen_changes != self.changes:
                    topic.seen_changes = self.changes
                    topic.recorders = tuple(c for c in self._to_all if c.matches(topic.name))
                callbacks = tuple(topic.callbacks)
            for listener in topic.recorders:
                listener(published)
            if client:
                self._deliver_for_client(client, callbacks, published)
                continue
            for callback in callbacks:
                callback(published)

    def _deliver_for_client(
        self, client: str, callbacks: Iterable[Callback], published: Published
    ) -> None:
        """Delivers a message that a client caused; a failing callback does not end the run."""
        with self.on_behalf_of(client):
            for callback in callbacks:
                try:
                    callback(published)
                except Exception as error:
                    self.refuse(published.topic, _first_line(error))
                    _log.warning(
                        "topic '%s': a message caused by %s was rejected: %s",
                        published.topic,
                        client,
                        error,
                        exc_info=not isinstance(error, VoleryError),
                    )

    def refuse(self, topic: str, reason: str) -> None:
        """Reports to the client that caused the delivered message why it is refused.

        Has no effect for messages of the simulation's own nodes. In the simulation's thread.
        """
        if self.acting_client:
            msgtype = self.topic_type(topic) or ""
            self.on_refused(Refusal(self.acting_client, topic, msgtype, reason))

    @contextmanager
    def on_behalf_of(self, client: str) -> Iterator[None]:
        """Context in which an external client causes everything that is published."""
        before, self.acting_client = self.acting_client, client
        try:
            yield
        finally:
            self.acting_client = before

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot: queued and latched messages, message counts."""
        with self._members:
            topics = {name: (t.messages, dict(t.last_messages)) for name, t in self._topics.items()}
        queue = [message for message in self._queue if not message.sender.lasting]
        return {"queue": queue, "topics": topics}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state; topics, subscribers and services stay as they are.

        Messages of nodes that have been destroyed since then are left out.
        """
        lasting = [message for message in self._queue if message.sender.lasting]
        restored = [message for message in state["queue"] if not _has_gone(message.sender)]
        self._queue = deque([*lasting, *restored])
        with self._members:
            for name, topic in self._topics.items():
                messages, latched = state["topics"].get(name, (0, {}))
                topic.messages = messages
                topic.last_messages = {p: m for p, m in latched.items() if not _has_gone(p)}

    @contextmanager
    def in_place_of(self, state: dict[str, Any]) -> Iterator[None]:
        """Queues new messages at the position of the destroyed nodes' messages in `state`."""
        queue = state["queue"]
        first = next(
            (k for k, message in enumerate(queue) if _has_gone(message.sender)), len(queue)
        )
        behind = sum(not _has_gone(message.sender) for message in queue[first:])
        after = [self._queue.pop() for _ in range(behind)]
        try:
            yield
        finally:
            self._queue.extend(reversed(after))

    def _passive(self, callback: Callback) -> Callback:
        """Returns the callback of a subscriber that publishes and calls nothing."""

        def receive(published: Published) -> None:
            before, self._passive_topic = self._passive_topic, published.topic
            try:
                callback(published)
            finally:
                self._passive_topic = before

        return receive

    def _check_may_act(self, action: str) -> None:
        if self._passive_topic:
            raise GraphError(
                f"a subscription of '{self._passive_topic}' is declared passive, but its callback "
                f"{action}: publish and call in a timer, or omit passive=True"
            )

    def _drop_unused(self, topic: Topic) -> None:
        """Removes the oldest unused topic when there are more than MAX_UNUSED."""
        with self._members:
            self.changes += 1
            if topic.used:
                return
            if self._topics.get(topic.name) is not topic:
                self._drop_expected(topic)
                return
            others = self._expected.get(topic.name)
            if others:
                self._topics[topic.name] = others[0]
                self._drop_expected(others[0])
                return
            self._unused[topic.name] = topic
            if len(self._unused) > MAX_UNUSED:
                oldest = self._unused.pop(next(iter(self._unused)))
                if not oldest.used:
                    del self._topics[oldest.name]

    def _drop_expected(self, topic: Topic) -> None:
        others = self._expected.get(topic.name, [])
        if topic in others:
            others.remove(topic)
        if not others:
            self._expected.pop(topic.name, None)

    def _send_latched(self, topics: list[Topic], callback: Callback) -> None:
        """Queues latched messages before all others, which are newer."""
        now_ns = self._now_ns()
        queued = [
            _QueuedMessage(topic, replace(published, time_ns=now_ns), sender, callback)
            for topic in topics
            for sender, published in topic.last_messages.items()
        ]
        self._queue.extendleft(reversed(queued))

    def _type_of(self, name: str, msgtype: str | type[Any] | None) -> str | type[Any]:
        if msgtype is not None:
            return msgtype
        if name not in self._topics:
            raise GraphError(f"no topic '{name}'; give a type to subscribe before it exists")
        return self._topics[name].msgtype

    def _decided_topic(self, name: str, msgtype: str | type[Any]) -> Topic:
        """Returns the topic for a publisher or subscriber whose type prevails."""
        found = self._expected_topic(name, msgtype)
        rest = self._expected.pop(name, [])
        if self._topics[name] is not found:
            rest.append(self._topics[name])
            self._topics[name] = found
        for topic in rest:
            if topic is not found:
                topic.end(f"topic '{name}' carries {found.msgtype}, not {topic.msgtype}")
        return found

    def _expected_topic(self, name: str, msgtype: str | type[Any]) -> Topic:
        """Returns the topic for a subscriber that waits for one of this type.

        Raises `GraphError` if the topic has another type that is decided.
        """
        kind = msgtype if isinstance(msgtype, str) else type_name(msgtype)
        _check_name(name)
        topic = self._topics.get(name)
        if topic is not None and topic.msgtype == kind:
            return topic
        try:
            message_type(kind)
        except KeyError:
            raise GraphError(f"topic '{name}': unknown message type '{kind}'") from None
        if topic is not None and topic.is_decided:
            raise GraphError(f"topic '{name}' carries {topic.msgtype}, not {kind}")
        if topic is None or not topic.used:
            self._unused.pop(name, None)
            topic = self._topics[name] = Topic(name, kind)
            return topic
        others = self._expected.setdefault(name, [])
        for other in others:
            if other.msgtype == kind:
                return other
        others.append(Topic(name, kind))
        return others[-1]

    # -------------------------------------------------------------------------------- services

    def create_service(self, service: str, srvtype: str, handler: Callable[[Any], Any]) -> None:
        """Creates a service: `handler(request)` returns the response message."""

        def handle(request: Any, reply: ServiceReply) -> None:
            reply.answer(handler(request))

        self._add_service(service, _Service(srvtype, handler, handle))

    def create_async_service(
        self, service: str, srvtype: str, handler: AsyncHandler, *, owner: str = ""
    ) -> None:
        """Creates a service that may respond later; only `call_async` can call it.

        owner: external client that serves it.
        """
        self._add_service(service, _Service(srvtype, None, handler, owner))

    def destroy_service(self, service: str) -> None:
        """Destroys a service."""
        with self._members:
            self._services.pop(service, None)

    def call(self, service: str, request: Any | None = None) -> Any:
        """Calls a service and returns its response. Raises `GraphError` if it has no server."""
        self._check_may_act(f"calls '{service}'")
        found = self._service(service)
        if found.handler is None:
            raise GraphError(f"service '{service}' has an external server: use call_async")
        return found.handler(_request(found, request))

    def call_async(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service that may respond later. Raises `GraphError` if it has no server."""
        self._check_may_act(f"calls '{service}'")
        found = self._service(service)
        found.async_handler(_request(found, request), reply)

    def has_service(self, service: str) -> bool:
        """Returns whether the service has a server."""
        return service in self._services

    def service_type(self, service: str) -> str:
        """Returns the type of a service. Raises `GraphError` if it has no server."""
        return self._service(service).srvtype

    def services(self) -> dict[str, str]:
        """Returns the names of all services and their types."""
        with self._members:
            return {name: s.srvtype for name, s in sorted(self._services.items())}

    def _add_service(self, name: str, service: _Service) -> None:
        _check_name(name)
        with self._members:
            if (other := self._services.get(name)) is not None:
                by = f": the client {other.owner}" if other.owner else ""
                raise GraphError(f"service '{name}' already has a server{by}")
            self._services[name] = service

    def _service(self, name: str) -> _Service:
        found = self._services.get(name)
        if found is None:
            raise GraphError(f"service '{name}' has no server; see `volery service list`")
        return found


def _request(service: _Service, request: Any | None) -> Any:
    """Returns the request, by default one of zeros."""
    if request is None:
        return zero_message(f"{service.srvtype}_Request")
    return request


def _first_line(error: Exception) -> str:
    lines = str(error).splitlines()
    return lines[0] if lines else type(error).__name__


def _has_gone(sender: Publisher) -> bool:
    """Returns whether a publisher's node has been destroyed."""
    return bool(sender.owner) and sender.cancelled


def _check_name(name: str) -> None:
    parts = name.split("/")
    if not name.startswith("/") or not all(p.isidentifier() for p in parts[1:]):
        raise GraphError(
            f"invalid name '{name}': use an absolute name of letters, digits and _ between slashes"
        )


def check_period(period_s: float) -> None:
    """Raises `GraphError` unless the period is a positive finite number of seconds."""
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise GraphError(f"a timer period must be a positive number of seconds, not {period_s}")
