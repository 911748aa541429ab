"""Synchronizes one UAV with its external autopilot in lock step, over any transport.

At each exchange the autopilot receives new measurements of its UAV, and the simulation waits until
`go_on`. Rotor commands sent before that act from the next physics step. An autopilot that times out
ends the run with an error or is dropped with a warning. Time continues without an autopilot that
sleeps.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import struct
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type, time_from_ns
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Gateway, Session
from volery.graph.subscription_queue import SubscriptionQueue

_JOIN = "volery_interfaces/srv/JoinLockStep"
_SPEEDS = "std_msgs/msg/Float32MultiArray"
_CLOCK = "rosgraph_msgs/msg/Clock"
_MARGIN_S = 5.0
"""Time by which the simulation's timeout exceeds that of a session that drops its autopilot itself,
s."""
_GLANCE_S = 0.05
"""Time between two checks for silence, s."""
_SLEEP_S = 0.5
"""Wall time of silence after which an autopilot may be asleep, s, at most a fifth of its timeout.
"""
_MAX_SLEEP_FACTOR = 6.0
"""Longest sleep, as a factor on the timeout, wall time."""
_log = logging.getLogger(__name__)

News = Mapping[str, Any]
"""Newest messages since the last exchange, by topic below the UAV's name."""


class TimeoutPolicy(NamedTuple):
    """How long a connected autopilot may be silent, and what happens then."""

    timeout_s: float = 10.0
    """Wall time, s."""
    drops: bool = False
    """Whether the autopilot is then dropped and its rotors stop; else the run ends with an error.
    """


DEFAULT_TIMEOUT = TimeoutPolicy()


class ExternalAutopilot(Protocol):
    """The autopilot's side of a lock-step session."""

    @property
    def is_in_step(self) -> bool:
        """Whether the autopilot answers each exchange and any thread may call `send_sensors`."""

    @property
    def may_sleep(self) -> bool:
        """Whether silence may be normal, because the autopilot controls nothing."""

    def send_sensors(self, time_ns: int, news: News) -> bool:
        """Sends new messages to the autopilot; returns whether it will answer and call `go_on`."""

    def on_reset(self) -> None:
        """Handles a reset of the simulation: times are earlier than before."""

    def drop(self) -> None:
        """Drops the autopilot, which was silent for too long."""


