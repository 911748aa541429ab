"""Runs nodes in their own process, connected to the graph of a simulation or a real vehicle.

    host = NodeHost(link, clock="auto")
    node = GapFollowing(context=host.context(), namespace="/uav1")
    host.spin()

The node is the same as inside the simulation: its clock is the graph's `/clock` if there is one,
else the computer's, and its timers use that clock.
"""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from volery.bridges.nodes.mirrored_graph import MirroredGraph
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.errors import GraphError
from volery.graph.connection import GraphConnection
from volery.graph.messages import Clock, Published, Time, message_type
from volery.graph.nodes.failures import reported_failures
from volery.graph.nodes.launch import Context
from volery.graph.nodes.presence import TYPE as PRESENCE_TYPE
from volery.graph.nodes.presence import presence_topic
from volery.graph.qos import QoSProfile
from volery.graph.topics import Subscription

ClockKind = Literal["auto", "simulated", "wall"]
_LONGEST_WAIT_S = 0.2
_CLOCKS_KEPT = 1000
"""Number of queued clock messages, so that a busy node still gets its timers at each tick."""


@dataclass(order=True)
class _Alarm:
    """A timer that is due at a time, and then each period if the period is not 0."""

    due_ns: int
    number: int
    period_ns: int = field(compare=False)
    action: Callable[[], Any] = field(compare=False)
    callback: Callable[[], Any] | None = field(default=None, compare=False)
    """Callback given to `every`."""


