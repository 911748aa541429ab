r"""A UAV's radio as a node: its topics over a real communication server instead of a run's radio.

For UAVs that fly, or run in processes of their own, it replaces a scenario's `[radio]`; the other
nodes stay the same:

    volery node radio --via ros1 --namespace /uav1 \
        --param 'topics=["team volery_interfaces/msg/TeamReport"]' --param server=10.0.0.1:10200
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from typing import Any

from volery.comms.address_assignment import free_address
from volery.comms.addresses import ALL, GROUP_SIZE, Identity
from volery.comms.payloads import decode_named, encode_named
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.server.tcp import PORT
from volery.comms.station.tcp import Station
from volery.core.errors import CommsError, GraphError
from volery.graph.messages import message_type
from volery.graph.nodes.node import Node

_PERIOD_S = 0.02
"""Period at which received messages are published: they arrive in another thread."""
_MAX_INCOMING = 1000
_END_S = 2.0


class RadioNode(Node):
    """Sends messages on `topics` to all stations, publishes theirs on `radio/...`.

    The node waits for a server, and reconnects after an interruption. Messages that are too long,
    or exceed a station's buffer, are dropped.

    Parameters
    ----------
    topics: "NAME TYPE" each, NAME below the UAV's namespace.
    server: HOST:PORT of `volery comms`.
    station_id: linear id; -1: that of the namespace, uavN is N - 1.
    group_size, token: as the server requires.

    """

    def __init__(self, **options: Any) -> None:
        super().__init__("radio", **options)
        topics = self.declare_parameter("topics", [""]).value
        host, port = _server_of(str(self.declare_parameter("server", f"127.0.0.1:{PORT}").value))
        number = int(self.declare_parameter("station_id", -1).value)
        planes = int(self.declare_parameter("group_size", GROUP_SIZE).value)
        token = str(self.declare_parameter("token", "").value) or None
        name = self.get_namespace().strip("/")
        identity = Identity.of(free_address(name, ()) if number < 0 else number, planes)

        self._incoming: queue.Queue[StationFrame] = queue.Queue(_MAX_INCOMING)
        self._publishers = {}
        for text in topics:
            topic, msgtype = _topic_of(text)
            kind = message_type(msgtype)
            self._publishers[topic] = self.create_publisher(kind, f"radio/{topic}")
            self.create_subscription(kind, topic, self._sender(topic, msgtype))
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

        async def make() -> Station:
            station = Station(
                identity,
                self._take,
                host=host,
                port=port,
                name=name,
                token=token,
                group_size=planes,
            )
            await station.start(timeout_s=None)
            return station

        self._station = asyncio.run_coroutine_threadsafe(make(), self._loop).result()
        self.create_timer(_PERIOD_S, self._publish_incoming)

    @property
    def joined(self) -> bool:
        """Whether the server has welcomed it."""
        return self._station.joined

    def destroy_node(self) -> None:
        """Leaves the network."""
        super().destroy_node()
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._station.stop(), self._loop).result(_END_S)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_END_S)
            self._loop.close()

    def _sender(self, topic: str, msgtype: str) -> Any:
        def send(message: Any) -> None:
            with contextlib.suppress(CommsError):  # too long: lost
                payload = encode_named(topic, msgtype, message)
                self._loop.call_soon_threadsafe(self._send, payload)

        return send

    def _send(self, payload: bytes) -> None:
        with contextlib.suppress(CommsError):  # no room: lost
            self._station.send(StationFrameKind.SENSING, ALL, payload)

    def _take(self, frame: StationFrame) -> None:
        """Queues a frame for the node's thread; drops the oldest if the queue is full."""
        while True:
            with contextlib.suppress(queue.Full):
                self._incoming.put_nowait(frame)
                return
            with contextlib.suppress(queue.Empty):
                self._incoming.get_nowait()

    def _publish_incoming(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                frame = self._incoming.get_nowait()
                with contextlib.suppress(CommsError):  # other content by another program
                    named = decode_named(frame.payload)
                    publisher = self._publishers.get(named.name)
                    if publisher is not None and publisher.msgtype == named.msgtype:
                        publisher.publish(named.message)


def _server_of(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise GraphError(f"radio: server must be HOST:PORT, not '{text}'")
    return host, int(port)


def _topic_of(text: str) -> tuple[str, str]:
    try:
        topic, msgtype = str(text).split()
        message_type(msgtype)
    except (ValueError, KeyError):
        raise GraphError(
            f"radio: topics must be like 'team std_msgs/msg/String', not '{text}'"
        ) from None
    return topic, msgtype
