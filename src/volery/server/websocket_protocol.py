"""WebSocket connections of the page's server, with the bounds of `bridges.frame_limits`."""

from __future__ import annotations

import asyncio
from typing import cast

from uvicorn._types import ASGIReceiveEvent
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame

from volery.bridges.frame_limits import MAX_FRAGMENTS, FrameLimits, PausedTransport

READ_BYTES = 16 << 10
"""Max bytes of a read; all frames in it are handled before another client has its turn."""

_LAST_WORDS_S = 1.0


class PageWebSocket(WebSocketsSansIOProtocol):
    """uvicorn's protocol with bounds for control frames and fragments."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Implements asyncio.Protocol."""
        transport.max_size = READ_BYTES  # type: ignore[attr-defined]
        self._held = PausedTransport(cast("asyncio.Transport", transport))
        self._limits = FrameLimits(self._held, self.loop, self._end)
        super().connection_made(cast("asyncio.BaseTransport", self._held))

    def resume_writing(self) -> None:
        """Implements asyncio.Protocol: the client has read."""
        super().resume_writing()
        self._limits.answers_read()

    def connection_lost(self, exc: Exception | None) -> None:
        """Implements asyncio.Protocol."""
        self._limits.close()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Implements asyncio.Protocol; counts what is incomplete."""
        super().data_received(data)
        self._limits.arrived(len(self.conn.reader.buffer) + (self.conn.current_size or 0))

    def send_receive_event_to_app(self) -> None:
        """Overrides uvicorn's method."""
        if not self.close_sent:
            self._limits.whole(sum(map(len, self.frames)))
        super().send_receive_event_to_app()

    async def receive(self) -> ASGIReceiveEvent:
        """Overrides uvicorn's method."""
        event = await super().receive()
        if event["type"] == "websocket.receive":
            self._limits.taken()
        return event

    def handle_ping(self) -> None:
        """Overrides uvicorn's method; does not read on while responses are unread."""
        super().handle_ping()
        if not self.writable.is_set():
            self._limits.unread_answer()
        self._limits.control_frame()

    def handle_pong(self, event: Frame) -> None:
        """Overrides uvicorn's method."""
        super().handle_pong(event)
        self._limits.control_frame()

    def handle_text(self, event: Frame) -> None:
        """Overrides uvicorn's method."""
        self._limits.message()
        super().handle_text(event)
        event.data = b""  # the parser refers to the frame until the next one

    def handle_bytes(self, event: Frame) -> None:
        """Overrides uvicorn's method."""
        self._limits.message()
        super().handle_bytes(event)
        event.data = b""

    def handle_cont(self, event: Frame) -> None:
        """Overrides uvicorn's method, for a bounded number of fragments."""
        if self._limits.fragment():
            super().handle_cont(event)
            event.data = b""
        elif not self.close_sent:
            self._fail(CloseCode.MESSAGE_TOO_BIG, f"more than {MAX_FRAGMENTS} fragments")

    def _end(self, reason: str) -> None:
        if not self.close_sent:
            self._fail(CloseCode.TRY_AGAIN_LATER, reason)
            self.loop.call_later(_LAST_WORDS_S, self.transport.abort)

    def _fail(self, code: CloseCode, reason: str) -> None:
        self.frames = []
        self.conn.fail(code, reason)
        self.handle_parser_exception()
