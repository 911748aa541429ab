"""Connects a node to an autopilot: topics of one UAV over MAVLink, in offboard mode.

Topics and services are those of a UAV of the simulation, below any namespace:

| name | MAVLink |
|---|---|
| `odom` | LOCAL_POSITION_NED with ATTITUDE_QUATERNION; the origin is the autopilot's |
| `cmd_vel` | SET_POSITION_TARGET_LOCAL_NED, velocity in the heading frame |
| `setpoint_raw/attitude` | SET_ATTITUDE_TARGET |
| services `take_off` (arms), `land`, `hold`, `offboard` | COMMAND_LONG |
"""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Callable
from typing import Any

from volery.core.errors import BridgeError, GraphError, UnreachableError
from volery.core.extras import import_extra
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Published
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler
from volery.graph.subscription_queue import SubscriptionQueue, Wake
from volery.mavlink.codec import AUTOPILOT, dialect
from volery.mavlink.offboard.conversions import attitude_setpoint, odometry, velocity_setpoint

_SYSTEM, _COMPONENT = 245, 191
"""This program: MAV_COMP_ID_ONBOARD_COMPUTER."""
_POSITION, _ATTITUDE, _INTERVAL_US = 32, 31, 20_000
_HEARTBEAT_S, _SETTLE_S, _COMMAND_S = 1.0, 1.0, 5.0
_ARM, _TAKE_OFF, _LAND, _MODE = 400, 22, 21, 176
_ARMED = 128
_HOLD_MODE, _OFFBOARD_MODE = (4, 3), (6, 0)
"""PX4's main and sub mode."""
_TRIGGER = "std_srvs/srv/Trigger_Response"
_SETPOINTS: dict[str, Callable[[Any, tuple[int, int], int], Any]] = {
    "cmd_vel": velocity_setpoint,
    "setpoint_raw/attitude": attitude_setpoint,
}
_COMMANDS: dict[str, tuple[tuple[int, tuple[float, ...]], ...]] = {
    "take_off": ((_ARM, (1.0,)), (_TAKE_OFF, (0.0, 0.0, 0.0, float("nan"), *[float("nan")] * 3))),
    "land": ((_LAND, (0.0, 0.0, 0.0, float("nan"), *[float("nan")] * 3)),),
    "hold": ((_MODE, (1.0, *map(float, _HOLD_MODE))),),
    "offboard": ((_MODE, (1.0, *map(float, _OFFBOARD_MODE))),),
}
_ADDRESS = re.compile(r"((udpin|udpout|tcp):[\w.-]+:\d{1,5}|/[\w./-]+(,\d{1,7})?)")
_log = logging.getLogger(__name__)


