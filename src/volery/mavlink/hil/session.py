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

    def __init__(
        self, gateway: Gateway, uav: str, system: int, timeout_policy: TimeoutPolicy
    ) -> None:
        self.uav = uav
        self._system = system
        self._connection: HilConnection | None = None
        self._link = HilLink(system)
        self._noise, self._has_warned = 0, False
        self._is_armed = False
        self._sensing = SensorSamples()
        self._lock_step = LockStepSession(
            gateway,
            uav,
            "px4",
            self,
            period_ns=PERIOD_NS,
            topics=TOPICS,
            timeout_policy=timeout_policy,
        )

    @property
    def is_connected(self) -> bool:
        """Whether a PX4 is connected."""
        return self._connection is not None

    @property
    def has_received(self) -> bool:
        """Whether a MAVLink frame has arrived over the current connection."""
        return self.is_connected and self._link.has_received

    def take(self, connection: HilConnection) -> Callable[[bytes], None]:
        """Attaches a new PX4; returns the function that takes the bytes it sends."""
        with self._lock_step.lock:
            self._connection = connection
            self._link = HilLink(self._system)
            self._noise, self._has_warned = 0, False
            self._is_armed = False
        return partial(self._receive, connection)

    def heartbeat(self) -> bytes:
        """Returns a heartbeat of the simulator."""
        return self._link.heartbeat()

    def leave(self, why: str) -> None:
        """Handles the end of the connection; the rotors stop."""
        with self._lock_step.lock:
            if self._connection is None:
                return
            self._connection = None
            _log.warning("%s: %s", self.uav, why)
            self._lock_step.go_on(_STILL)

    def close(self) -> None:
        """Closes the session; further calls do nothing."""
        with self._lock_step.lock:
            connection, self._connection = self._connection, None
        if connection is not None:
            self._lock_step.turn_rotors(_STILL)
            connection.end()
        self._lock_step.close()

    # ---------------------------------------------------------------------------------- lock step

    @property
    def is_in_step(self) -> bool:
        """Implements `ExternalAutopilot.is_in_step`."""
        connection = self._connection
        return connection is not None and connection.is_for_any_thread and self._link.locked

    def send_sensors(self, time_ns: int, news: News) -> bool:
        """Implements `ExternalAutopilot.send_sensors`."""
        sensed = self._sensing.read(news)
        if self._connection is None or sensed is None:
            return False
        self._connection.send(self._link.encode_exchange(time_ns, sensed))
        return self._link.locked and self.is_connected

    @property
    def may_sleep(self) -> bool:
        """Implements `ExternalAutopilot.may_sleep`: a disarmed PX4 in Offboard is silent."""
        return self._connection is not None and not self._is_armed

    def on_reset(self) -> None:
        """Implements `ExternalAutopilot.on_reset`: a PX4 cannot go back in time."""
        self._end("the simulation was reset and its PX4 must restart")

    def end_unproven(self) -> None:
        """Ends the connection of a client that has sent no MAVLink frame, for another one."""
        self._end("the connected client has sent no MAVLink; another connection replaces it")

    def drop(self) -> None:
        """Implements `ExternalAutopilot.drop`."""
        self._end("the connection to its PX4 was closed")

    def _end(self, why: str) -> None:
        connection = self._connection
        if connection is not None:
            connection.end()
            self.leave(why)

    def _receive(self, connection: HilConnection, data: bytes) -> None:
        with self._lock_step.lock:
            if connection is self._connection:  # still the current connection
                self._take_in(data)

    def _take_in(self, data: bytes) -> None:
        outputs = self._link.feed(data)
        if not self._link.has_received:
            self._noise += len(data)
            if self._noise > _NOISE_BYTES and not self._has_warned:
                self._has_warned = True
                _log.warning(
                    "%s: the connected client does not send MAVLink; connect a PX4", self.uav
                )
        for actuators in outputs:
            self._is_armed = actuators.armed
            if actuators.time_ns >= self._lock_step.time_ns:
                self._lock_step.go_on(_rotor_fractions(actuators))
            else:
                self._lock_step.turn_rotors(_rotor_fractions(actuators))


def _rotor_fractions(actuators: Actuators) -> Sequence[float]:
    """Returns the requested fractions of the rotors' full speed."""
    return [max(0.0, part) for part in actuators.controls] if actuators.armed else _STILL
