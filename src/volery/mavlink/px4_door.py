"""Real PX4s fly the UAVs: a TCP server for each vehicle, in lock step with the simulation.

    with Simulation(with_px4(scenario)) as simulation, Doors(simulation.gateway) as doors:
        doors.open(Px4Door())                        # 4560 + i; PX4 instances connect
        simulation.run(speed=1.0)

Every 4 ms of simulated time all vehicles are told what their sensors measured, and the simulation
waits for those PX4s that have begun to answer. One that is silent for `timeout_s` of wall time is
given up with a warning: its rotors stop, and it may connect anew, as a restarted one. A PX4 cannot
go back in time, so resets and snapshots are refused while the door is open.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
from typing import Any

import numpy as np

from volery.core.clock import NS_PER_S
from volery.core.errors import BridgeError, GraphError
from volery.core.listening import check_address, tend
from volery.graph.mailbox import Mailbox
from volery.graph.reply import Reply
from volery.graph.session import Gateway, Session
from volery.graph.zero import zero_message
from volery.mavlink.codec import dialect
from volery.mavlink.hil import PERIOD_NS, Actuators, Fix, HilLink, Inertial, Sensed

PORT = 4560
_JOIN = "volery_interfaces/srv/JoinLockStep"
_SPEEDS = "std_msgs/msg/Float32MultiArray"
_CLOCK = "rosgraph_msgs/msg/Clock"
_SENSORS = {
    "imu": "sensor_msgs/msg/Imu",
    "mag": "sensor_msgs/msg/MagneticField",
    "pressure": "sensor_msgs/msg/FluidPressure",
    "pressure/temperature": "sensor_msgs/msg/Temperature",
    "fix": "sensor_msgs/msg/NavSatFix",
    "fix_velocity": "geometry_msgs/msg/TwistWithCovarianceStamped",
}
_log = logging.getLogger(__name__)


class Px4Door:
    """Serves PX4 instance i, the autopilot of the i-th UAV, at `port` + i.

    timeout_s: wall time that a PX4 which has begun to answer may stay silent.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        timeout_s: float = 10.0,
        anywhere: bool = False,
    ) -> None:
        self._host, self._port = host, port
        self._timeout_s = timeout_s
        self._anywhere = anywhere
        self._seats: list[_Seat] = []

    @property
    def name(self) -> str:
        """What it is and where."""
        return f"PX4 {self._host}:{self._port} and following"

    @property
    def connected(self) -> tuple[str, ...]:
        """UAVs whose PX4 is there."""
        return tuple(seat.uav for seat in self._seats if seat.transport is not None)

    async def start(self, gateway: Gateway) -> None:
        """Begin to listen. `BridgeError` where a port is taken, or a UAV lacks an IMU."""
        dialect()
        check_address(self._host, anywhere=self._anywhere, flag="--allow-remote")
        uavs = _uavs_of(gateway)
        if not uavs:
            raise BridgeError("no UAV has the IMU that a PX4 needs")
        for k, uav in enumerate(uavs):
            seat = _Seat(gateway, uav, k + 1, self._timeout_s)
            self._seats.append(seat)
            await seat.open(self._host, self._port + k)

    async def stop(self) -> None:
        """Let all PX4s go."""
        for seat in self._seats:
            seat.close()
        self._seats.clear()
        await asyncio.sleep(0)


