"""One client's WebSocket, whoever serves it: its frames to its peer, what that says back to it.

await converse(channel, bell, peer, bulk)
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, Protocol

from volery.bridges.bridge_host import wake_of
from volery.bridges.rosbridge.bulk_turns import TURN_S, BulkTurns, Writer
from volery.bridges.rosbridge.protocol import RosbridgePeer
from volery.bridges.rosbridge.token_check import TokenCheck
from volery.bridges.rosbridge.wire import Frame

POLICY_VIOLATION = 1008
"""RFC 6455, 7.4.1: the client broke a rule, such as to show a token."""
SERVICE_RESTART = 1012
"""IANA's WebSocket Close Code Number Registry: the client should connect again."""

_LONGEST_SILENCE_S = 10.0
"""Time a client has to show its token."""


class WebSocketSession(Protocol):
    """A WebSocket that stands. All methods raise where it does no more."""

    async def recv(self) -> Frame:
        """Wait for a message."""

    async def send(self, message: Frame, /) -> None:
        """Send a message; returns when the network has taken so much that it may take the next."""

    async def close(self, code: int = ..., reason: str = ...) -> None:
        """Take leave."""


class Bell:
    """Wakes a writer from any thread; rung often before it is heard, it costs the ringer once."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.heard = asyncio.Event()
        self._wake = wake_of(loop, self.heard.set)
        self._rung = False

    def ring(self) -> None:
        """Wake the writer."""
        if not self._rung:
            self._rung = True
            self._wake()

    def silence(self) -> None:
        """Called before looking at what there is: who rings afterwards is heard again."""
        self.heard.clear()
        self._rung = False


def post_to(loop: asyncio.AbstractEventLoop) -> Callable[[Callable[[], Any]], None]:
    """What a peer's `post` is where its client is served in `loop`."""

    def post(action: Callable[[], Any]) -> None:
        wake_of(loop, action)()

    return post


async def converse(
    channel: WebSocketSession,
    bell: Bell,
    peer: RosbridgePeer,
    bulk: BulkTurns,
    checkpoint: TokenCheck | None = None,
) -> Exception | None:
    """Serve a client until it leaves or must go, then close its peer.

    bell: what the peer's `wake` rings. bulk: turns of all clients of this loop. checkpoint: of a
    client that must show a token. Returns what ended the service unless that was its own end:
    mostly that the connection was closed.
    """
    read = asyncio.Event()
    writer = Writer(bulk)
    tasks = [
        asyncio.create_task(_read(channel, peer, read, checkpoint)),
        asyncio.create_task(_write(channel, peer, bell, writer, read)),
    ]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        peer.close()
        writer.close()
        for task in tasks:
            task.cancel()
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
    return next((outcome for outcome in outcomes if isinstance(outcome, Exception)), None)


async def _read(
    channel: WebSocketSession,
    peer: RosbridgePeer,
    read: asyncio.Event,
    checkpoint: TokenCheck | None,
) -> None:
    """Hand the client's frames to its peer until it leaves or must go."""
    spent_s = 0.0
    while peer.refused is None:
        silence_s = None if peer.authorized else _LONGEST_SILENCE_S
        try:
            async with asyncio.timeout(silence_s):  # unlike wait_for it loses no cancellation
                frame = await channel.recv()
        except TimeoutError:
            await channel.close(POLICY_VIOLATION, "no token was shown")
            return
        peer.reading.begin()
        if peer.authorized or checkpoint is None:
            peer.receive(frame, time.monotonic())
        else:
            await checkpoint.receive(peer, frame)
            peer.reading.begin()  # the checkpoint lets others have their turn
        spent_s += peer.reading.end(1, len(frame))
        if spent_s >= TURN_S:  # `recv` does not wait where a frame is there
            spent_s = 0.0
            await asyncio.sleep(0)
        while (pause_s := peer.reading.pause_s()) and peer.refused is None:
            await asyncio.sleep(pause_s)
        while peer.congested:  # it asks for more than it reads
            read.clear()
            await read.wait()
    for answer in peer.frames(time.monotonic()):
        await channel.send(answer)
    await channel.close(POLICY_VIOLATION, peer.refused[:100])


async def _write(
    channel: WebSocketSession, peer: RosbridgePeer, bell: Bell, turns: Writer, read: asyncio.Event
) -> None:
    """Send what the peer has to say, as fast as the client reads."""
    while True:
        bell.silence()
        await turns.begin()
        frames = peer.frames(time.monotonic())
        while True:
            frame, cost_s = _next(peer, frames)
            if frame is None:
                break
            await channel.send(frame)
            read.set()
            while pause_s := peer.writing.pause_s():
                await asyncio.sleep(pause_s)
            await turns.spend(cost_s)
        read.set()
        now_s = time.monotonic()
        due_s = peer.due_s(now_s)
        with suppress(TimeoutError):
            async with asyncio.timeout(None if due_s is None else due_s - now_s):
                await bell.heard.wait()


def _next(peer: RosbridgePeer, frames: Iterator[Frame]) -> tuple[Frame | None, float]:
    """Returns the next frame and the s that making it costs, charged to the client."""
    peer.writing.begin()
    frame = next(frames, None)
    return frame, peer.writing.end(1, 0 if frame is None else len(frame))
