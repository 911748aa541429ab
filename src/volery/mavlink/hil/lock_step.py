"""One UAV's meetings with the autopilot outside that flies it, whatever carries them there.

At each meeting the autopilot is told what is new of its UAV, and the simulation stands still until
`go_on`. What it asks of the rotors before is in force from the next physics step. One that is
waited for and stays silent ends the run with an error, or is given up with a warning; without one
that is asleep time goes on.
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
"""By which the simulation is more patient than a seat that gives its autopilot up by itself."""
_GLANCE_S = 0.05
"""How often silence is looked at."""
_SLEEP_S = 0.5
"""Who says nothing for so long of wall time may be asleep, or for a fifth of its patience."""
_LONGEST_SLEEP = 6.0
"""Times the patience: so long of wall time it may be."""
_log = logging.getLogger(__name__)

News = Mapping[str, Any]
"""Newest messages that have come since the last meeting, by topic below the UAV's name."""


class TimeoutPolicy(NamedTuple):
    """How long an autopilot that has begun to answer may be silent, and what happens then."""

    timeout_s: float = 10.0
    """Of wall time."""
    drops: bool = False
    """Whether it is then waited for no more, its rotors still; else the run ends with an error."""


PATIENCE = TimeoutPolicy()


class ExternalAutopilot(Protocol):
    """The autopilot's side."""

    @property
    def is_in_step(self) -> bool:
        """Whether it answers each meeting, and may be told by any thread."""

    @property
    def may_sleep(self) -> bool:
        """Whether it may be well though it does not answer: it flies nothing."""

    def tell(self, time_ns: int, news: News) -> bool:
        """Tell it of a meeting; whether its answer is waited for: it calls `go_on`."""

    def begin_anew(self) -> None:
        """The simulation was reset: times are earlier than those told before."""

    def drop(self) -> None:
        """It was silent for too long: let it go."""


