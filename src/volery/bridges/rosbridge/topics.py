"""Topics of one rosbridge client: its publications and subscriptions."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from volery.bridges.rosbridge.fields import (
    MAX_FRAGMENT,
    Id,
    NeedlessOperationError,
    absolute,
    read_choice,
    read_id,
    read_limit,
    read_optional_text,
    read_qos,
    read_text,
)
from volery.bridges.rosbridge.message_encoder import COMPRESSIONS
from volery.bridges.rosbridge.wire import Operation
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.json_decoding import decode_plain
from volery.graph.codecs.present_times import with_present_times
from volery.graph.codecs.ros1_names import ros2_name
from volery.graph.messages import Published
from volery.graph.qos import DEFAULT_DEPTH, MAX_DEPTH
from volery.graph.session import Session
from volery.graph.subscription_queue import SubscriptionQueue

MAX_STREAMS = 10_000
"""Largest number of topics that a client may subscribe to, and publish."""
MAX_REQUESTS = 1000
"""Largest number of subscriptions of one topic by one client."""


@dataclass(frozen=True)
class SubscriptionOptions:
    """Options of one subscription."""

    throttle_s: float = 0.0
    """Minimum time between two messages."""
    queue_length: int = 0
    """Largest number of queued messages; 0: one if throttled, else the default depth."""
    fragment_size: int | None = None
    """Characters per fragment."""
    compression: str = "none"
    reliable: bool = False
    """Whether no message may be lost."""

    @property
    def depth(self) -> int:
        """Depth of the queue."""
        if self.queue_length:
            return self.queue_length
        return 1 if self.throttle_s else DEFAULT_DEPTH


def read_wishes(operation: Operation) -> SubscriptionOptions:
    """Reads the options of a `subscribe` operation. Raises `BridgeError` for invalid values."""
    size = read_limit(operation, "fragment_size", MAX_FRAGMENT)
    qos = read_qos(operation)
    length = int(read_limit(operation, "queue_length", MAX_DEPTH))
    return SubscriptionOptions(
        read_limit(operation, "throttle_rate", 1e9) / 1000.0,
        length or (0 if qos is None else qos.depth),
        int(size) or None,
        read_choice(operation, "compression", COMPRESSIONS),
        qos is not None and qos.reliable,
    )


def combine(wishes: list[SubscriptionOptions]) -> SubscriptionOptions:
    """Returns options that satisfy all subscriptions.

    These are the lowest throttle, longest queue, smallest fragments and most compact form.
    """
    sizes = [w.fragment_size for w in wishes if w.fragment_size]
    return SubscriptionOptions(
        min(w.throttle_s for w in wishes),
        max(w.queue_length for w in wishes),
        min(sizes) if sizes else None,
        max((w.compression for w in wishes), key=COMPRESSIONS.index),
        any(w.reliable for w in wishes),
    )


@dataclass
class Advertisements:
    """A client's advertisements of one topic."""

    msgtype: str
    ids: set[Id] = field(default_factory=set)
    """Their ids; empty for a topic that the client publishes without having advertised it."""


