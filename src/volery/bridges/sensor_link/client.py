"""The ROS side of the sensor link: connects, and publishes received frames on its own graph.

    with BridgeHost(gateway) as bridges:
        bridges.open(SensorLinkClient("127.0.0.1", 10100, image_port=10101))

All measurements of the environment appear under their topics (`/uav1/laser/horizontal/scan`); poses
published on `/uavN/pose_command` and `/uavN/goal_pose` are sent to the environment. The client
reconnects after a break.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque

from volery.bridges.loop_waker import wake_of
from volery.bridges.ros_tcp.incoming_queue import IncomingQueue
from volery.bridges.sensor_link.commands import COMMAND_TOPICS
from volery.bridges.sensor_link.payloads import (
    PAYLOADS,
    decode_notice,
    decode_payload,
    encode_payload,
)
from volery.bridges.sensor_link.server import IMAGE_PORT, PORT
from volery.bridges.sensor_link.wire import (
    SensorLinkFrame,
    SensorLinkKind,
    SensorLinkParser,
    encode_frame,
)
from volery.core.errors import BridgeError, GraphError
from volery.core.network_access import write_while_open
from volery.graph.messages import stamp_of
from volery.graph.session import Gateway, Session
from volery.graph.subscription_queue import SubscriptionQueue

_READ_BYTES = 256 << 10
_DEPTH = 20
_AGAIN_S = (0.1, 0.2, 0.5, 1.0, 2.0)
_MAX_UNSENT_BYTES = 64 << 10
_NOTICES_KEPT = 100


class SensorLinkClient:
    """A bridge to an environment with the sensor link.

    image_port: None ignores images. Counters are for reading only.
    """

    def __init__(
        self, host: str = "127.0.0.1", port: int = PORT, image_port: int | None = IMAGE_PORT
    ) -> None:
        self._host = host
        self._port = port
        self._image_port = image_port
        self._tasks: list[asyncio.Task[None]] = []
        self._writer: asyncio.StreamWriter | None = None
        self._inlets: dict[str, IncomingQueue] = {}
        self._sequences: dict[tuple[int, str], int] = {}
        self._commands: dict[tuple[SensorLinkKind, int], SubscriptionQueue] = {}
        self._sent = 0
        self.received = 0
        """Number of received messages."""
        self.lost = 0
        """Number of messages missing from the sequences."""
        self.corrupt = 0
        """Number of damaged frames on connections which have ended."""
        self.refused = 0
        """Number of frames that could not be converted to a message of this graph."""
        self.unsent = 0
        """Number of commands without a connection, or on a stalled one."""
        self.notices: deque[str] = deque(maxlen=_NOTICES_KEPT)
        """Notices of the environment, newest last."""

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"sensor link to {self._host}:{self._port}"

    async def start(self, gateway: Gateway) -> None:
        """Connects. Raises `BridgeError` if no server listens."""
        self._session: Session = gateway.open(self.name)
        self._wake = wake_of(asyncio.get_running_loop(), self._send_commands)
        ports = [self._port] if self._image_port is None else [self._port, self._image_port]
        for port in ports:
            streams = await self._connect(port)
            self._tasks.append(asyncio.create_task(self._stay(port, *streams)))

    async def stop(self) -> None:
        """Disconnects."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._tasks.clear()
        if hasattr(self, "_session"):
            self._session.close()

    async def _connect(self, port: int) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        try:
            reader, writer = await asyncio.open_connection(self._host, port, limit=2 * _READ_BYTES)
        except (OSError, OverflowError) as error:
            raise BridgeError(
                f"sensor link: no server on {self._host}:{port} ({error}): "
                "start the simulation with this bridge, or name its port"
            ) from None
        if port == self._port:
            self._writer = writer
        return reader, writer

    async def _stay(
        self, port: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Reads until the end of the connection and reconnects, for ever."""
        while True:
            try:
                await self._read(reader)
            finally:
                if self._writer is writer:
                    self._writer = None
                writer.close()
            attempt = 0
            while True:
                await asyncio.sleep(_AGAIN_S[min(attempt, len(_AGAIN_S) - 1)])
                with contextlib.suppress(BridgeError):
                    reader, writer = await self._connect(port)
                    break
                attempt += 1

    async def _read(self, reader: asyncio.StreamReader) -> None:
        parser = SensorLinkParser()
        with contextlib.suppress(OSError):
            while data := await reader.read(_READ_BYTES):
                for frame in parser.feed(data):
                    self._take(frame)
                await asyncio.sleep(0)
        self.corrupt += parser.corrupt

    def _take(self, frame: SensorLinkFrame) -> None:
        if frame.kind == SensorLinkKind.NOTICE:
            self.notices.append(decode_notice(frame.payload))
            return
        try:
            name, message = decode_payload(frame.kind, frame.payload, frame.stamp_ns)
            topic = f"/uav{frame.uav}/{name}"
            self._inlet(topic, PAYLOADS[SensorLinkKind(frame.kind)].msgtype).put(message)
            if frame.kind in (SensorLinkKind.POSE, SensorLinkKind.LASER_SCAN):
                self._listen_to(frame.uav)
        except (BridgeError, GraphError):
            self.refused += 1
            return
        self.received += 1
        self._count_lost(topic, frame)

    def _inlet(self, topic: str, msgtype: str) -> IncomingQueue:
        inlet = self._inlets.get(topic)
        if inlet is None or inlet.msgtype != msgtype:
            self._session.advertise(topic, msgtype)
            inlet = IncomingQueue(self._session, topic, msgtype, _DEPTH)
            self._inlets[topic] = inlet
        return inlet

    def _count_lost(self, topic: str, frame: SensorLinkFrame) -> None:
        key = (frame.kind, topic)
        before = self._sequences.get(key)
        self._sequences[key] = frame.sequence
        if before is not None and frame.sequence > before:  # else the environment restarted
            self.lost += frame.sequence - before - 1

    # ------------------------------------------------------------------------------------ commands

    def _listen_to(self, uav: int) -> None:
        """Forwards the commands for a UAV from now on."""
        if (SensorLinkKind.POSE_COMMAND, uav) in self._commands:
            return
        for kind, topic in COMMAND_TOPICS.items():
            self._commands[kind, uav] = self._session.subscribe(
                f"/uav{uav}/{topic}", PAYLOADS[kind].msgtype, wake=self._wake
            )

    def _send_commands(self) -> None:
        for (kind, uav), queue in self._commands.items():
            for published in queue.take():
                try:
                    payload = encode_payload(kind, published.message)
                    stamp_ns = stamp_of(published.message)
                    self._send(encode_frame(kind, uav, self._sent, stamp_ns, payload))
                except BridgeError:
                    self.refused += 1

    def _send(self, frame: bytes) -> None:
        writer = self._writer
        if writer is None or writer.transport.get_write_buffer_size() > _MAX_UNSENT_BYTES:
            self.unsent += 1
            return
        self._sent += 1
        write_while_open(writer.transport, frame)