class _Seat(asyncio.Protocol):
    """Where the PX4 of one UAV sits."""

    def __init__(self, gateway: Gateway, uav: str, system: int, timeout_s: float) -> None:
        self.uav = uav
        self.transport: asyncio.Transport | None = None
        self._system, self._timeout_s = system, timeout_s
        self._link = HilLink(system)
        self._loop = asyncio.get_running_loop()
        self._server: asyncio.Server | None = None
        self._session: Session = gateway.open(f"PX4 of {uav}")
        self._meeting = f"/volery/lock_step/px4_{system}"
        self._pending: Any = None
        self._alarm: asyncio.TimerHandle | None = None
        self._boxes: dict[str, Mailbox] = {}
        self._temperature = 20.0

    async def open(self, host: str, port: int) -> None:
        """Listen, and have the simulation meet this seat."""
        try:
            self._server = await self._loop.create_server(lambda: self, host, port)
        except (OSError, OverflowError) as error:
            taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
            why = "the port is taken" if taken else str(error)
            raise BridgeError(f"{self.uav}: cannot listen on {host}:{port}: {why}") from None
        session = self._session
        for name, kind in _SENSORS.items():
            topic = f"/{self.uav}/{name}"
            self._boxes[name] = session.subscribe(topic, kind, depth=1, wake=_nothing)
        session.advertise(f"/{self.uav}/rotor_speeds", _SPEEDS)
        session.advertise(f"{self._meeting}/done", _CLOCK)
        wake = self._wake
        self._go = session.subscribe(f"{self._meeting}/go", _CLOCK, depth=1, wake=wake)
        request = zero_message(f"{_JOIN}_Request")
        request.name = f"px4_{self._system}"
        request.period_s = PERIOD_NS / NS_PER_S
        request.timeout_s = self._timeout_s + 5.0  # this seat's own comes first
        session.call("/volery/join_lock_step", request, Reply(_nothing_of, _nothing_of))

    def close(self) -> None:
        """Give everything back; a second time nothing happens."""
        if self._server is not None:
            self._server.close()
        self._drop("")
        self._session.close()

    # ----------------------------------------------------------------------------------- meetings

    def _wake(self) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._meet)

    def _meet(self) -> None:
        for published in self._go.take():
            clock = published.message.clock
            time_ns = clock.sec * NS_PER_S + clock.nanosec
            self._pending = published.message
            sensed = self._sensed()
            if self.transport is None or sensed is None:
                self._go_on()
                continue
            self.transport.write(self._link.tell(time_ns, sensed))
            if not self._link.locked:
                self._go_on()
                continue
            self._alarm = self._loop.call_later(self._timeout_s, self._give_up)

    def _sensed(self) -> Sensed | None:
        """What is new since the last meeting; None without a reading of the IMU."""
        news = {name: [p.message for p in box.take()] for name, box in self._boxes.items()}
        newest = {name: found[-1] for name, found in news.items() if found}
        if "imu" not in newest:
            return None
        imu = newest["imu"]
        inertial = Inertial(_parts(imu.linear_acceleration), _parts(imu.angular_velocity))
        if "pressure/temperature" in newest:
            self._temperature = float(newest["pressure/temperature"].temperature)
        field = newest.get("mag")
        pressure = newest.get("pressure")
        return Sensed(
            inertial,
            None if field is None else _parts(field.magnetic_field),
            None if pressure is None else float(pressure.fluid_pressure),
            self._temperature,
            _fix_of(newest),
        )

    def _give_up(self) -> None:
        self._drop(f"its PX4 has been silent for {self._timeout_s:g} s; it is not waited for")
        self._go_on()

    def _go_on(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
        pending, self._pending = self._pending, None
        if pending is not None:
            self._publish(f"{self._meeting}/done", pending)

    def _obey(self, actuators: Actuators) -> None:
        speeds = zero_message(_SPEEDS)
        shares = [max(0.0, part) if actuators.armed else 0.0 for part in actuators.controls]
        speeds.data = np.array(shares, np.float32)
        self._publish(f"/{self.uav}/rotor_speeds", speeds)

    def _publish(self, topic: str, message: Any) -> None:
        with contextlib.suppress(GraphError):  # the simulation is closing
            self._session.publish(topic, message)

    def _drop(self, why: str) -> None:
        """End the connection, the rotors with it."""
        if self.transport is not None:
            self.transport.abort()
            self._part(why)

    def _part(self, why: str) -> None:
        self.transport = None
        self._obey(Actuators((0.0,) * 16, armed=False))
        if why:
            _log.warning("%s: %s", self.uav, why)

    # ---------------------------------------------------------------------------------- of asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As of asyncio; a second PX4 at the same port is sent away."""
        assert isinstance(transport, asyncio.Transport)
        if self.transport is not None:
            transport.abort()
            return
        self.transport = transport
        self._link = HilLink(self._system)
        tend(transport.get_extra_info("socket"))

    def data_received(self, data: bytes) -> None:
        """As of asyncio."""
        for actuators in self._link.feed(data):
            self._obey(actuators)
            self._go_on()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        """As of asyncio."""
        if self.transport is not None and self.transport.is_closing():
            self._part("its PX4 has left")
            self._go_on()


def _uavs_of(gateway: Gateway) -> list[str]:
    """UAVs with an IMU, in the order of their names' numbers."""
    topics = [info.name for info in gateway.graph.topics() if info.name.endswith("/imu")]
    names = [topic.split("/")[1] for topic in topics if topic.count("/") == 2]
    return sorted(names, key=lambda name: (len(name), name))


def _fix_of(newest: dict[str, Any]) -> Fix | None:
    fix = newest.get("fix")
    if fix is None:
        return None
    velocity = newest.get("fix_velocity")
    speed = (0.0, 0.0, 0.0) if velocity is None else _parts(velocity.twist.twist.linear)
    level, upright = (float(np.sqrt(max(fix.position_covariance[k], 0.0))) for k in (0, 8))
    if fix.status.status < 0:
        return Fix(float("nan"), float("nan"), float("nan"), (0.0, 0.0, 0.0), 0.0, 0.0)
    return Fix(fix.latitude, fix.longitude, fix.altitude, speed, level, upright)


def _parts(vector: Any) -> tuple[float, float, float]:
    return float(vector.x), float(vector.y), float(vector.z)


def _nothing() -> None:
    """Nobody waits for it."""


def _nothing_of(_answer: object) -> None:
    """Nobody waits for it."""