class OffboardConnection:
    """A `GraphConnection` to one autopilot.

    address: as pymavlink's: `udpin:HOST:PORT`, `udpout:HOST:PORT`, `tcp:HOST:PORT` or a serial
    line's `PATH,BAUD`. engages: request offboard mode once, when setpoints have been sent for a
    second to a vehicle that is armed. Without, the operator does. Raises `UnreachableError` if no
    autopilot sends a heartbeat within `timeout_s`.
    """

    def __init__(
        self, address: str, name: str, *, engages: bool = False, timeout_s: float = 2.0
    ) -> None:
        self.name = name
        self._engages = engages
        self._lock = threading.RLock()
        self._queues: dict[str, list[SubscriptionQueue]] = {}
        self._pending: dict[int, list[Any]] = {}
        self._attitude: Any = None
        self._first_setpoint_s: float | None = None
        self._is_armed = False
        self._start_s = time.monotonic()
        self._socket = _open(address)
        beat = self._socket.recv_match(type="HEARTBEAT", blocking=True, timeout=timeout_s)
        while beat is not None and beat.get_srcComponent() != AUTOPILOT:
            beat = self._socket.recv_match(type="HEARTBEAT", blocking=True, timeout=timeout_s)
        if beat is None:
            self._socket.close()
            raise UnreachableError(f"no autopilot sends heartbeats to '{address}'")
        self._target = (beat.get_srcSystem(), AUTOPILOT)
        self._closed = threading.Event()
        self._send(self._heartbeat())
        for number in (_POSITION, _ATTITUDE):
            self._command(511, (float(number), float(_INTERVAL_US)))
        self._thread = threading.Thread(target=self._receive, name=f"{name} MAVLink", daemon=True)
        self._thread.start()

    @property
    def connected(self) -> bool:
        """Whether the connection is open."""
        return not self._closed.is_set()

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:  # noqa: ARG002
        """Announces a topic; raises `GraphError` for commands that MAVLink lacks."""
        self._check_open()
        if _last(topic) == "rotor_speeds":
            raise GraphError(
                "MAVLink has no setpoint of rotor speeds; fly a policy that commands velocities, "
                "attitudes or rates"
            )

    def publish(self, topic: str, message: Any) -> None:
        """Sends setpoints; other topics have no receiver."""
        make = next((m for name, m in _SETPOINTS.items() if topic.endswith(f"/{name}")), None)
        if make is None:
            return
        time_ms = int((time.monotonic() - self._start_s) * 1e3)
        self._send(make(message, self._target, time_ms))
        if self._first_setpoint_s is None:
            self._first_setpoint_s = time.monotonic()

    def unadvertise(self, topic: str) -> None:
        """Implements `GraphConnection.unadvertise`."""

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,  # noqa: ARG002
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Subscribes to `odom`; other topics have no messages."""
        self._check_open()
        queue = SubscriptionQueue(topic, depth, wake, reliable=reliable)
        with self._lock:
            self._queues.setdefault(topic, []).append(queue)
        return queue

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Implements `GraphConnection.unsubscribe`."""
        with self._lock:
            held = self._queues.get(queue.topic, [])
            if queue in held:
                held.remove(queue)

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:  # noqa: ARG002
        """Commands the autopilot; the reply says whether it accepts."""
        steps = _COMMANDS.get(_last(service))
        if steps is None:
            reply.fail(GraphError(f"service '{service}' does not exist over MAVLink"))
            return
        self._next_step(list(steps), reply)

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Does nothing: no other program calls services over this connection."""

    def close(self) -> None:
        """Implements `GraphConnection.close`."""
        if not self._closed.is_set():
            self._closed.set()
            self._thread.join(2.0)
            self._socket.close()

    # ------------------------------------------------------------------------------------- inside

    def _receive(self) -> None:
        next_beat_s = 0.0
        while not self._closed.is_set():
            now_s = time.monotonic()
            if now_s >= next_beat_s:
                next_beat_s = now_s + _HEARTBEAT_S
                self._send(self._heartbeat())
                self._expire(now_s)
                self._engage(now_s)
            try:
                message = self._socket.recv_match(blocking=True, timeout=0.1)
            except OSError as error:
                if not self._closed.is_set():
                    _log.warning("MAVLink: %s", error)
                    self._closed.set()
                return
            if message is not None and message.get_srcSystem() == self._target[0]:
                self._take(message)

    def _take(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "ATTITUDE_QUATERNION":
            self._attitude = message
        elif kind == "LOCAL_POSITION_NED" and self._attitude is not None:
            self._publish_odometry(message)
        elif kind == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT:
            self._is_armed = bool(message.base_mode & _ARMED)
        elif kind == "COMMAND_ACK":
            self._settle(message)

    def _publish_odometry(self, position: Any) -> None:
        now_ns = time.time_ns()
        with self._lock:
            queues = [q for t, held in self._queues.items() if _last(t) == "odom" for q in held]
        for queue in queues:
            frame = queue.topic[1:].removesuffix("odom")
            message = odometry(position, self._attitude, now_ns, frame)
            queue.put(Published(queue.topic, "nav_msgs/msg/Odometry", now_ns, message))

    def _next_step(self, steps: list[Any], reply: ServiceReply) -> None:
        number, values = steps.pop(0)
        with self._lock:
            self._pending.setdefault(number, []).append(
                (time.monotonic() + _COMMAND_S, steps, reply)
            )
        self._command(number, values)

    def _settle(self, ack: Any) -> None:
        with self._lock:
            waiting = self._pending.get(ack.command, [])
            if not waiting or ack.result == dialect().MAV_RESULT_IN_PROGRESS:
                return
            _, steps, reply = waiting.pop(0)
        if ack.result != dialect().MAV_RESULT_ACCEPTED:
            result = dialect().enums["MAV_RESULT"].get(ack.result)
            reason = result.name if result else f"result {ack.result}"
            reply.answer(_response(success=False, text=f"the autopilot answers {reason}"))
        elif steps:
            self._next_step(steps, reply)
        else:
            reply.answer(_response(success=True))

    def _expire(self, now_s: float) -> None:
        """Answers calls whose acknowledgement does not arrive."""
        late = []
        with self._lock:
            for number, waiting in self._pending.items():
                late += [entry for entry in waiting if entry[0] < now_s]
                self._pending[number] = [entry for entry in waiting if entry[0] >= now_s]
        for _, _, reply in late:
            reply.answer(_response(success=False, text="the autopilot does not answer"))

    def _engage(self, now_s: float) -> None:
        first_s = self._first_setpoint_s
        if self._engages and self._is_armed and first_s is not None and now_s > first_s + _SETTLE_S:
            self._engages = False
            self._command(*_COMMANDS["offboard"][0])

    def _heartbeat(self) -> Any:
        mavlink = dialect()
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
        )

    def _command(self, number: int, values: tuple[float, ...]) -> None:
        filled = (*values, *[0.0] * (7 - len(values)))
        self._send(dialect().MAVLink_command_long_message(*self._target, number, 0, *filled))

    def _send(self, message: Any) -> None:
        with self._lock:
            try:
                self._socket.mav.send(message)
            except OSError as error:
                _log.warning("MAVLink: a message is lost: %s", error)

    def _check_open(self) -> None:
        if self._closed.is_set():
            raise GraphError("the MAVLink connection is closed")


def _open(address: str) -> Any:
    mavutil = import_extra("MAVLink", "pymavlink.mavutil", "pymavlink", "mavlink", BridgeError)
    if not _ADDRESS.fullmatch(address):
        raise BridgeError(
            f"'{address}' is no address of MAVLink: udpin:HOST:PORT, udpout:HOST:PORT, "
            "tcp:HOST:PORT or a serial line's /dev/NAME[,BAUD]"
        )
    path, _, baud = address.partition(",")
    try:
        return mavutil.mavlink_connection(
            path,
            baud=int(baud or 57600),
            source_system=_SYSTEM,
            source_component=_COMPONENT,
            dialect="common",
            autoreconnect=False,
        )
    except (ImportError, OSError, ValueError) as error:  # pyserial may be missing
        raise BridgeError(f"MAVLink cannot be opened at '{address}': {error}") from None


def _last(topic: str) -> str:
    return topic.rpartition("/")[2]


def _response(*, success: bool, text: str = "") -> Any:
    response = zero_message(_TRIGGER)
    response.success, response.message = success, text
    return response
