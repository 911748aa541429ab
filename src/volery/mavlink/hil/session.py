"""Session of one UAV's PX4: exchanges HIL messages in lock step over any connection."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol

from volery.graph.session import Gateway
from volery.mavlink.hil.lock_step import LockStepSession, News, TimeoutPolicy
from volery.mavlink.hil.protocol import PERIOD_NS, Actuators, HilLink
from volery.mavlink.hil.sensor_samples import TOPICS, SensorSamples

_STILL = (0.0,) * 16
_NOISE_BYTES = 64
"""Largest number of bytes before the first frame of a PX4, which begins with a heartbeat of 21
bytes."""
_log = logging.getLogger(__name__)


class HilConnection(Protocol):
    """Transport of bytes to a PX4."""

    is_for_any_thread: bool
    """Whether any thread may call `send` and `end`, one at a time."""

    def send(self, data: bytes) -> bool:
        """Sends frames; returns whether all of them were passed on."""

    def end(self) -> None:
        """Ends the connection."""


class HilSession:
    """Runs one PX4's part in the lock step; `system` is its id. Use `take` and `leave`.

    An answer ends the exchange only if it was made after it, according to its time.
    """

    def __init__(self, gateway: Gateway, uav: str, system: int, patience: TimeoutPolicy) -> None:
        self.uav = uav
        self._system = system
        self._way: HilConnection | None = None
        self._link = HilLink(system)
        self._noise, self._told = 0, False
        self._is_armed = False
        self._sensing = SensorSamples()
        self._meetings = LockStepSession(
            gateway, uav, "px4", self, period_ns=PERIOD_NS, topics=TOPICS, patience=patience
        )

    @property
    def taken(self) -> bool:
        """Whether a PX4 is connected."""
        return self._way is not None

    @property
    def has_heard(self) -> bool:
        """Whether a MAVLink frame has arrived over the current connection."""
        return self.taken and self._link.spoken

    def take(self, way: HilConnection) -> Callable[[bytes], None]:
        """Attaches a new PX4; returns the function that takes the bytes it sends."""
        with self._meetings.lock:
            self._way = way
            self._link = HilLink(self._system)
            self._noise, self._told = 0, False
            self._is_armed = False
        return partial(self._hear, way)

    def heartbeat(self) -> bytes:
        """Returns a heartbeat of the simulator."""
        return self._link.heartbeat()

    def leave(self, why: str) -> None:
        """Handles the end of the connection; the rotors stop."""
        with self._meetings.lock:
            if self._way is None:
                return
            self._way = None
            _log.warning("%s: %s", self.uav, why)
            self._meetings.go_on(_STILL)

    def close(self) -> None:
        """Closes the session; further calls do nothing."""
        with self._meetings.lock:
            way, self._way = self._way, None
        if way is not None:
            self._meetings.turn_rotors(_STILL)
            way.end()
        self._meetings.close()

    # ---------------------------------------------------------------------------------- lock step

    @property
    def is_in_step(self) -> bool:
        """Implements `ExternalAutopilot.is_in_step`."""
        way = self._way
        return way is not None and way.is_for_any_thread and self._link.locked

    def tell(self, time_ns: int, news: News) -> bool:
        """Implements `ExternalAutopilot.tell`."""
        sensed = self._sensing.read(news)
        if self._way is None or sensed is None:
            return False
        self._way.send(self._link.tell(time_ns, sensed))
        return self._link.locked and self.taken

    @property
    def may_sleep(self) -> bool:
        """Implements `ExternalAutopilot.may_sleep`: a disarmed PX4 in Offboard is silent."""
        return self._way is not None and not self._is_armed

    def begin_anew(self) -> None:
        """Implements `ExternalAutopilot.begin_anew`: a PX4 cannot go back in time."""
        self._end("the simulation was reset and its PX4 must restart")

    def give_way(self) -> None:
        """Ends the connection of a client that has sent no MAVLink frame, for another one."""
        self._end("the connected client has sent no MAVLink; another connection replaces it")

    def drop(self) -> None:
        """Implements `ExternalAutopilot.drop`."""
        self._end("the connection to its PX4 was closed")

    def _end(self, why: str) -> None:
        way = self._way
        if way is not None:
            way.end()
            self.leave(why)

    def _hear(self, way: HilConnection, data: bytes) -> None:
        with self._meetings.lock:
            if way is self._way:  # still the current connection
                self._take_in(data)

    def _take_in(self, data: bytes) -> None:
        answers = self._link.feed(data)
        if not self._link.spoken:
            self._noise += len(data)
            if self._noise > _NOISE_BYTES and not self._told:
                self._told = True
                _log.warning(
                    "%s: the connected client does not send MAVLink; connect a PX4", self.uav
                )
        for actuators in answers:
            self._is_armed = actuators.armed
            if actuators.time_ns >= self._meetings.time_ns:
                self._meetings.go_on(_shares(actuators))
            else:
                self._meetings.turn_rotors(_shares(actuators))


def _shares(actuators: Actuators) -> Sequence[float]:
    """Returns the requested fractions of the rotors' full speed."""
    return [max(0.0, part) for part in actuators.controls] if actuators.armed else _STILL