class LockStepSession:
    """Joins the lock step for `uav` at once; `close` leaves it.

    kind: `px4` or another word for names. topics: message types by topic below the UAV's name.
    `ExternalAutopilot.send_sensors` is called in the loop's thread, or, once `is_in_step`, in the
    simulation's thread, which avoids a wake-up. Both hold `lock` during `send_sensors` and
    `on_reset`, and so must code that reads or changes what these do. All other calls belong to the
    loop's thread.
    """

    def __init__(
        self,
        gateway: Gateway,
        uav: str,
        kind: str,
        autopilot: ExternalAutopilot,
        *,
        period_ns: int,
        topics: Mapping[str, str],
        timeout_policy: TimeoutPolicy,
    ) -> None:
        self.lock = threading.RLock()
        self._uav, self._autopilot, self._timeout_policy = uav, autopilot, timeout_policy
        self._loop = asyncio.get_running_loop()
        self._session: Session = gateway.open(f"{kind} of {uav}")
        self._rotors = f"/{uav}/rotor_speeds"
        barrier = f"/volery/lock_step/{kind}_of_{uav}"
        self._done = f"{barrier}/done"
        self._pending = False
        self._since_s = 0.0
        """Wall time at which the current exchange began."""
        self._has_warned = False
        """Whether a failed `send_sensors` has been logged."""
        self._asleep_since_s: float | None = None
        """Wall time since which time goes on without the autopilot's answers."""
        self._period_s = period_ns / NS_PER_S
        self._watch = self._loop.create_task(self._watch_silence())
        self._time_ns = -1
        self._queues: dict[str, SubscriptionQueue] = {
            name: self._session.subscribe(f"/{uav}/{name}", msgtype, depth=1, wake=_nothing)
            for name, msgtype in topics.items()
        }
        self._speeds = message_type(_SPEEDS)
        self._layout = zero_message(_SPEEDS).layout
        self._clock = message_type(_CLOCK)
        self._session.advertise(self._rotors, _SPEEDS)
        self._session.advertise(self._done, _CLOCK)
        self._go = self._session.subscribe(f"{barrier}/go", _CLOCK, depth=1, wake=self._wake)
        self._join(f"{kind}_of_{uav}", period_ns)

    @property
    def time_ns(self) -> int:
        """Simulated time of the current or last exchange, ns."""
        return self._time_ns

    @property
    def waits(self) -> bool:
        """Whether the simulation waits for `go_on`."""
        return self._pending

    def turn_rotors(self, fractions: Sequence[float]) -> None:
        """Requests rotor speeds as fractions of full speed, in the order of the airframe."""
        self._publish((self._rotors, self._speeds_message(fractions)))

    def go_on(self, fractions: Sequence[float] | None = None) -> None:
        """Ends the exchange and requests rotor speeds, `fractions` as in `turn_rotors`.

        Without an exchange only the speeds are requested.
        """
        messages = [] if fractions is None else [(self._rotors, self._speeds_message(fractions))]
        if fractions is not None:
            self._asleep_since_s = None
        if self._pending:
            self._pending = False
            messages.append((self._done, self._clock(clock=time_from_ns(self._time_ns))))
        self._publish(*messages)

    def close(self) -> None:
        """Leaves the lock step and the graph; further calls do nothing."""
        with self.lock:
            self._pending = False
        self._watch.cancel()
        self._session.close()

    def _join(self, name: str, period_ns: int) -> None:
        request = zero_message(f"{_JOIN}_Request")
        request.name = name
        request.period_s = period_ns / NS_PER_S
        drops = self._timeout_policy.drops
        request.timeout_s = self._timeout_policy.timeout_s + (_MARGIN_S if drops else 0.0)
        request.stop_on_timeout = not drops
        request.supports_reset = True
        self._session.call("/volery/join_lock_step", request, ServiceReply(_answered, _answered))

    def _wake(self) -> None:
        if self._autopilot.is_in_step:
            self._meet()
            return
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._meet)

    def _meet(self) -> None:
        with self.lock:
            for published in self._go.take():
                clock = published.message.clock
                self._meet_at(clock.sec * NS_PER_S + clock.nanosec)

    def _meet_at(self, time_ns: int) -> None:
        if time_ns <= self._time_ns:
            self._autopilot.on_reset()
        self._time_ns, self._since_s, self._pending = time_ns, time.monotonic(), True
        if not self._send_sensors(time_ns):
            self.go_on()

    def _send_sensors(self, time_ns: int) -> bool:
        try:
            return self._autopilot.send_sensors(time_ns, self._news())
        except (ArithmeticError, ValueError, struct.error) as error:  # such as an infinite fix
            if not self._has_warned:
                self._has_warned = True
                _log.warning("%s: cannot send sensor values to its autopilot: %s", self._uav, error)
            return False

    def _news(self) -> News:
        found = {name: queue.take() for name, queue in self._queues.items()}
        return {name: published[-1].message for name, published in found.items() if published}

    async def _watch_silence(self) -> None:
        """Goes on without an autopilot that sleeps; drops one that is silent for too long."""
        while True:
            await asyncio.sleep(self._glance_s)
            with self.lock:
                if self._pending:
                    self._judge(time.monotonic() - self._since_s)

    @property
    def _glance_s(self) -> float:
        if self._asleep_since_s is not None:
            return self._period_s
        return min(_GLANCE_S, 0.1 * self._timeout_policy.timeout_s)

    def _judge(self, silent_s: float) -> None:
        """Handles an exchange that has lasted `silent_s`."""
        timeout_s, since_s = self._timeout_policy.timeout_s, self._asleep_since_s
        if since_s is None:
            sleeps = silent_s >= min(_SLEEP_S, 0.2 * timeout_s)
        else:
            sleeps = time.monotonic() - since_s < _MAX_SLEEP_FACTOR * timeout_s
        if sleeps and self._autopilot.may_sleep:
            self._go_on_without()
        elif self._timeout_policy.drops and silent_s >= timeout_s:
            self._give_up()

    def _go_on_without(self) -> None:
        if self._asleep_since_s is None:
            self._asleep_since_s = time.monotonic()
            _log.warning(
                "%s: its autopilot is disarmed and silent; the simulation goes on without it",
                self._uav,
            )
        self.go_on()

    def _give_up(self) -> None:
        _log.warning(
            "%s: its autopilot has been silent for %g s; the simulation goes on without it",
            self._uav,
            self._timeout_policy.timeout_s,
        )
        self._autopilot.drop()
        self.go_on()

    def _speeds_message(self, fractions: Sequence[float]) -> Any:
        return self._speeds(layout=self._layout, data=np.array(fractions, np.float32))

    def _publish(self, *messages: tuple[str, Any]) -> None:
        with contextlib.suppress(GraphError):  # the simulation is closing
            self._session.publish_all(messages)


def uavs_with(gateway: Gateway, topic: str) -> list[str]:
    """Returns the UAVs that publish `topic` below their names, ordered by the names' numbers."""
    ends = [info.name.split("/") for info in gateway.graph.topics() if info.publishers]
    names = {parts[1] for parts in ends if "/".join(parts[2:]) == topic}
    return sorted(names, key=lambda name: (len(name), name))


def _nothing() -> None:
    """Does nothing: no request waits for this response."""


def _answered(response: Any) -> None:
    """Logs an error if the request to join was refused."""
    if not getattr(response, "success", False):
        _log.error("no lock step: %s", getattr(response, "message", response))
