"""Hosts a graph for nodes whose clock is that of a log's messages."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from typing import Any

from volery.core.clock import ns_from_s
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.graph.nodes.node import Context

_LEAP_NS = 60_000_000_000
"""Max gap in the log, ns, during which timers fire at their period; once after a longer one."""


class LogHost:
    """Publishes messages to nodes at the times of a log, and fires their timers in between."""

    def __init__(self) -> None:
        self._now_ns: int | None = None
        self.graph = Graph(self.now_ns)
        self._alarms: list[tuple[int, int, int, Callable[[], Any]]] = []
        self._forgotten: list[Callable[[], None]] = []
        self._numbers = itertools.count()
        self._publishers: dict[str, Any] = {}

    def now_ns(self) -> int:
        """Returns the time of the newest message, ns."""
        return self._now_ns or 0

    def context(self) -> Context:
        """Returns the context for a node."""
        return Context(self.graph, self, self.now_ns)

    def every(
        self,
        period_s: float,
        callback: Callable[[], None],
        *,
        wanted: Callable[[], bool] | None = None,
    ) -> None:
        """Calls `callback` each period of the log's time."""

        def ring() -> None:
            if callback not in self._forgotten and (wanted is None or wanted()):
                callback()

        period = ns_from_s(period_s)
        heapq.heappush(self._alarms, (self.now_ns() + period, next(self._numbers), period, ring))

    def forget(self, callback: Callable[[], None]) -> None:
        """Cancels a `callback` that was passed to `every`."""
        self._forgotten.append(callback)

    def at(self, time_ns: int, action: Callable[[], Any]) -> None:
        """Calls `action` once, at `time_ns` of the log's time."""
        heapq.heappush(self._alarms, (time_ns, next(self._numbers), 0, action))

    def listen(self, topic: str, callback: Callable[[Any], None]) -> None:
        """Calls `callback` with each message that a node publishes on a topic."""

        def take(published: Published) -> None:
            callback(published.message)

        self.graph.subscribe(topic, take)

    def publish(self, topic: str, time_ns: int, message: Any) -> None:
        """Publishes a message to nodes at a time; fires the timers that are due before."""
        self._run_to(time_ns)
        publisher = self._publishers.get(topic)
        if publisher is None:
            latched = topic == "/tf_static"
            publisher = self.graph.advertise(topic, message.__msgtype__, latched=latched)
            self._publishers[topic] = publisher
        publisher.publish(message)
        self.graph.deliver()

    def wait(self, seconds: float, until: Callable[[], bool]) -> None:
        """Fires timers for some more seconds of the log's time, or until `until()` is true."""
        for _ in range(round(2.0 * seconds)):
            if until():
                return
            self._run_to(self.now_ns() + 500_000_000)

    def _run_to(self, time_ns: int) -> None:
        now = self._now_ns
        if now is None or time_ns < now or time_ns > now + _LEAP_NS:
            # The clock was set, or the recording paused: timers continue from there.
            shift = time_ns - (now or 0)
            self._alarms = [(due + shift, n, p, ring) for due, n, p, ring in self._alarms]
            heapq.heapify(self._alarms)
            self._now_ns = time_ns
        while self._alarms and self._alarms[0][0] <= time_ns:
            due, number, period, ring = heapq.heappop(self._alarms)
            self._now_ns = max(self.now_ns(), due)
            if period:
                heapq.heappush(self._alarms, (due + period, number, period, ring))
            ring()
            self.graph.deliver()
        self._now_ns = time_ns