class TopicStream:
    """One topic's messages for one client."""

    def __init__(self, name: str, msgtype: str | None) -> None:
        self.name = name
        """The client's name of the topic."""
        self.msgtype = msgtype
        self.requests: dict[Id, SubscriptionOptions] = {}
        self.wishes = SubscriptionOptions()
        self.queue: SubscriptionQueue | None = None
        self._tuned = (0, False)
        self._left: deque[Published] = deque()
        """Messages of a queue that another one has replaced."""
        self._next_s = float("-inf")

    def tune(self, session: Session, wake: Callable[[], None], *, is_new: bool) -> None:
        """Adapts the queue to the requests.

        is_new: a new subscription needs latched messages even if they were sent before.
        """
        self.wishes = combine(list(self.requests.values()))
        depth, reliable = tuned = self.wishes.depth, self.wishes.reliable
        latched = is_new and self.queue is not None and bool(_latched(session, self.name))
        if tuned == self._tuned and not latched:
            return
        topic = absolute(self.name)
        queue = session.subscribe(topic, self.msgtype, depth=depth, reliable=reliable, wake=wake)
        waiting: list[Published] = []
        if self.queue is not None:
            session.unsubscribe(self.queue)
            waiting = self.queue.take()
        # both queues were open for a moment and may have the same messages
        seen = {id(published) for published in (*self._left, *waiting)}
        new = [published for published in queue.take() if id(published) not in seen]
        self._left = deque((*self._left, *waiting, *new), maxlen=None if reliable else depth)
        self.queue, self._tuned = queue, tuned

    def take(self, now_s: float) -> Published | None:
        """Returns the next message, if one is due."""
        if now_s < self._next_s or self.queue is None:
            return None
        if self._left:
            found = self._left.popleft()
        else:
            taken = self.queue.take(1)
            if not taken:
                return None
            found = taken[0]
        if self.wishes.throttle_s:
            self._next_s = now_s + self.wishes.throttle_s
        return found

    @property
    def failure(self) -> str | None:
        """Why no more messages will arrive, if so."""
        return None if self.queue is None else self.queue.failure

    def due_s(self, now_s: float) -> float | None:
        """Returns when to check again; None until the queue wakes."""
        if self.queue is None or not (self._left or self.queue.info.waiting):
            return None
        return max(now_s, self._next_s)


def _latched(session: Session, name: str) -> bool:
    topic = absolute(name)
    return any(info.name == topic and info.latched for info in session.graph.topics())


