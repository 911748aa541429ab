"""Tracks the autopilots of a graph for a bridge: their frames, and vehicles that appear or leave.

Works in the loop of the bridge; the session carries everything to the simulation's thread.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.core.errors import GraphError
from volery.graph.messages import message_type
from volery.graph.session import Gateway, Session
from volery.graph.subscription_queue import SubscriptionQueue

PACKETS = "volery_interfaces/msg/MavlinkPackets"
_IN, _OUT = "/mavlink/in", "/mavlink/out"
_DEPTH = 1000
_MAX_WAITING = 2000
"""Messages with frames that the simulation has not processed, above which clients wait."""
_PAUSE_S = 0.02
_LOOK_S = 0.2
"""Time between two scans for vehicles, s."""
_BEAT_S = 1.0
"""Wall time without a frame after which the last heartbeat is repeated, so that vehicles of a
paused simulation stay connected."""

Sink = Callable[[int, bytes], None]
"""Receives frames for a link, by its number."""


@dataclass(eq=False)
class RegisteredVehicle:
    """One vehicle with an autopilot."""

    name: str
    system: int
    queue: SubscriptionQueue
    sink: Sink
    heartbeat: bytes = b""
    received_s: float = 0.0


class VehicleRegistry:
    """Tracks all vehicles of a gateway's graph that have autopilots.

    `joined(name, system)` is called for each vehicle and returns the sink of its frames;
    `left(system)` is called when the vehicle is gone.
    """

    def __init__(
        self,
        gateway: Gateway,
        name: str,
        joined: Callable[[str, int], Sink],
        left: Callable[[int], None],
    ) -> None:
        self._session: Session = gateway.open(name)
        self._joined, self._left = joined, left
        self._loop = asyncio.get_running_loop()
        self._craft: dict[int, RegisteredVehicle] = {}
        self._packets = message_type(PACKETS)
        self._closed = False

    @property
    def systems(self) -> tuple[int, ...]:
        """Ids of the present vehicles."""
        return tuple(self._craft)

    @property
    def pause_s(self) -> float:
        """Time for which no client must be read, because the simulation has not kept up, s."""
        return _PAUSE_S if self._session.waiting > _MAX_WAITING else 0.0

    def look(self) -> None:
        """Finds vehicles that appeared or left, and repeats heartbeats of silent ones."""
        graph = self._session.graph
        there = {
            info.name.removesuffix(_OUT)[1:]
            for info in graph.topics()
            if info.name.endswith(_OUT) and info.msgtype == PACKETS and info.publishers
        }
        for craft in tuple(self._craft.values()):
            if craft.name not in there:
                self._forget(craft)
        for name in sorted(there - {craft.name for craft in self._craft.values()}):
            self._meet(name)
        now_s = self._loop.time()
        for craft in self._craft.values():
            if craft.heartbeat and now_s - craft.received_s > _BEAT_S:
                craft.received_s = now_s
                craft.sink(-1, craft.heartbeat)

    async def look_periodically(self) -> None:
        """Calls `look` periodically."""
        while True:
            await asyncio.sleep(_LOOK_S)
            self.look()

    def send(self, system: int, link: int, profile: int, data: bytes) -> None:
        """Sends frames of a link to a vehicle; the first call opens the link."""
        self._publish(system, link=link, profile=profile, closed=False, data=data)

    def close_link(self, system: int, link: int) -> None:
        """Closes a link of a vehicle."""
        self._publish(system, link=link, profile=0, closed=True, data=b"")

    def close(self) -> None:
        """Leaves the graph."""
        self._closed = True
        for craft in tuple(self._craft.values()):
            self._forget(craft)
        self._session.close()

    def _publish(self, system: int, *, data: bytes, **fields: Any) -> None:
        craft = self._craft.get(system)
        if craft is None or self._closed:
            return
        message = self._packets(data=np.frombuffer(data, np.uint8), **fields)
        with contextlib.suppress(GraphError):  # the simulation is closing
            self._session.publish(f"/{craft.name}{_IN}", message)

    def _meet(self, name: str) -> None:
        system = self._system_of(name)
        if system is None or system in self._craft:
            return
        self._session.advertise(f"/{name}{_IN}", PACKETS)

        def wake() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._drain, system)

        queue = self._session.subscribe(f"/{name}{_OUT}", PACKETS, depth=_DEPTH, wake=wake)
        craft = RegisteredVehicle(name, system, queue, _nowhere)
        self._craft[system] = craft
        craft.sink = self._joined(name, system)

    def _system_of(self, name: str) -> int | None:
        try:
            parameter = self._session.graph.parameters.get(f"/{name}/autopilot", "mavlink_id")
        except GraphError:
            return None
        return int(parameter.value)

    def _drain(self, system: int) -> None:
        craft = self._craft.get(system)
        if craft is None:
            return
        for published in craft.queue.take():
            message = published.message
            data = np.asarray(message.data, np.uint8).tobytes()
            craft.received_s = self._loop.time()
            if data[7:10] == b"\0\0\0" and data[0] == _MAGIC:
                craft.heartbeat = data[: _HEAD + data[1] + 2]
            craft.sink(message.link, data)

    def _forget(self, craft: RegisteredVehicle) -> None:
        del self._craft[craft.system]
        self._session.unsubscribe(craft.queue)
        with contextlib.suppress(GraphError):
            self._session.unadvertise(f"/{craft.name}{_IN}")
        self._left(craft.system)


_MAGIC, _HEAD = 0xFD, 10
"""Bytes of a MAVLink 2 frame: ten, the payload, two of its checksum."""


def _nowhere(_link: int, _data: bytes) -> None:
    """Drops frames of a vehicle whose bridge is not open yet."""
