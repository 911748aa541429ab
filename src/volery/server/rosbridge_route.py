"""Route `./rosbridge`: clients of the graph, over starlette's WebSocket."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from starlette.types import Message
from starlette.websockets import WebSocket, WebSocketDisconnect

from volery.bridges.rosbridge.access_policy import AccessPolicy
from volery.bridges.rosbridge.protocol import RosbridgePeer
from volery.bridges.rosbridge.websocket_session import SERVICE_RESTART, Bell, converse, post_to
from volery.bridges.rosbridge.wire import CBOR_PROTOCOL, Frame
from volery.server.access_policy import OperatorPolicy, ViewerPolicy
from volery.server.auth import Role
from volery.server.server_state import Client, JoinedWorld, ServerState

_log = logging.getLogger(__name__)

MAX_CLIENTS = 1000
LONGEST_STALL_S = 60.0
"""Max time to send a frame to a client; pings detect a lost client earlier."""
_TRY_AGAIN_LATER = 1013
"""IANA's WebSocket Close Code Number Registry."""


class _Channel:
    """Adapts a starlette WebSocket to a `WebSocketSession`."""

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket

    async def recv(self) -> Frame:
        message: Message = await self._websocket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1006))
        text: str | None = message.get("text")
        data: bytes = message.get("bytes") or b""
        return data if text is None else text

    async def send_all(self, messages: Sequence[Frame]) -> None:
        for message in messages:
            kind = "text" if isinstance(message, str) else "bytes"
            async with asyncio.timeout(LONGEST_STALL_S):
                await self._websocket.send({"type": "websocket.send", kind: message})

    async def close(self, code: int = 1000, reason: str = "") -> None:
        await self._websocket.close(code, reason[:100])


async def serve_rosbridge(websocket: WebSocket) -> None:
    """Serves one client until it leaves or its world ends."""
    site: ServerState = websocket.app.state.site
    spoken = CBOR_PROTOCOL if CBOR_PROTOCOL in websocket.scope["subprotocols"] else None
    await websocket.accept(spoken)
    if site.world is None:
        await websocket.close(SERVICE_RESTART, "the world is being built")
        return
    if len(site.clients) >= MAX_CLIENTS:
        await websocket.close(_TRY_AGAIN_LATER, "too many clients")
        return
    world, address = site.world, websocket.client
    name = f"page {address.host}:{address.port}" if address else "page"
    with _gate_of(websocket, site, world) as gate:
        await _serve(site, world, _Channel(websocket), name, gate)


@contextmanager
def _gate_of(
    websocket: WebSocket, site: ServerState, world: JoinedWorld
) -> Iterator[AccessPolicy | None]:
    """Yields the client's policy; releases an operator's UAVs when it leaves."""
    if websocket.state.role is not Role.OPERATOR:
        yield ViewerPolicy()
        return
    operators = world.operators
    if operators is None:
        yield None
        return
    gate = OperatorPolicy(
        site.operator_names.sign_in(websocket.query_params.get("operator", "")),
        site.operator_names,
        operators,
    )
    try:
        yield gate
    finally:
        site.operator_names.sign_out(gate.name)
        world.gateway.post(lambda: operators.leave(gate.name))


async def _serve(
    site: ServerState, world: JoinedWorld, channel: _Channel, name: str, gate: AccessPolicy | None
) -> None:
    """Runs one session."""
    loop = asyncio.get_running_loop()
    bell = Bell(loop)
    session = world.gateway.open(name)
    peer = RosbridgePeer(
        session,
        world.shared,
        wake=bell.ring,
        post=post_to(loop),
        authorized=True,
        gate=gate,
    )
    session_task = asyncio.create_task(converse(channel, bell, peer, world.queue))
    client = Client(channel, session_task)
    site.clients.add(client)
    try:
        (problem,) = await asyncio.gather(session_task, return_exceptions=True)
    finally:
        site.clients.discard(client)
    gone = (WebSocketDisconnect, OSError, TimeoutError, asyncio.CancelledError)
    if isinstance(problem, BaseException) and not isinstance(problem, gone):
        _log.error("serving %s failed", name, exc_info=problem)
