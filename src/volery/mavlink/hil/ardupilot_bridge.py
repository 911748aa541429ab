"""Connects real ArduCopters to the UAVs: ArduPilot's JSON interface over UDP, in lock step.

    with Simulation(with_ardupilot(scenario)) as simulation, BridgeHost(simulation.gateway) as
    bridges:
        bridges.open(ArdupilotBridge())  # 9002 + 10 i; `arducopter --model JSON -I i` connects
        simulation.run(speed=1.0)

Every 1.25 ms of simulated time the bridge sends each ArduPilot the state of its UAV and waits for
its outputs. An autopilot that times out ends the run or is dropped, see `TimeoutPolicy`. A
restarted autopilot counts its frames from 0 again; its session and its clock restart.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from typing import Any, cast

from volery.core.clock import NS_PER_S
from volery.core.errors import BridgeError
from volery.core.network_access import check_address
from volery.graph.session import Gateway
from volery.mavlink.autopilot.vehicle import Vector
from volery.mavlink.hil.ardupilot_json import (
    STATE_HZ,
    Servos,
    State,
    motors_of,
    parse_servos,
    rotor_fractions,
    state_line,
)
from volery.mavlink.hil.connection_notice import NOTICE_S, ConnectionNotice
from volery.mavlink.hil.lock_step import (
    DEFAULT_TIMEOUT,
    LockStepSession,
    News,
    TimeoutPolicy,
    uavs_with,
)
from volery.mavlink.hil.sensor_samples import inertial_of, parts
from volery.mavlink.links.connection import why_not

PORT = 9002
PORT_STEP = 10
"""Offset of all ports of one ArduPilot instance to the next."""
PERIOD_NS = NS_PER_S // STATE_HZ
_TRUTH = "ground_truth/odom"
_TOPICS = {
    "imu": "sensor_msgs/msg/Imu",
    _TRUTH: "nav_msgs/msg/Odometry",
    "range": "sensor_msgs/msg/Range",
    "battery": "sensor_msgs/msg/BatteryState",
}
_SLOW = ("range", "battery")
_GONE_S = 1.5
"""Wall time of silence after which an autopilot has left: one that waits for a state asks every
second."""
_LATE_FRAMES = 16
"""A frame this far back was delayed in transit; farther back, ArduPilot has restarted."""
_log = logging.getLogger(__name__)

Address = tuple[Any, ...]


class ArdupilotBridge:
    """Listens for instance i, the autopilot of the i-th UAV, at `port` + 10 i.

    The gateway provides the rotors of each UAV. port: 0 takes a free port for each UAV, see
    `ports`. notice_s: wall time after which the bridge logs
    that ArduPilots are missing; None: the caller reports them.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        timeout_policy: TimeoutPolicy = DEFAULT_TIMEOUT,
        anywhere: bool = False,
        notice_s: float | None = NOTICE_S,
    ) -> None:
        self._notice_s = notice_s
        self._absence: ConnectionNotice | None = None
        self._host, self._port = host, port
        self._timeout_policy = timeout_policy
        self._anywhere = anywhere
        self._sessions: list[_Session] = []
        self._ports: list[int] = []

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"ArduPilot UDP {self._host}:{self._port}, +{PORT_STEP} for each further UAV"

    @property
    def connected(self) -> tuple[str, ...]:
        """UAVs whose ArduPilot has connected."""
        return tuple(session.uav for session in self._sessions if session.peer is not None)

    @property
    def ports(self) -> tuple[int, ...]:
        """Ports of the ArduPilots, in the order of the UAVs; empty while closed."""
        return tuple(self._ports)

    async def start(self, gateway: Gateway) -> None:
        """Starts listening.

        Raises `BridgeError` if a port is taken or ArduPilot cannot fly a UAV.
        """
        check_address(self._host, anywhere=self._anywhere, flag="--allow-remote")
        rotors = gateway.rotor_layouts()
        uavs = [uav for uav in uavs_with(gateway, _TRUTH) if uav in rotors]
        if not uavs:
            raise BridgeError("no UAV publishes the true state that an ArduPilot needs")
        for k, uav in enumerate(uavs):
            try:
                motors = motors_of(rotors[uav])
            except BridgeError as error:
                raise BridgeError(f"{uav}: {error}") from None
            session = _Session(gateway, uav, motors, self._timeout_policy)
            self._sessions.append(session)
            await self._listen(session, self._port + PORT_STEP * k if self._port else 0)
        self._absence = ConnectionNotice(
            "ArduPilot", self._missing, self._how_to_start, self._notice_s
        )

    async def stop(self) -> None:
        """Disconnects all ArduPilots."""
        if self._absence is not None:
            self._absence.cancel()
        for session in self._sessions:
            session.close()
        self._sessions.clear()
        self._ports.clear()
        await asyncio.sleep(0)

    def _missing(self) -> dict[str, str]:
        """Returns the addresses of the missing ArduPilots, by UAV."""
        return {
            session.uav: f"UDP {self._host}:{self._ports[number]}"
            for number, session in enumerate(self._sessions)
            if session.peer is None
        }

    def _how_to_start(self) -> str:
        absent = next((k for k, session in enumerate(self._sessions) if session.peer is None), 0)
        instance, odd = divmod(self._ports[absent] - PORT, PORT_STEP)
        chosen = f" -I {instance}" if instance >= 0 and not odd else ""
        return f"start with: arducopter --model JSON{chosen} ... (docs/mavlink.md)"

    async def _listen(self, session: _Session, port: int) -> None:
        loop = asyncio.get_running_loop()
        try:
            transport, _ = await loop.create_datagram_endpoint(
                lambda: session, local_addr=(self._host, port)
            )
        except (OSError, OverflowError) as error:
            raise BridgeError(
                f"{session.uav}: cannot listen on UDP {self._host}:{port}: {why_not(error)}"
            ) from None
        self._ports.append(transport.get_extra_info("sockname")[1])