class NodeHost:
    """Runs nodes in one thread. All methods except `stop` belong to the thread that spins.

    clock: `simulated` follows `/clock`, and no timer is due before its first message; `wall` is the
    computer's clock (ns since 1970); `auto` is `wall` until the first `/clock` message.
    """

    def __init__(self, link: GraphConnection, *, clock: ClockKind = "auto") -> None:
        self._link = link
        self._kind = clock
        self._woken = threading.Event()
        self._stopped = False
        self._simulated_ns: int | None = None
        self._alarms: list[_Alarm] = []
        self._numbers = itertools.count()
        self.graph = MirroredGraph(link, self.now_ns, self._woken.set)
        self._clock: Subscription | None = None
        if clock != "wall":
            self._clock = self.graph.subscribe(
                "/clock", self._on_clock, Clock, qos=QoSProfile(_CLOCKS_KEPT)
            )

    def context(self, remap: Mapping[str, str] | None = None) -> Context:
        """Returns a node's context; `remap` renames topics and services."""
        return Context(self.graph, self, self.now_ns, remap=dict(remap or {}))

    def now_ns(self) -> int:
        """Returns the simulated time, or the computer's, ns."""
        if self._simulated_ns is not None:
            return self._simulated_ns
        return 0 if self._kind == "simulated" else time.time_ns()

    # ------------------------------------------------------------------------------------ timers

    def every(
        self,
        period_s: float,
        callback: Callable[[], None],
        *,
        wanted: Callable[[], bool] | None = None,
    ) -> None:
        """Calls `callback` each period, if `wanted()`.

        After a pause once, not for each missed period.
        """

        def ring() -> None:
            if wanted is None or wanted():
                callback()

        period_ns = ns_from_s(period_s)
        alarm = _Alarm(self.now_ns() + period_ns, next(self._numbers), period_ns, ring, callback)
        self._set(alarm)

    def forget(self, callback: Callable[[], None]) -> None:
        """Removes a `callback` given to `every`."""
        self._alarms = [alarm for alarm in self._alarms if alarm.callback != callback]
        heapq.heapify(self._alarms)

    def at(self, time_ns: int, action: Callable[[], Any]) -> None:
        """Calls `action` once, at `time_ns` or as soon as possible."""
        self._set(_Alarm(time_ns, next(self._numbers), 0, action))

    def postpone(self, by_ns: int) -> None:
        """Delays all timers."""
        for alarm in self._alarms:
            alarm.due_ns += by_ns

    def _set(self, alarm: _Alarm) -> None:
        heapq.heappush(self._alarms, alarm)

    def _on_clock(self, published: Published) -> None:
        self._set_clock(published.message.clock)
        self._ring_due()

    def _set_clock(self, stamp: Time) -> None:
        before_ns, now_ns = self.now_ns(), stamp.sec * NS_PER_S + stamp.nanosec
        if self._simulated_ns is None or now_ns < before_ns:
            # The clock changed, or the simulation was reset: remaining times stay the same.
            for alarm in self._alarms:
                alarm.due_ns += now_ns - before_ns
        self._simulated_ns = now_ns

    def _ring_due(self) -> None:
        now_ns = self.now_ns()
        while self._alarms and self._alarms[0].due_ns <= now_ns:
            alarm = heapq.heappop(self._alarms)
            if alarm.period_ns:
                alarm.due_ns += (1 + (now_ns - alarm.due_ns) // alarm.period_ns) * alarm.period_ns
                self._set(alarm)
            alarm.action()

    # --------------------------------------------------------------------------------- lock step

    def join_lock_step(self, name: str, period_s: float, timeout_s: float = 10.0) -> None:
        """Makes the simulation wait for the nodes each `period_s`; call it before `spin`.

        At each exchange, all messages that the simulation has published are delivered and due
        timers are called before the simulation goes on: with its physics step as the period the
        nodes respond as they do inside. Raises `GraphError` if the simulation refuses.
        """
        go, done = (f"/volery/lock_step/{name}/{word}" for word in ("go", "done"))
        self._link.advertise(done, "rosgraph_msgs/msg/Clock")

        def meet(published: Published) -> None:
            self._ring_due()
            self._link.publish(done, published.message)

        if self._clock is not None:
            self._clock.cancel()  # the exchanges set the time
        self.graph.subscribe(go, meet, Clock)
        self.graph.hold_back(go, lambda published: self._set_clock(published.message.clock))
        srvtype = "volery_interfaces/srv/JoinLockStep"
        request = message_type(f"{srvtype}_Request")(
            name,
            period_s,
            timeout_s,
            stop_on_timeout=False,
            supports_reset=False,
            meets_at_start=True,
        )
        answer = self.graph.call("/volery/join_lock_step", request)
        if not answer.success:
            raise GraphError(f"no lock step: {answer.message}")
        self._begin_periods()
        self._set_clock(answer.now)

    def _begin_periods(self) -> None:
        """Restarts the timers: wall time since their creation is not simulated time."""
        if self._simulated_ns is None:
            now_ns = self.now_ns()
            for alarm in self._alarms:
                alarm.due_ns = now_ns + alarm.period_ns
            heapq.heapify(self._alarms)

    def announce(self, node: str) -> None:
        """Announces that the node of this full name is ready, for `volery run --wait-for`."""
        self._link.advertise(presence_topic(node), PRESENCE_TYPE)

    # --------------------------------------------------------------------------------------- run

    def spin(self, until: Callable[[], bool] | None = None) -> None:
        """Serves the nodes until `stop`, or until `until()` is true; errors of nodes end it."""
        with reported_failures(self.graph):
            while not self._stopped and not (until is not None and until()):
                self.spin_once(_LONGEST_WAIT_S)

    def spin_once(self, timeout_s: float) -> None:
        """Waits for work, at most `timeout_s`, and does it."""
        self._woken.wait(self._pause_s(timeout_s))
        self._woken.clear()
        while self.graph.hand_out():
            pass
        if self._simulated_ns is None and self._kind != "simulated":
            self._ring_due()

    def stop(self) -> None:
        """Ends `spin` soon; any thread may call it."""
        self._stopped = True
        self._woken.set()

    def _pause_s(self, max_s: float) -> float:
        if self._simulated_ns is not None or self._kind == "simulated" or not self._alarms:
            return max_s
        return min(max((self._alarms[0].due_ns - self.now_ns()) / NS_PER_S, 0.0), max_s)