class RosbridgeTopics:
    """The topics of one client."""

    def __init__(
        self,
        session: Session,
        wake: Callable[[], None],
        now_ns: Callable[[], int],
        complain: Callable[[str], None],
    ) -> None:
        self._session = session
        self._complain = complain
        self._wake = wake
        self._now_ns = now_ns
        self._streams: dict[str, TopicStream] = {}
        self._published: dict[str, Advertisements] = {}
        self._ready: deque[TopicStream] = deque()
        """Streams whose queues have woken; the simulation's thread appends."""
        self._held: list[TopicStream] = []
        """Streams whose messages are not due yet."""

    def advertise(self, operation: Operation) -> None:
        """Advertises a topic of the client; advertisements with other ids stay.

        The topic is latched once one of them is.
        """
        topic, key = absolute(read_text(operation, "topic")), read_id(operation)
        msgtype = ros2_name(read_text(operation, "type"))
        qos = read_qos(operation)
        latched = operation.get("latch") is True or (qos is not None and qos.latched)
        self._check_room(topic, key)
        self._advertise(topic, msgtype, latched=latched).ids.add(key)

    def _check_room(self, topic: str, key: Id) -> None:
        known = self._published.get(topic)
        if known is not None and key not in known.ids and len(known.ids) >= MAX_REQUESTS:
            raise BridgeError(f"advertise: more than {MAX_REQUESTS} advertisements of '{topic}'")

    def _advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> Advertisements:
        if topic not in self._published and len(self._published) >= MAX_STREAMS:
            raise BridgeError(f"advertise: more than {MAX_STREAMS} topics")
        self._session.advertise(topic, msgtype, latched=latched)
        return self._published.setdefault(topic, Advertisements(msgtype))

    def unadvertise(self, operation: Operation) -> None:
        """Ends one advertisement of a topic, or all of them if none is named."""
        topic, key = absolute(read_text(operation, "topic")), read_id(operation)
        found = self._published.get(topic)
        if found is None:
            name = self._session.name
            raise NeedlessOperationError(f"unadvertise: {name} does not publish '{topic}'")
        if key is not None and found.ids and key not in found.ids:
            raise NeedlessOperationError(f"unadvertise: no such advertisement of '{topic}'")
        found.ids.discard(key)
        if found.ids and key is not None:
            return
        del self._published[topic]
        self._session.unadvertise(topic)

    def publish(self, operation: Operation) -> None:
        """Publishes a message; an existing topic need not be advertised."""
        topic = absolute(read_text(operation, "topic"))
        advertised = self._published.get(topic)
        if advertised is None:
            known = self._session.graph.topic_type(topic)
            if known is None:
                raise BridgeError(f"publish: no topic '{topic}'; advertise it first")
            advertised = self._advertise(topic, known)
        msgtype = advertised.msgtype
        plain = with_present_times(
            operation.get("msg", {}), msgtype, self._now_ns, stamps_headers=True
        )
        self._session.publish(topic, decode_plain(plain, msgtype))

    def subscribe(self, operation: Operation) -> None:
        """Subscribes to a topic, or adapts its stream to one more request."""
        name, key = read_text(operation, "topic"), read_id(operation)
        given = read_optional_text(operation, "type")
        msgtype = ros2_name(given) if given not in (None, "*") else None
        wishes = read_wishes(operation)
        stream = self._streams.get(name)
        if stream is None:
            if len(self._streams) >= MAX_STREAMS:
                raise BridgeError(f"subscribe: more than {MAX_STREAMS} topics")
            stream = TopicStream(name, msgtype)
        elif msgtype and msgtype != self._session.graph.topic_type(absolute(name)):
            raise GraphError(f"topic '{name}' is subscribed to with another type than {msgtype}")
        if key not in stream.requests and len(stream.requests) >= MAX_REQUESTS:
            raise BridgeError(f"subscribe: more than {MAX_REQUESTS} subscriptions of '{name}'")
        before = stream.requests.get(key)
        stream.requests[key] = wishes
        try:
            self._tune(stream, is_new=True)
        except GraphError:
            if before is None:
                del stream.requests[key]
            raise
        self._streams[name] = stream

    def unsubscribe(self, operation: Operation) -> None:
        """Ends one subscription of a topic, or all of them if none is named."""
        name, key = read_text(operation, "topic"), read_id(operation)
        stream = self._streams.get(name)
        if stream is None or (key is not None and key not in stream.requests):
            raise NeedlessOperationError(f"unsubscribe: no such subscription of '{name}'")
        if key is None:
            stream.requests.clear()
        else:
            del stream.requests[key]
        if stream.requests:
            self._tune(stream, is_new=False)
            return
        self._end(stream)

    def _end(self, stream: TopicStream) -> None:
        """Ends a stream."""
        stream.requests.clear()
        self._streams.pop(stream.name, None)
        if stream.queue is not None:
            self._session.unsubscribe(stream.queue)

    def close(self) -> None:
        """Drops all streams of a client that has left."""
        for stream in self._streams.values():
            stream.queue = None  # its `wake` refers to the stream
        self._streams.clear()
        self._ready.clear()
        self._held.clear()
        self._complain = _ignore

    def take(self, now_s: float) -> Iterator[tuple[TopicStream, Published]]:
        """Yields due messages, one of every stream in turn."""
        ready = [self._ready.popleft() for _ in range(len(self._ready))]
        busy = list(dict.fromkeys((*self._held, *ready)))
        self._held = []
        while busy:
            still = []
            for stream in busy:
                if not stream.requests:  # unsubscribed while others were being sent
                    continue
                published = stream.take(now_s)
                if published is not None:
                    yield stream, published
                    still.append(stream)
                elif stream.failure is not None:
                    self._end(stream)
                    self._complain(stream.failure)
                elif stream.due_s(now_s) is not None:
                    self._held.append(stream)
            busy = still

    def due_s(self, now_s: float) -> float | None:
        """Returns when to `take` again without a wake-up; None if nothing is pending."""
        times = [stream.due_s(now_s) for stream in self._held if stream.requests]
        return min((time for time in times if time is not None), default=None)

    def _tune(self, stream: TopicStream, *, is_new: bool) -> None:
        def wake() -> None:
            self._ready.append(stream)
            self._wake()

        stream.tune(self._session, wake, is_new=is_new)
        wake()  # latched messages, and those of the previous queue, are available already


def _ignore(_text: str) -> None:
    """Does nothing."""
