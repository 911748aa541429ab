"""A bridge that makes every UAV of a graph a station: it sends states and receives commands.

    bridges.open(StationBridge("127.0.0.1", 10200))

If a UAV has a mission (`task_manager`), hold, land and return go to the mission, which would
otherwise continue; before a `go_to` the bridge holds it.

uavN is the station with linear id N - 1; UAVs of other names get the lowest free id.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from functools import partial
from typing import Any

from volery.comms.address_assignment import free_address
from volery.comms.addresses import ALL_GROUND, GROUP_SIZE, Identity
from volery.comms.payloads import (
    COMMANDS,
    MISSION,
    MISSION_COMMANDS,
    MISSION_TYPE,
    REPLY,
    REPLY_TYPE,
    SLAM,
    SLAM_TYPE,
    STATE,
    STATE_TYPE,
    decode_named,
    encode_named,
)
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.server.tcp import PORT
from volery.comms.station.statuses import slam_gist
from volery.comms.station.tcp import Station
from volery.core.errors import CommsError, GraphError
from volery.graph.messages import message_type
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Gateway, Session
from volery.graph.subscription_queue import SubscriptionQueue

_VEHICLES = "/volery/vehicles"
_VEHICLES_TYPE = "volery_interfaces/msg/VehicleStates"
_PERIOD_S = 0.2
"""Period at which the simulation publishes its vehicles."""
_MISSION = "task_manager"
_ANNOUNCED = ((MISSION, "mission", MISSION_TYPE), (SLAM, "slam/status", SLAM_TYPE))
"""Optional topics of a UAV that are sent: name, topic below its own name, type."""
_REPEAT_S = 2.0
"""Period at which unchanged messages are repeated."""


class _Announced:
    """One topic of a UAV, sent to ground stations on change and periodically."""

    def __init__(self, name: str, msgtype: str, queue: SubscriptionQueue) -> None:
        self.queue = queue
        self._name, self._type = name, msgtype
        self._sent: object = None
        self._sent_at = -math.inf

    def payload(self, now: float) -> bytes | None:
        """Returns the payload to send at `now` s; None: nothing to send."""
        published = self.queue.take()
        if not published:
            return None
        message = published[-1].message
        gist = _gist(message)
        if gist == self._sent and now - self._sent_at < _REPEAT_S:
            return None
        self._sent, self._sent_at = gist, now
        return encode_named(self._name, self._type, message)


def _gist(message: Any) -> object:
    """Returns the fields of a status whose change is sent at once."""
    if hasattr(message, "phase"):
        return message.phase, message.sector, message.problem
    return slam_gist(message.data)


class StationBridge:
    """Runs one station for each UAV.

    host, port, token, group_size: of the communication server, as for `Station`.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        token: str | None = None,
        group_size: int = GROUP_SIZE,
    ) -> None:
        self._host = host
        self._port = port
        self._token = token
        self._planes = group_size
        self._stations: dict[str, Station] = {}
        self._announced: dict[tuple[str, str], _Announced] = {}
        self._task: asyncio.Task[None] | None = None
        self._session: Session | None = None

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"stations at {self._host}:{self._port}"

    async def start(self, gateway: Gateway) -> None:
        """Starts to watch the fleet; waits for a server that is not running yet."""
        self._loop = asyncio.get_running_loop()
        self._session = gateway.open(self.name)
        self._vehicles = self._session.subscribe(_VEHICLES, _VEHICLES_TYPE, wake=lambda: None)
        self._task = asyncio.create_task(self._watch(self._session))

    async def stop(self) -> None:
        """Removes all stations from the network."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        for station in self._stations.values():
            await station.stop()
        self._stations.clear()
        self._announced.clear()
        if self._session is not None:
            self._session.close()

    async def _watch(self, session: Session) -> None:
        while True:
            published = self._vehicles.take()
            if published:
                states = {state.name: state for state in published[-1].message.vehicles}
                for gone in self._stations.keys() - states.keys():
                    await self._stations.pop(gone).stop()
                    for name, _, _ in _ANNOUNCED:
                        if announced := self._announced.pop((gone, name), None):
                            session.unsubscribe(announced.queue)
                for name, state in states.items():
                    station = self._stations.get(name) or await self._join(session, name)
                    if station.joined:
                        _send(station, ALL_GROUND, encode_named(STATE, STATE_TYPE, state))
                        self._send_topics(session, name, station)
            await asyncio.sleep(_PERIOD_S)

    def _send_topics(self, session: Session, uav: str, station: Station) -> None:
        for name, below, msgtype in _ANNOUNCED:
            topic, key = f"/{uav}/{below}", (uav, name)
            if key not in self._announced:
                if session.graph.topic_type(topic) != msgtype:
                    continue  # no such topic so far
                queue = session.subscribe(topic, msgtype, depth=1, wake=lambda: None)
                self._announced[key] = _Announced(name, msgtype, queue)
            payload = self._announced[key].payload(self._loop.time())
            if payload is not None:
                _send(station, ALL_GROUND, payload)

    async def _join(self, session: Session, uav: str) -> Station:
        used = {station.core.address for station in self._stations.values()}
        station = Station(
            Identity.of(free_address(uav, used), self._planes),
            lambda frame: self._take(session, uav, frame),
            host=self._host,
            port=self._port,
            name=uav,
            token=self._token,
            group_size=self._planes,
        )
        self._stations[uav] = station
        await station.start(timeout_s=None)
        return station

    def _take(self, session: Session, uav: str, frame: StationFrame) -> None:
        if frame.kind != StationFrameKind.COMMAND:
            return
        respond = partial(self._respond, uav, frame.source)
        try:
            command = decode_named(frame.payload)
        except CommsError as error:
            respond(str(error))
            return
        srvtype = COMMANDS.get(command.name)
        if srvtype is None or command.msgtype != f"{srvtype}_Request":
            respond(
                f"unknown command {command.name} ({command.msgtype}); known: {', '.join(COMMANDS)}"
            )
            return

        def answered(response: Any) -> None:
            text = response.message or ("done" if response.success else "refused")
            self._respond_soon(respond, f"{command.name}: {text}")

        def failed(error: GraphError) -> None:
            self._respond_soon(respond, f"{command.name}: {error}")

        def call(_response: Any = None) -> None:
            session.call(service, command.message, ServiceReply(answered, failed))

        service = f"/{uav}/{command.name}"
        mission = f"/{uav}/{_MISSION}"
        missioned = session.graph.has_service(f"{mission}/hold")
        if command.name in MISSION_COMMANDS and missioned:
            service = f"{mission}/{command.name}"
        elif command.name == "resume":
            failed(GraphError(f"{uav} has no mission"))
            return
        if command.name == "go_to" and missioned:
            trigger = message_type(f"{COMMANDS['hold']}_Request")()
            session.call(f"{mission}/hold", trigger, ServiceReply(call, failed))
        else:
            call()

    def _respond_soon(self, respond: Any, text: str) -> None:
        """Passes a response from any thread to the loop, unless the loop has ended."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(respond, text)

    def _respond(self, uav: str, to: int, text: str) -> None:
        station = self._stations.get(uav)
        if station is not None:
            message = message_type(REPLY_TYPE)(text)
            _send(station, to, encode_named(REPLY, REPLY_TYPE, message))


def _send(station: Station, to: int, payload: bytes) -> None:
    """Sends a measurement; drops it if the buffer is full, like a loss by radio."""
    with contextlib.suppress(CommsError):
        station.send(StationFrameKind.SENSING, to, payload)
