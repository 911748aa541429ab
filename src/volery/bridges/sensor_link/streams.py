"""Converts the graph's sensor topics to frames of the sensor link, once for all clients."""

from __future__ import annotations

import asyncio
import re
from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

from volery.bridges.loop_waker import wake_of
from volery.bridges.sensor_link.payloads import PAYLOADS, encode_payload
from volery.bridges.sensor_link.wire import (
    SensorLinkKind,
    crc_of_head,
    encode_frame,
    encode_head,
)
from volery.core.clock import NS_PER_S
from volery.core.errors import BridgeError, GraphError
from volery.core.framing import crc16, crc_bytes
from volery.graph.messages import Published, stamp_of
from volery.graph.session import Gateway, Session
from volery.graph.subscription_queue import SubscriptionQueue

SENSORS = (SensorLinkKind.LASER_SCAN, SensorLinkKind.POSE, SensorLinkKind.IMU, SensorLinkKind.SONAR)
IMAGES = (SensorLinkKind.IMAGE,)

_UAV_TOPIC = re.compile(r"/uav([1-9]\d{0,4})/(.+)")
_MAX_UAVS = 0xFFFF
_NEW_TOPICS_PERIOD_S = 0.5
_CRC_STEP_BYTES = 64 << 10
"""Bytes of a fifth of a millisecond, for which others wait for an image's CRC."""

Send = Callable[["SensorStream", bytes], None]
"""Receives a sensor's frame for all clients."""


class SensorStream:
    """One sensor's messages for the clients."""

    def __init__(self, kind: SensorLinkKind, uav: int, name: str) -> None:
        self.kind = kind
        self.uav = uav
        self.name = name
        self.queue: SubscriptionQueue | None = None
        self.sequence = 0
        self.last_ns = 0
        self.next_ns = 0
        """Time before which messages are not sent, unless time went back."""


class Due(NamedTuple):
    """A message to send, and its number among those of its sensor."""

    stream: SensorStream
    published: Published
    sequence: int


class SensorStreams:
    """Streams of the sensors of some kinds. All methods belong to the event loop's thread.

    Without clients nothing is subscribed. depth: messages per sensor that may wait here. period_ns:
    simulated time between two sent messages of a sensor, 0: all are sent.
    """

    def __init__(
        self,
        gateway: Gateway,
        name: str,
        kinds: Iterable[SensorLinkKind],
        send: Send,
        *,
        depth: int,
        period_ns: int = 0,
    ) -> None:
        self._gateway = gateway
        self._name = name
        self._kinds = {PAYLOADS[kind].msgtype: kind for kind in kinds}
        self._send = send
        self._depth = depth
        self._period_ns = period_ns
        self._session: Session | None = None
        self._streams: dict[str, SensorStream] = {}
        self._ready: deque[SensorStream] = deque()
        self._come = asyncio.Event()
        self._woken = False
        self._tasks: list[asyncio.Task[None]] = []

    def open(self) -> None:
        """Starts to receive and send; further calls do nothing."""
        if self._session is None:
            self._session = self._gateway.open(self._name)
            self._wake = wake_of(asyncio.get_running_loop(), self._come.set)
            self._tasks = [
                asyncio.create_task(self._watch_topics()),
                asyncio.create_task(self._send_all()),
            ]

    def close(self) -> None:
        """Stops receiving; after another `open` the sequences continue."""
        if self._session is not None:
            for task in self._tasks:
                task.cancel()
            self._session.close()
            self._session = None
            for stream in self._streams.values():
                stream.queue = None
            self._ready.clear()

    async def _watch_topics(self) -> None:
        while True:
            for topic in self._gateway.graph.topics():
                kind, found = self._kinds.get(topic.msgtype), _UAV_TOPIC.fullmatch(topic.name)
                if kind is not None and found is not None and int(found[1]) <= _MAX_UAVS:
                    stream = self._streams.get(topic.name)
                    if stream is None:
                        stream = SensorStream(kind, int(found[1]), found[2])
                        self._streams[topic.name] = stream
                    if stream.queue is None:
                        self._subscribe(topic.name, topic.msgtype, stream)
            await asyncio.sleep(_NEW_TOPICS_PERIOD_S)

    def _subscribe(self, topic: str, msgtype: str, stream: SensorStream) -> None:
        assert self._session is not None

        def stir() -> None:
            self._ready.append(stream)
            if not self._woken:
                self._woken = True
                self._wake()

        try:
            stream.queue = self._session.subscribe(topic, msgtype, depth=self._depth, wake=stir)
        except GraphError:  # the topic's type has just changed
            return
        stir()

    async def _send_all(self) -> None:
        while True:
            await self._come.wait()
            self._come.clear()
            self._woken = False
            while self._ready:
                for due in self._take(self._ready.popleft()):
                    await self._send_one(due)

    def _take(self, stream: SensorStream) -> list[Due]:
        taken = [] if stream.queue is None else stream.queue.take()
        due = []
        for published in taken:
            if self._is_due(stream, published.time_ns):
                due.append(Due(stream, published, stream.sequence))
                stream.sequence += 1
        return due

    def _is_due(self, stream: SensorStream, time_ns: int) -> bool:
        """Returns whether the stream's rate allows a message of this time."""
        period, went_back = self._period_ns, time_ns < stream.last_ns
        stream.last_ns = time_ns
        early_ns = period // 100  # a camera of exactly this rate may round its times
        if period and time_ns + early_ns < stream.next_ns and not went_back:
            return False
        late = went_back or time_ns >= stream.next_ns + period
        stream.next_ns = (time_ns if late else stream.next_ns) + period
        return True

    async def _send_one(self, due: Due) -> None:
        stream = due.stream
        try:
            payload = encode_payload(stream.kind, due.published.message, stream.name)
            stamp_ns = stamp_of(due.published.message)
            if len(payload) <= _CRC_STEP_BYTES:
                frame = encode_frame(stream.kind, stream.uav, due.sequence, stamp_ns, payload)
            else:
                head = encode_head(stream.kind, stream.uav, due.sequence, stamp_ns, len(payload))
                check = await _crc_in_steps(payload, crc_of_head(head))
                frame = b"".join((head, payload, crc_bytes(check)))
        except BridgeError:  # a message without a form on this link: its number is missing
            return
        self._send(stream, frame)


async def _crc_in_steps(data: bytes, check: int) -> int:
    view = memoryview(data)
    for start in range(0, len(view), _CRC_STEP_BYTES):
        check = crc16(view[start : start + _CRC_STEP_BYTES], check)
        await asyncio.sleep(0)
    return check


def period_from_hz(rate_hz: float | None) -> int:
    """Returns nanoseconds between two images; 0 for None, which sends all.

    Raises `BridgeError` for a rate out of range.
    """
    if rate_hz is None:
        return 0
    if not 0.0 < rate_hz <= 1e6:
        raise BridgeError(f"the rate of images must be above 0 Hz and at most 1e6, not {rate_hz}")
    return round(NS_PER_S / rate_hz)
