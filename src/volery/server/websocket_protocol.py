"""WebSocket connections of the page's server: what a client sends beside messages is bounded.

uvicorn stops reading from a client for each message until the server has taken it. It does not for
pings, which it answers also where the client reads no answers, nor for fragments, which it collects
one by one. A client that floods the server with them would take its memory and its time.
"""

from __future__ import annotations

import asyncio
from typing import Any, cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame

READ_BYTES = 16 << 10
"""At once; all frames in it are handled before another client has its turn."""
MAX_FRAGMENTS = 4096
"""Of one message. Browsers send none below some kilobytes (modelling choice)."""
FRAMES_PER_S = 500.0
"""Pings, pongs and fragments of a client, on average (modelling choice)."""
MAX_FRAMES_AHEAD = 1000
"""Those that it may send in advance."""


class PageWebSocket(WebSocketsSansIOProtocol):
    """uvicorn's own, with bounds for frames that are no whole message."""

    _num_fragments = 0
    _frames_ahead = 0.0
    _counted_s = 0.0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As of asyncio."""
        transport.max_size = READ_BYTES  # type: ignore[attr-defined]
        self._held = HeldTransport(cast("asyncio.Transport", transport))
        self._counted_s = self.loop.time()
        super().connection_made(cast("asyncio.BaseTransport", self._held))

    def resume_writing(self) -> None:
        """As of asyncio: the client has read."""
        super().resume_writing()
        self._held.release("unread answers")

    def connection_lost(self, exc: Exception | None) -> None:
        """As of asyncio."""
        self._held.end()
        super().connection_lost(exc)

    def handle_ping(self) -> None:
        """As of uvicorn; a client that does not read the answers is not read from."""
        super().handle_ping()
        if not self.writable.is_set():
            self._held.hold("unread answers")
        self._count_frame()

    def handle_pong(self, event: Frame) -> None:
        """As of uvicorn."""
        super().handle_pong(event)
        self._count_frame()

    def handle_text(self, event: Frame) -> None:
        """As of uvicorn."""
        self._num_fragments = 0
        super().handle_text(event)

    def handle_bytes(self, event: Frame) -> None:
        """As of uvicorn."""
        self._num_fragments = 0
        super().handle_bytes(event)

    def handle_cont(self, event: Frame) -> None:
        """As of uvicorn, for a bounded number of fragments."""
        self._num_fragments += 1
        if self._num_fragments > MAX_FRAGMENTS:
            if not self.close_sent:
                self.frames = []
                self.conn.fail(CloseCode.MESSAGE_TOO_BIG, f"more than {MAX_FRAGMENTS} fragments")
                self.handle_parser_exception()
            return
        super().handle_cont(event)
        self._count_frame()

    def _count_frame(self) -> None:
        """Stops reading for a while from a client that sends frames too fast."""
        now_s = self.loop.time()
        earned = (now_s - self._counted_s) * FRAMES_PER_S
        self._counted_s = now_s
        self._frames_ahead = max(0.0, self._frames_ahead - earned) + 1.0
        late = self._frames_ahead - MAX_FRAMES_AHEAD
        if late > 0.0:
            self._held.hold("too many frames")
            self._held.release_later("too many frames", self.loop, late / FRAMES_PER_S)


class HeldTransport:
    """A transport that is read from while neither its protocol nor any other reason holds it."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport
        self._reasons: set[str] = set()
        self._timers: dict[str, asyncio.TimerHandle] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def pause_reading(self) -> None:
        """As of asyncio, for the protocol."""
        self.hold("protocol")

    def resume_reading(self) -> None:
        """As of asyncio, for the protocol."""
        self.release("protocol")

    def hold(self, reason: str) -> None:
        """Reads no more until `reason` and all others are released."""
        if not self._reasons:
            self._transport.pause_reading()
        self._reasons.add(reason)

    def release(self, reason: str) -> None:
        """Reads on if nothing else holds it; does nothing where `reason` does not."""
        if reason in self._reasons:
            self._reasons.discard(reason)
            if not self._reasons:
                self._transport.resume_reading()

    def release_later(self, reason: str, loop: asyncio.AbstractEventLoop, wait_s: float) -> None:
        """Releases after a time, counted from the last call."""
        timer = self._timers.pop(reason, None)
        if timer is not None:
            timer.cancel()
        self._timers[reason] = loop.call_later(wait_s, self.release, reason)

    def end(self) -> None:
        """Forgets what waits: the connection is lost."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