class LockStepSession:
    """Joins the lock step for `uav` at once; `close` leaves it.

    kind: `px4` or another word for names. topics: message types by topic below the UAV's name.
    The autopilot is told in the loop's thread, or, once it `is_in_step`, by the simulation's own,
    which need not wake another for that. Both hold `lock` when they tell it or have it begin anew,
    and so must who reads or changes what these do. All other calls are the loop's.
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
        patience: TimeoutPolicy,
    ) -> None:
        self.lock = threading.RLock()
        self._uav, self._autopilot, self._patience = uav, autopilot, patience
        self._loop = asyncio.get_running_loop()
        self._session: Session = gateway.open(f"{kind} of {uav}")
        self._rotors = f"/{uav}/rotor_speeds"
        meeting = f"/volery/lock_step/{kind}_of_{uav}"
        self._done = f"{meeting}/done"
        self._pending = False
        self._since_s = 0.0
        """Wall time at which the present meeting began."""
        self._is_unsayable = False
        """Whether it has been said that the autopilot cannot be told something."""
        self._asleep_since_s: float | None = None
        """Wall time since which time goes on without its answers."""
        self._period_s = period_ns / NS_PER_S
        self._watch = self._loop.create_task(self._watch_silence())
        self._time_ns = -1
        self._boxes: dict[str, SubscriptionQueue] = {
            name: self._session.subscribe(f"/{uav}/{name}", msgtype, depth=1, wake=_nothing)
            for name, msgtype in topics.items()
        }
        self._speeds = message_type(_SPEEDS)
        self._layout = zero_message(_SPEEDS).layout
        self._clock = message_type(_CLOCK)
        self._session.advertise(self._rotors, _SPEEDS)
        self._session.advertise(self._done, _CLOCK)
        self._go = self._session.subscribe(f"{meeting}/go", _CLOCK, depth=1, wake=self._wake)
        self._join(f"{kind}_of_{uav}", period_ns)

    @property
    def time_ns(self) -> int:
        """Of the present or last meeting."""
        return self._time_ns

    @property
    def waits(self) -> bool:
        """Whether the simulation stands still until `go_on`."""
        return self._pending

    def turn_rotors(self, shares: Sequence[float]) -> None:
        """Ask for shares of the rotors' full speed, in the order of the airframe."""
        self._publish((self._rotors, self._asked(shares)))

    def go_on(self, shares: Sequence[float] | None = None) -> None:
        """End the meeting, `shares` as of `turn_rotors`; without a meeting only those are asked."""
        messages = [] if shares is None else [(self._rotors, self._asked(shares))]
        if shares is not None:
            self._asleep_since_s = None
        if self._pending:
            self._pending = False
            messages.append((self._done, self._clock(clock=time_from_ns(self._time_ns))))
        self._publish(*messages)

    def close(self) -> None:
        """Leave the lock step and the graph; a second time nothing happens."""
        with self.lock:
            self._pending = False
        self._watch.cancel()
        self._session.close()

    def _join(self, name: str, period_ns: int) -> None:
        request = zero_message(f"{_JOIN}_Request")
        request.name = name
        request.period_s = period_ns / NS_PER_S
        drops = self._patience.drops
        request.timeout_s = self._patience.timeout_s + (_MARGIN_S if drops else 0.0)
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
            self._autopilot.begin_anew()
        self._time_ns, self._since_s, self._pending = time_ns, time.monotonic(), True
        if not self._tell(time_ns):
            self.go_on()

    def _tell(self, time_ns: int) -> bool:
        try:
            return self._autopilot.tell(time_ns, self._news())
        except (ArithmeticError, ValueError, struct.error) as error:  # as of an infinite fix
            if not self._is_unsayable:
                self._is_unsayable = True
                _log.warning(
                    "%s: its autopilot cannot be told what is sensed: %s", self._uav, error
                )
            return False

    def _news(self) -> News:
        found = {name: box.take() for name, box in self._boxes.items()}
        return {name: published[-1].message for name, published in found.items() if published}

    async def _watch_silence(self) -> None:
        """Go on without an autopilot that is asleep; give up one that is silent for too long."""
        while True:
            await asyncio.sleep(self._glance_s)
            with self.lock:
                if self._pending:
                    self._judge(time.monotonic() - self._since_s)

    @property
    def _glance_s(self) -> float:
        if self._asleep_since_s is not None:
            return self._period_s
        return min(_GLANCE_S, 0.1 * self._patience.timeout_s)

    def _judge(self, silent_s: float) -> None:
        """Of a meeting that lasts: whether there is still somebody to wait for."""
        timeout_s, since_s = self._patience.timeout_s, self._asleep_since_s
        if since_s is None:
            sleeps = silent_s >= min(_SLEEP_S, 0.2 * timeout_s)
        else:
            sleeps = time.monotonic() - since_s < _LONGEST_SLEEP * timeout_s
        if sleeps and self._autopilot.may_sleep:
            self._go_on_without()
        elif self._patience.drops and silent_s >= timeout_s:
            self._give_up()

    def _go_on_without(self) -> None:
        if self._asleep_since_s is None:
            self._asleep_since_s = time.monotonic()
            _log.warning(
                "%s: its autopilot is disarmed and silent; it is not waited for", self._uav
            )
        self.go_on()

    def _give_up(self) -> None:
        _log.warning(
            "%s: its autopilot has been silent for %g s; it is not waited for",
            self._uav,
            self._patience.timeout_s,
        )
        self._autopilot.drop()
        self.go_on()

    def _asked(self, shares: Sequence[float]) -> Any:
        return self._speeds(layout=self._layout, data=np.array(shares, np.float32))

    def _publish(self, *messages: tuple[str, Any]) -> None:
        with contextlib.suppress(GraphError):  # the simulation is closing
            self._session.publish_all(messages)


def uavs_with(gateway: Gateway, topic: str) -> list[str]:
    """UAVs that publish `topic` below their names, in the order of the names' numbers."""
    ends = [info.name.split("/") for info in gateway.graph.topics() if info.publishers]
    names = {parts[1] for parts in ends if "/".join(parts[2:]) == topic}
    return sorted(names, key=lambda name: (len(name), name))


def _nothing() -> None:
    """Nobody waits for it."""


def _answered(answer: Any) -> None:
    """What the simulation says to somebody who joins."""
    if not getattr(answer, "success", False):
        _log.error("no lock step: %s", getattr(answer, "message", answer))
