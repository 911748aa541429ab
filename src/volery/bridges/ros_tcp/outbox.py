"""Outgoing queue for one peer: commands first, then messages in the order of arrival.

Messages stay in their bounded queues until the socket accepts them, so that a peer that does not
read loses messages and costs no memory.
"""

from __future__ import annotations

import heapq
import itertools
import threading
from collections import deque
from collections.abc import Callable

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.payloads import Payloads
from volery.bridges.ros_tcp.wire import Bytes
from volery.core.errors import GraphError
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.session import Session
from volery.graph.subscription_queue import SubscriptionQueue, Wake

_BATCH_BYTES = 64 << 10
_BATCH_PARTS = 128
"""Parts per system call; Linux accepts 1024."""
_MAX_WAITING_BYTES = 1 << 20


class _Stream:
    """Messages of one topic for the peer."""

    def __init__(self, destination: str) -> None:
        self.destination = destination
        self.queue: SubscriptionQueue | None = None
        self.queued = False
        """Whether its turn is scheduled."""

    @property
    def next_number(self) -> int | None:
        """Number of its next message in the order of arrival; None if none waits."""
        return None if self.queue is None else self.queue.next_number


class RosTcpOutbox:
    """Frames for one peer. Any thread may call `put` and fill the queues.

    wake: called, in any thread, when there is something to gather after there was nothing.
    """

    def __init__(
        self, session: Session, payloads: Payloads, wake: Wake, on_error: Callable[[str], None]
    ) -> None:
        self._session = session
        self.payloads = payloads
        """Encoding of messages; an endpoint's handshake may change it."""
        self.ends_in_nul = False
        """Whether the peer expects its commands to end in a NUL."""
        self._wake = wake
        self._on_error = on_error
        self._commands: deque[bytes] = deque()
        self._command_bytes = 0
        self._streams: dict[str, _Stream] = {}
        self._ready: deque[_Stream] = deque()
        """Streams that were empty before; any thread appends."""
        self._turns: list[tuple[int, int, _Stream]] = []
        """Heap of streams with messages: number of the next one, a number of their own."""
        self._numbers = itertools.count()
        self._lock = threading.Lock()
        self._woken = False

    def put(self, frame: bytes) -> None:
        """Adds a command, with its body if it has one, before all messages."""
        with self._lock:
            self._commands.append(frame)
            self._command_bytes += len(frame)
        self._stir()

    @property
    def crowded(self) -> bool:
        """Whether so many commands wait that no more should be caused."""
        return self._command_bytes > _MAX_WAITING_BYTES

    def stream(
        self,
        destination: str,
        topic: str,
        msgtype: str,
        depth: int = DEFAULT_DEPTH,
        *,
        reliable: bool = False,
    ) -> None:
        """Sends messages of `topic` as frames to `destination` from now on.

        A second call restarts the stream: latched messages are sent again, as by ROS-TCP-Endpoint.
        Raises `GraphError` for a wrong name or type.
        """
        stream = _Stream(destination)

        def stir() -> None:
            self._ready.append(stream)
            self._stir()

        self.payloads.learn(msgtype)
        queue = self._session.subscribe(topic, msgtype, depth=depth, reliable=reliable, wake=stir)
        self.end_stream(destination)
        stream.queue = queue
        self._streams[destination] = stream
        stir()  # latched messages arrived before the queue was known

    def end_stream(self, destination: str) -> bool:
        """Ends a stream; returns whether there was one."""
        stream = self._streams.pop(destination, None)
        if stream is None or stream.queue is None:
            return False
        self._session.unsubscribe(stream.queue)
        stream.queue = None
        return True

    @property
    def streams(self) -> int:
        """Number of streams."""
        return len(self._streams)

    def gather(self) -> list[Bytes]:
        """Returns parts of whole frames to send next, a bounded number; none if nothing waits."""
        self._woken = False
        parts: list[Bytes] = []
        size = 0
        while size < _BATCH_BYTES and len(parts) < _BATCH_PARTS:
            frame = self._next_command()
            if frame is not None:
                parts.append(frame)
                size += len(frame)
                continue
            stream = self._next_stream()
            if stream is None and self._commands:  # notices of an ended topic
                continue
            if stream is None:
                break
            size += self._add_message(stream, parts)
        return parts

    def _next_command(self) -> bytes | None:
        with self._lock:
            if not self._commands:
                return None
            frame = self._commands.popleft()
            self._command_bytes -= len(frame)
            return frame

    def _next_stream(self) -> _Stream | None:
        """Returns the topic with the oldest next message."""
        while self._ready:
            self._plan(self._ready.popleft())
        while self._turns:
            number, _, stream = heapq.heappop(self._turns)
            stream.queued = False
            if stream.next_number == number:
                return stream
            self._plan(stream)  # its oldest messages were dropped
        return None

    def _plan(self, stream: _Stream) -> None:
        """Schedules a topic, or ends it if it has lost messages of a reliable subscription."""
        if stream.queue is not None and stream.queue.failure is not None:
            failure = stream.queue.failure
            self.end_stream(stream.destination)
            self._on_error(failure)
            return
        number = stream.next_number
        if number is not None and not stream.queued:
            stream.queued = True
            heapq.heappush(self._turns, (number, next(self._numbers), stream))

    def _add_message(self, stream: _Stream, parts: list[Bytes]) -> int:
        """Adds a topic's next message; returns its bytes."""
        taken = [] if stream.queue is None else stream.queue.take(1)
        self._plan(stream)
        if not taken:
            return 0
        try:
            payload = self.payloads.published(taken[0])
            size = sum(len(part) for part in payload)
        except GraphError as error:
            self.end_stream(stream.destination)
            self._on_error(f"'{stream.destination}' cannot be sent: {error}")
            return 0
        head = ros_tcp.head(stream.destination, size)
        parts += (head, *payload)
        return len(head) + size

    def _stir(self) -> None:
        if not self._woken:
            self._woken = True
            self._wake()
