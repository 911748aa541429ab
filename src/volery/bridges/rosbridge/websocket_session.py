"""Exchanges frames between one client's WebSocket and its peer.

await converse(channel, bell, peer, queue)
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, Protocol

from volery.bridges.loop_waker import wake_of
from volery.bridges.rosbridge.fair_queue import MESSAGES, REQUESTS, FairQueue, Flow
from volery.bridges.rosbridge.protocol import RosbridgePeer
from volery.bridges.rosbridge.token_check import TokenCheck
from volery.bridges.rosbridge.wire import Frame
from volery.graph.read_budget import FRAME_S

POLICY_VIOLATION = 1008
"""RFC 6455, 7.4.1: the client violated a policy, such as to send a token."""
SERVICE_RESTART = 1012
"""IANA's WebSocket Close Code Number Registry: the client should reconnect."""

_LONGEST_SILENCE_S = 10.0
"""Time within which a client must send its token."""
_JSON_BYTE_S = 5e-9
"""Cost of a byte of JSON, s, by which large messages wait for short ones."""
_MAX_FRAMES = 6
_MAX_BYTES = 32 << 10
"""Limits of the frames of one client that are sent together, with one call of the system."""


class WebSocketSession(Protocol):
    """An open WebSocket. All methods raise after it has closed."""

    async def recv(self) -> Frame:
        """Waits for a message."""

    async def send_all(self, messages: Sequence[Frame], /) -> None:
        """Sends messages; returns when the network is ready for the next ones."""

    async def close(self, code: int = ..., reason: str = ...) -> None:
        """Closes the connection."""


class Bell:
    """Wakes a writer from any thread.

    Repeated calls before the writer runs cost only one wake-up.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.received = asyncio.Event()
        self._wake = wake_of(loop, self.received.set)
        self._rung = False

    def ring(self) -> None:
        """Wakes the writer."""
        if not self._rung:
            self._rung = True
            self._wake()

    def silence(self) -> None:
        """Resets the bell, before the writer checks for frames; later calls wake it again."""
        self.received.clear()
        self._rung = False


def post_to(loop: asyncio.AbstractEventLoop) -> Callable[[Callable[[], Any]], None]:
    """Returns a peer's `post` for a client that is served in `loop`."""

    def post(action: Callable[[], Any]) -> None:
        wake_of(loop, action)()

    return post


async def converse(
    channel: WebSocketSession,
    bell: Bell,
    peer: RosbridgePeer,
    queue: FairQueue,
    checkpoint: TokenCheck | None = None,
) -> Exception | None:
    """Serves a client until it leaves or must be disconnected, then closes its peer.

    bell: rung by the peer's `wake`. queue: of all clients of this loop. checkpoint: of a
    client that must send a token. Returns the exception that ended the service, usually the closed
    connection.
    """
    read = asyncio.Event()
    requests, messages = queue.flow(REQUESTS), queue.flow(MESSAGES)
    tasks = [
        asyncio.create_task(_read(channel, peer, requests, read, checkpoint)),
        asyncio.create_task(_write(channel, peer, bell, requests, messages, read)),
    ]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        peer.close()
        for task in tasks:
            task.cancel()
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
    return next((outcome for outcome in outcomes if isinstance(outcome, Exception)), None)


async def _read(
    channel: WebSocketSession,
    peer: RosbridgePeer,
    flow: Flow,
    read: asyncio.Event,
    checkpoint: TokenCheck | None,
) -> None:
    """Passes the client's frames to its peer until it leaves or must be disconnected."""
    while peer.refused is None:
        silence_s = None if peer.authorized else _LONGEST_SILENCE_S
        try:
            async with asyncio.timeout(silence_s):  # unlike wait_for it loses no cancellation
                frame = await channel.recv()
        except TimeoutError:
            await channel.close(POLICY_VIOLATION, "no token was sent")
            return
        await flow.begin(FRAME_S + len(frame) * _JSON_BYTE_S)
        peer.reading.begin()
        if peer.authorized or checkpoint is None:
            peer.receive(frame, time.monotonic())
        else:
            await checkpoint.receive(peer, frame)
            peer.reading.begin()  # the checkpoint gives others their turn
        flow.charge(peer.reading.end(1, len(frame)))
        frame = ""  # frees it while the client sends nothing
        while (pause_s := peer.reading.pause_s()) and peer.refused is None:
            await asyncio.sleep(pause_s)
        while peer.congested:  # the client requests more than it reads
            read.clear()
            await read.wait()
    await channel.send_all(list(peer.frames(time.monotonic())))
    await channel.close(POLICY_VIOLATION, peer.refused[:100])


async def _write(
    channel: WebSocketSession,
    peer: RosbridgePeer,
    bell: Bell,
    requests: Flow,
    messages: Flow,
    read: asyncio.Event,
) -> None:
    """Sends the peer's frames, as fast as the client reads."""
    while True:
        bell.silence()
        await (requests if peer.has_answers else messages).begin()
        frames = peer.frames(time.monotonic())
        while True:
            flow = requests if peer.has_answers else messages
            batch, cost_s = _next(peer, frames)
            if not batch:
                break
            await channel.send_all(batch)
            read.set()
            while pause_s := peer.writing.pause_s():
                await asyncio.sleep(pause_s)
            await flow.spend(cost_s)
        read.set()
        now_s = time.monotonic()
        due_s = peer.due_s(now_s)
        with suppress(TimeoutError):
            async with asyncio.timeout(None if due_s is None else due_s - now_s):
                await bell.received.wait()


def _next(peer: RosbridgePeer, frames: Iterator[Frame]) -> tuple[list[Frame], float]:
    """Returns the next frames and the time to make them, s, charged to the client."""
    peer.writing.begin()
    batch, size = [], 0
    for frame in frames:
        batch.append(frame)
        size += len(frame)
        if len(batch) >= _MAX_FRAMES or size >= _MAX_BYTES:
            break
    return batch, peer.writing.end(len(batch), size)
