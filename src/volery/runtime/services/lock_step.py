"""Serves lock-step partners over bridges: the simulation waits for programs in other processes.

A client calls `/volery/join_lock_step`, subscribes to `/volery/lock_step/NAME/go` and publishes on
`/volery/lock_step/NAME/done`, both `rosgraph_msgs/Clock`. At each barrier the simulation publishes
the time on `go`, after all messages up to then, and waits until the same time arrives on `done`;
commands that the client published before act from the next physics step. A client that joins before
the first step may request a barrier at time 0 too. A client that unadvertises `done`, or loses the
connection, has left. A reset sets the times back to 0.
"""

from __future__ import annotations

from typing import Any

from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.graph.messages import Clock, Published, message_type, time_from_ns
from volery.runtime.facets.clock import SimulationClock

SERVICE = "/volery/join_lock_step"
TYPE = "volery_interfaces/srv/JoinLockStep"


def open_lock_step(graph: Graph, clock: SimulationClock) -> None:
    """Creates `SERVICE`."""
    response = message_type(f"{TYPE}_Response")

    def join(request: Any) -> Any:
        try:
            _LockStepTopics(graph, clock, request)
        except CommandError as error:
            return response(success=False, message=str(error), now=time_from_ns(0))
        return response(success=True, message="", now=time_from_ns(graph.now_ns()))

    graph.create_service(SERVICE, TYPE, join)


class _LockStepTopics:
    """Runs the barriers with one client."""

    def __init__(self, graph: Graph, clock: SimulationClock, request: Any) -> None:
        name = request.name
        if not name.isidentifier():
            raise CommandError(f"'{name}' is no name for a partner: use letters, digits and _")
        self._graph = graph
        self._done = f"/volery/lock_step/{name}/done"
        if graph.publishers(self._done) == 0:
            raise CommandError(f"advertise {self._done} before joining, and subscribe to .../go")
        self._partner = clock.add_partner(
            name,
            period_s=request.period_s,
            timeout_s=request.timeout_s,
            on_timeout="stop" if request.stop_on_timeout else "leave",
            on_meeting=self._begin,
            is_there=self._is_there,
            supports_reset=request.supports_reset,
            meets_at_start=request.meets_at_start,
        )
        self._go = graph.advertise(f"/volery/lock_step/{name}/go", Clock)
        self._subscription = graph.subscribe(self._done, self._end, Clock)
        self._barrier_ns = -1

    def _is_there(self) -> bool:
        """Returns whether the client can still respond; cleans up after one that left."""
        there = self._graph.publishers(self._done) > 0
        if not there:
            self._clear_away()
        return there

    def _clear_away(self) -> None:
        self._go.cancel()
        self._subscription.cancel()

    def _begin(self, time_ns: int) -> None:
        self._barrier_ns = time_ns
        self._go.publish(Clock(time_from_ns(time_ns)))
        self._graph.deliver()

    def _end(self, published: Published) -> None:
        if self._partner.has_left:
            self._clear_away()
            return
        stamp = published.message.clock
        if stamp.sec * NS_PER_S + stamp.nanosec == self._barrier_ns:
            self._barrier_ns = -1
            self._partner.reply()
