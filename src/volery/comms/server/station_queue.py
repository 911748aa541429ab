"""The queue of messages for one station: a lane for each source, and messages in transit.

Every station has a queue of its own, so that traffic to one never delays another. Sources take
turns; within a lane messages keep their order.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from volery.comms.addresses import is_station
from volery.comms.control_payloads import Received
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.server.settings import RouterSettings


class QueuedMessage(NamedTuple):
    """A message in a queue."""

    frame: StationFrame
    arrived_ns: int
    due_ns: int
    """Earliest time of delivery, ns."""
    number: int
    """Counts the messages of a lane."""


class SentMessage(NamedTuple):
    """Result of adding a message."""

    kept: bool
    dropped: tuple[StationFrame, ...] = ()
    """Older measurements dropped for it."""


class _Lane:
    """Messages from one source, commands and sensing apart, so that each can be bounded."""

    def __init__(self) -> None:
        self.commands: deque[QueuedMessage] = deque()
        self.sensing: deque[QueuedMessage] = deque()
        self.sent: deque[QueuedMessage] = deque()
        """In transit: sent and not yet acknowledged."""
        self.last_due_ns = 0
        self.count = 0

    def __len__(self) -> int:
        return len(self.commands) + len(self.sensing)

    def of(self, kind: int) -> deque[QueuedMessage]:
        return self.commands if kind == StationFrameKind.COMMAND else self.sensing

    def next(self) -> deque[QueuedMessage]:
        """Returns the queue whose first message is the lane's first."""
        if not self.commands or not self.sensing:
            return self.commands or self.sensing
        earlier = self.commands[0].number < self.sensing[0].number
        return self.commands if earlier else self.sensing

    def acknowledged(self, upto: Received) -> Iterator[QueuedMessage]:
        """Removes and yields acknowledged messages, up to a sequence of a session."""
        last = -1
        for index, waiting in enumerate(self.sent):
            frame = waiting.frame
            if frame.session == upto.session and frame.sequence <= upto.sequence:
                last = index
            elif frame.session == upto.session:
                break
        for _ in range(last + 1):
            yield self.sent.popleft()

    def rewind(self) -> None:
        """Returns messages in transit to the head of their queues."""
        while self.sent:
            waiting = self.sent.pop()
            self.of(waiting.frame.kind).appendleft(waiting)


class StationQueue:
    """Bounded queues of messages for one station."""

    def __init__(self, settings: RouterSettings) -> None:
        self._settings = settings
        self._lanes: dict[int, _Lane] = {}
        self._turns: deque[int] = deque()
        self._num_in_flight = 0
        self._bytes = 0

    def __len__(self) -> int:
        """Returns the number of messages that wait or are in transit."""
        return sum(len(lane) for lane in self._lanes.values()) + self._num_in_flight

    def put(self, frame: StationFrame, now_ns: int, delay_ns: int = 0) -> tuple[SentMessage, int]:
        """Adds a message; returns the result and its due time.

        A full lane drops its oldest sensing, but no commands.
        """
        lane = self._lanes.setdefault(frame.source, _Lane())
        queue, size = lane.of(frame.kind), len(frame.data)
        dropped: list[StationFrame] = []
        while self._is_full(queue, size):
            if frame.kind == StationFrameKind.COMMAND or not queue:
                return SentMessage(False, tuple(dropped)), 0
            dropped.append(queue.popleft().frame)
            self._bytes -= len(dropped[-1].data)
        if frame.source not in self._turns:
            self._turns.append(frame.source)
        lane.last_due_ns = due_ns = max(lane.last_due_ns, now_ns + delay_ns)
        lane.count += 1
        queue.append(QueuedMessage(frame, now_ns, due_ns, lane.count))
        self._bytes += size
        return SentMessage(True, tuple(dropped)), due_ns

    def take(self, now_ns: int) -> StationFrame | None:
        """Returns the next message, which is then in transit; None: no message is due.

        Sources take turns. At most `window` messages are in transit until `received`.
        """
        if self._num_in_flight >= self._settings.window:
            return None
        for _ in range(len(self._turns)):
            source = self._turns.popleft()
            lane = self._lanes[source]
            queue = lane.next()
            if not queue:
                continue
            self._turns.append(source)
            if queue[0].due_ns > now_ns:
                continue
            waiting = queue.popleft()
            lane.sent.append(waiting)
            self._num_in_flight += 1
            self._bytes -= len(waiting.frame.data)
            if not lane:
                self._turns.pop()
            return waiting.frame
        return None

    def received(self, upto: Received) -> list[StationFrame]:
        """Removes and returns messages that the station has acknowledged."""
        lane = self._lanes.get(upto.source)
        if lane is None:
            return []
        came = [waiting.frame for waiting in lane.acknowledged(upto)]
        self._num_in_flight -= len(came)
        self._forget_empty(upto.source, lane)
        return came

    def rewind(self) -> None:
        """Queues messages in transit again, after the connection has ended."""
        for source, lane in self._lanes.items():
            self._bytes += sum(len(waiting.frame.data) for waiting in lane.sent)
            lane.rewind()
            if lane and source not in self._turns:
                self._turns.append(source)
        self._num_in_flight = 0

    def expire(self, before_ns: int) -> list[StationFrame]:
        """Removes and returns messages that arrived before a time."""
        old: list[StationFrame] = []
        for source, lane in list(self._lanes.items()):
            for queue in (lane.commands, lane.sensing):
                while queue and queue[0].arrived_ns < before_ns:
                    frame = queue.popleft().frame
                    self._bytes -= len(frame.data)
                    old.append(frame)
            self._forget_empty(source, lane)
        return old

    def expire_many(self) -> list[StationFrame]:
        """Removes and returns sensing messages to many."""
        old: list[StationFrame] = []
        for source, lane in list(self._lanes.items()):
            gone = [w.frame for w in lane.sensing if not is_station(w.frame.destination)]
            if gone:
                kept = [w for w in lane.sensing if is_station(w.frame.destination)]
                lane.sensing = deque(kept)
                self._bytes -= sum(len(frame.data) for frame in gone)
                old += gone
            self._forget_empty(source, lane)
        return old

    def clear(self) -> list[StationFrame]:
        """Removes and returns all messages."""
        self.rewind()
        lanes = self._lanes.values()
        everything = [w.frame for lane in lanes for q in (lane.commands, lane.sensing) for w in q]
        self._lanes.clear()
        self._turns.clear()
        self._bytes = 0
        return everything

    def _is_full(self, queue: deque[QueuedMessage], size: int) -> bool:
        rules = self._settings
        return len(queue) >= rules.lane_depth or self._bytes + size > rules.queue_bytes

    def _forget_empty(self, source: int, lane: _Lane) -> None:
        """Deletes an empty lane, so that sources that have left use no memory."""
        if not lane and not lane.sent and source not in self._turns:
            del self._lanes[source]