class _Session(asyncio.DatagramProtocol):
    """Endpoint of the ArduPilot of one UAV."""

    def __init__(
        self, gateway: Gateway, uav: str, motors: tuple[int, ...], timeout_policy: TimeoutPolicy
    ) -> None:
        self.uav = uav
        self.peer: Address | None = None
        self._motors = motors
        self._transport: asyncio.DatagramTransport | None = None
        self._number = -1
        self._received_s = 0.0
        """Wall time of its last frame."""
        self._logged: set[str] = set()
        """Warnings that were logged."""
        self._line = b""
        self._slow: dict[str, Any] = {}
        """Newest messages of topics that are not published at every exchange."""
        self._begin_ns: int | None = None
        self._lock_step = LockStepSession(
            gateway,
            uav,
            "ardupilot",
            self,
            period_ns=PERIOD_NS,
            topics=_TOPICS,
            timeout_policy=timeout_policy,
        )

    def close(self) -> None:
        """Closes the endpoint; further calls do nothing."""
        if self.peer is not None:
            self._lock_step.turn_rotors([0.0] * len(self._motors))
        self._lock_step.close()
        if self._transport is not None:
            self._transport.close()

    # ---------------------------------------------------------------------------------- lock step

    is_in_step = False
    """As in `ExternalAutopilot`: asyncio's transport belongs to the loop."""
    may_sleep = False
    """As in `ExternalAutopilot`: ArduPilot answers each state, and asks again after a lost one."""

    def send_sensors(self, time_ns: int, news: News) -> bool:
        """Implements `ExternalAutopilot.send_sensors`."""
        self._slow.update({name: news[name] for name in _SLOW if name in news})
        state = _state_of({**self._slow, **news})
        if self.peer is None or self._transport is None or state is None:
            return False
        if self._begin_ns is None:
            self._begin_ns = time_ns - PERIOD_NS
        self._line = state_line((time_ns - self._begin_ns) / NS_PER_S, state)
        self._transport.sendto(self._line, self.peer)
        return True

    def on_reset(self) -> None:
        """Implements `ExternalAutopilot.on_reset`.

        ArduPilot flies on if its simulator's clock goes back.
        """
        self._begin_ns = None

    def drop(self) -> None:
        """Implements `ExternalAutopilot.drop`; a live ArduPilot sends again every second."""
        self.peer, self._begin_ns = None, None
        self._lock_step.turn_rotors([0.0] * len(self._motors))

    # ----------------------------------------------------------------------------------- asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Implements asyncio's method."""
        self._transport = cast(asyncio.DatagramTransport, transport)  # no such class in 3.11

    def datagram_received(self, data: bytes, addr: Address) -> None:
        """Implements asyncio's method."""
        servos = parse_servos(data)
        if servos is None:
            self._warn("a sender to its port is not an ArduPilot")
            return
        now_s = time.monotonic()
        if self.peer is None or self._is_new(servos, addr, now_s):
            self._welcome(addr)
        if addr != self.peer:
            self._warn("its ArduPilot is connected already; another one is ignored")
            return
        self._received_s = now_s
        if servos.number == self._number:
            self._repeat()
        elif servos.number > self._number:
            self._obey(servos)

    def _is_new(self, servos: Servos, addr: Address, now_s: float) -> bool:
        """Returns whether a frame starts a session: the ArduPilot has left, or it has restarted."""
        if addr != self.peer:
            return now_s - self._received_s > _GONE_S
        back = self._number - servos.number
        return back > _LATE_FRAMES or (back > 0 and servos.number == 0)

    def _warn(self, text: str) -> None:
        """Logs a warning once per text, as datagrams arrive by the hundred."""
        if text not in self._logged:
            self._logged.add(text)
            _log.warning("%s: %s", self.uav, text)

    def error_received(self, exc: Exception) -> None:
        """Implements asyncio's method: the address has no receiver, which the timeout detects."""
        _log.debug("%s: %s", self.uav, exc)

    def _welcome(self, peer: Address) -> None:
        self.peer, self._begin_ns, self._number = peer, None, -1
        _log.info("%s: an ArduPilot controls it", self.uav)

    def _repeat(self) -> None:
        """Sends the last state again."""
        if self._lock_step.waits and self._transport is not None:
            self._transport.sendto(self._line, self.peer)

    def _obey(self, servos: Servos) -> None:
        self._number = servos.number
        self._lock_step.go_on(rotor_fractions(servos.pwm, self._motors))


def _state_of(news: News) -> State | None:
    """Returns the new state of a UAV; None without a sample of its IMU and its true pose."""
    if "imu" not in news or _TRUTH not in news:
        return None
    inertial, truth = inertial_of(news["imu"]), news[_TRUTH]
    q = truth.pose.pose.orientation
    attitude = (float(q.x), float(q.y), float(q.z), float(q.w))
    sonar, battery = news.get("range"), news.get("battery")
    distance = math.inf if sonar is None else float(sonar.range)
    return State(
        inertial.force,
        inertial.rates,
        parts(truth.pose.pose.position),
        attitude,
        _turned(attitude, parts(truth.twist.twist.linear)),
        distance if math.isfinite(distance) else None,
        None if battery is None else (float(battery.voltage), -float(battery.current)),
    )


def _turned(q: tuple[float, float, float, float], v: Vector) -> Vector:
    """Returns `v`, given in the map, in the body: v + 2 w (u x v) + 2 u x (u x v)."""
    x, y, z, w = q
    a = 2.0 * (y * v[2] - z * v[1])
    b = 2.0 * (z * v[0] - x * v[2])
    c = 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * a + y * c - z * b,
        v[1] + w * b + z * a - x * c,
        v[2] + w * c + x * b - y * a,
    )
