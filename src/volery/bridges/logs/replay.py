"""Replays a log into a graph, in simulated time.

    replay = Replay("flight.mcap", topics=("/uav1/**",), remap={"/uav1/**": "/ghost/**"})
    replay.start(graph, timers, now_ns)

Every message is published when it is due: at the start time plus its distance from the log's first
message. The log is read as needed, a chunk at a time. Messages are in the order of the log; one
with an earlier time than its predecessor is published with that one. The headers' stamps are
unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.records import LogRecord
from volery.bridges.logs.stream import LogStream
from volery.bridges.topic_patterns import renamer, topic_filter
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.errors import GraphError, RecordingError
from volery.graph.graph import Graph
from volery.graph.nodes.deferred_execution import Deferred
from volery.graph.topics import Publisher

EVERYTHING = ("/**",)
CLOCK = ("/clock",)
LATCHED = ("/tf_static",)

_SHORTEST_LAP_NS = 1_000_000


@dataclass(frozen=True)
class ReplayInfo:
    """State of a replay."""

    path: str
    running: bool
    published: int
    skipped: int
    """Messages that could not be published."""
    laps: int
    """Number of times the log was played to its end."""
    problem: str
    """Problems of the file, as far as it was read: cut off, damaged chunks."""
    refused: Mapping[str, str]
    """Topics with skipped messages, each with the first reason."""


class _Cursor(NamedTuple):
    """Position of a replay: start of its lap, and the number of the log's next record."""

    lap_ns: int
    record: int


class Replay:
    """Replays a log. Methods except `info` belong to the simulation's thread; see `Gateway.post`.

    Parameters
    ----------
    path
        A .mcap or .bag file, whole or truncated.
    topics, exclude
            Patterns of played topics (names of the log), and of exceptions; see `topic_patterns`. A
            graph has its own clock, so `/clock` is excluded by default.
    remap
        New names of topics, or of whole branches: `{"/uav1/**": "/uav2/**"}`.
    rate
        Seconds of the log per simulated second.
    offset_s
        Simulated seconds between the start and the log's first message.
    begin_s
            Seconds of the log skipped at its beginning; latched messages of this time are published
            at once.
    loop
        Restart at the end.
    latched
        Patterns of topics whose last message is sent to later subscribers.

    Raises
    ------
    RecordingError
        There is no such file, it is no log, or a number is out of range.
    GraphError
        A pattern or a new name is invalid.

    """

    def __init__(
        self,
        path: str | Path,
        *,
        topics: Iterable[str] = EVERYTHING,
        exclude: Iterable[str] = CLOCK,
        remap: Mapping[str, str] | None = None,
        rate: float = 1.0,
        offset_s: float = 0.0,
        begin_s: float = 0.0,
        loop: bool = False,
        latched: Iterable[str] = LATCHED,
    ) -> None:
        _check(rate, offset_s, begin_s)
        self._stream = LogStream(Path(path), topic_filter(topics, exclude))
        self._rename = renamer(remap or {})
        self._is_latched = topic_filter(latched)
        self._rate = rate
        self._offset_ns = ns_from_s(offset_s)
        self._begin_ns = ns_from_s(begin_s)
        self._loop = loop
        self._decoder = LogDecoder()
        self._publishers: dict[str, Publisher] = {}
        self._graph: Graph
        self._timers: Deferred
        self._now_ns: Callable[[], int]
        self._started = self._stopped = False
        self._running = False
        self._published = self._skipped = self._laps = 0
        self._refused: dict[str, str] = {}

    @property
    def info(self) -> ReplayInfo:
        """Returns the counts so far; any thread may call it."""
        return ReplayInfo(
            str(self._stream.path),
            self._running,
            self._published,
            self._skipped,
            self._laps,
            self._stream.problem,
            dict(self._refused),
        )

    def start(self, graph: Graph, timers: Deferred, now_ns: Callable[[], int]) -> None:
        """Starts at the current time of `now_ns`. Raises `RecordingError` the second time.

        timers: the engine, or another source of callbacks at times of the same clock.
        """
        if self._started:
            raise RecordingError(f"{self._stream.path}: this replay was started before")
        self._started = self._running = True
        self._graph, self._timers, self._now_ns = graph, timers, now_ns
        self._go_on(_Cursor(now_ns() + self._offset_ns, 0))

    def stop(self) -> None:
        """Stops publishing and clears latched messages; further calls do nothing."""
        self._started = self._stopped = True
        self._running = False
        self._stream.close()
        for publisher in self._publishers.values():
            publisher.cancel()
        self._publishers.clear()

    # A restored snapshot brings back an earlier deadline: its position selects the next record.

    def _go_on(self, cursor: _Cursor) -> None:
        """Publishes what is due from `cursor` on, then waits for the next message."""
        self._stream.seek(cursor.record)
        while (record := self._stream.peek()) is not None:
            due_ns = self._due_ns(cursor.lap_ns, record)
            if due_ns is not None and due_ns > self._now_ns():
                self._wait(due_ns, _Cursor(cursor.lap_ns, self._stream.index))
                return
            self._stream.advance()
            if due_ns is not None:
                self._publish(record)
        self._end_lap(cursor)

    def _wait(self, due_ns: int, cursor: _Cursor) -> None:
        self._timers.at(due_ns, partial(self._wake, cursor))

    def _wake(self, cursor: _Cursor) -> None:
        if not self._stopped:
            self._running = True
            self._go_on(cursor)

    def _due_ns(self, lap_ns: int, record: LogRecord) -> int | None:
        """Returns the simulated time at which a record is published; None for never."""
        after_ns = record.time_ns - self._stream.first_ns - self._begin_ns
        if after_ns < 0:
            comes = not self._begin_ns or self._is_latched(record.topic.topic)
            return lap_ns if comes else None
        return lap_ns + (after_ns if self._rate == 1.0 else round(after_ns / self._rate))

    def _publish(self, record: LogRecord) -> None:
        topic = record.topic.topic
        try:
            msgtype, message = self._decoder.decode(record)
            publisher = self._publishers.get(topic)
            if publisher is None or publisher.msgtype != msgtype:
                publisher = self._graph.advertise(
                    self._rename(topic), msgtype, latched=self._is_latched(topic)
                )
                self._publishers[topic] = publisher
            publisher.publish(message)
        except GraphError as error:
            self._skipped += 1
            self._refused.setdefault(topic, str(error))
            return
        self._published += 1

    def _end_lap(self, cursor: _Cursor) -> None:
        self._laps += 1
        span_ns = self._stream.last_ns - self._stream.first_ns - self._begin_ns
        if not self._loop or self._stream.selected == 0 or span_ns < 0:
            self._running = False
            self._stream.close()
            return
        # The gap between two laps is the mean gap between two messages.
        gap_ns = span_ns / (self._stream.selected - 1) if self._stream.selected > 1 else 0.0
        lap_ns = max(round((span_ns + gap_ns) / self._rate), _SHORTEST_LAP_NS)
        next_lap = cursor.lap_ns + lap_ns
        self._wait(next_lap, _Cursor(next_lap, 0))


def _check(rate: float, offset_s: float, begin_s: float) -> None:
    if not (math.isfinite(rate) and rate > 0.0):
        raise RecordingError(f"the rate of a replay must be above 0, not {rate}")
    for name, value in (("offset_s", offset_s), ("begin_s", begin_s)):
        if not 0.0 <= value <= (1 << 62) / NS_PER_S:
            raise RecordingError(f"{name} of a replay must be at least 0 s, not {value}")
