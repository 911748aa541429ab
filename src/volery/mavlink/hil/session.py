"""Where the PX4 of one UAV sits: what HIL messages carry, between meetings and some connection."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol

from volery.graph.session import Gateway
from volery.mavlink.hil.lock_step import LockStepSession, News, TimeoutPolicy
from volery.mavlink.hil.protocol import PERIOD_NS, Actuators, HilLink
from volery.mavlink.hil.sensor_readings import TOPICS, SensorReadings

_STILL = (0.0,) * 16
_NOISE_BYTES = 64
"""What may come before the first frame of a PX4, which begins with a heartbeat of 21 bytes."""
_log = logging.getLogger(__name__)


class HilConnection(Protocol):
    """What carries bytes to a PX4."""

    is_for_any_thread: bool
    """Whether `send` and `end` may be called by any, one at a time."""

    def send(self, data: bytes) -> bool:
        """Send frames; whether all of them are under way."""

    def end(self) -> None:
        """End the connection."""


class HilSession:
    """One PX4's part in the lock step; `system` is the id that it has. Use `take` and `leave`.

    An answer releases the meeting only if it was made after it, as its time says.
    """

    def __init__(self, gateway: Gateway, uav: str, system: int, patience: TimeoutPolicy) -> None:
        self.uav = uav
        self._system = system
        self._way: HilConnection | None = None
        self._link = HilLink(system)
        self._noise, self._told = 0, False
        self._is_armed = False
        self._sensing = SensorReadings()
        self._meetings = LockStepSession(
            gateway, uav, "px4", self, period_ns=PERIOD_NS, topics=TOPICS, patience=patience
        )

    @property
    def taken(self) -> bool:
        """Whether a PX4 is there."""
        return self._way is not None

    @property
    def has_heard(self) -> bool:
        """Whether a MAVLink frame has come from who is there."""
        return self.taken and self._link.spoken

    def take(self, way: HilConnection) -> Callable[[bytes], None]:
        """Let a new PX4 sit down; what it sends is to be given to the result."""
        with self._meetings.lock:
            self._way = way
            self._link = HilLink(self._system)
            self._noise, self._told = 0, False
            self._is_armed = False
        return partial(self._hear, way)

    def heartbeat(self) -> bytes:
        """A frame that says who is there."""
        return self._link.heartbeat()

    def leave(self, why: str) -> None:
        """The connection has ended; the rotors stop."""
        with self._meetings.lock:
            if self._way is None:
                return
            self._way = None
            _log.warning("%s: %s", self.uav, why)
            self._meetings.go_on(_STILL)

    def close(self) -> None:
        """Give everything back; a second time nothing happens."""
        with self._meetings.lock:
            way, self._way = self._way, None
        if way is not None:
            self._meetings.turn_rotors(_STILL)
            way.end()
        self._meetings.close()

    # --------------------------------------------------------------------------------- of meetings

    @property
    def is_in_step(self) -> bool:
        """As of `Autopilot`."""
        way = self._way
        return way is not None and way.is_for_any_thread and self._link.locked

    def tell(self, time_ns: int, news: News) -> bool:
        """As of `Autopilot`."""
        sensed = self._sensing.read(news)
        if self._way is None or sensed is None:
            return False
        self._way.send(self._link.tell(time_ns, sensed))
        return self._link.locked and self.taken

    @property
    def may_sleep(self) -> bool:
        """See `ExternalAutopilot`; a disarmed PX4 in Offboard is silent for long."""
        return self._way is not None and not self._is_armed

    def begin_anew(self) -> None:
        """As of `Autopilot`: a PX4 cannot go back in time."""
        self._end("the simulation was reset, and its PX4 must begin anew")

    def give_way(self) -> None:
        """Ends the connection of a client that has sent no MAVLink frame, for another one."""
        self._end("what was connected has sent no MAVLink; another connection takes its place")

    def drop(self) -> None:
        """As of `Autopilot`."""
        self._end("the connection to its PX4 was closed")

    def _end(self, why: str) -> None:
        way = self._way
        if way is not None:
            way.end()
            self.leave(why)

    def _hear(self, way: HilConnection, data: bytes) -> None:
        with self._meetings.lock:
            if way is self._way:  # it was not let go meanwhile
                self._take_in(data)

    def _take_in(self, data: bytes) -> None:
        answers = self._link.feed(data)
        if not self._link.spoken:
            self._noise += len(data)
            if self._noise > _NOISE_BYTES and not self._told:
                self._told = True
                _log.warning("%s: what is connected does not speak MAVLink: no PX4?", self.uav)
        for actuators in answers:
            self._is_armed = actuators.armed
            if actuators.time_ns >= self._meetings.time_ns:
                self._meetings.go_on(_shares(actuators))
            else:
                self._meetings.turn_rotors(_shares(actuators))


def _shares(actuators: Actuators) -> Sequence[float]:
    """Shares of the rotors' full speed that are asked for."""
    return [max(0.0, part) for part in actuators.controls] if actuators.armed else _STILL
