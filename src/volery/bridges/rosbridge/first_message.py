"""Connections that read little until their client has sent the token, and few frames at any time.

The first message must be short: a longer one is refused by its announced length. Nothing after it
is read before the server has checked it. So a client may send large messages right after its token,
and a client without a token fills no memory.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, cast

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ProtocolError
from websockets.frames import CloseCode, Frame, Opcode

from volery.bridges.frame_limits import MAX_FRAGMENTS, FrameLimits, PausedTransport
from volery.bridges.rosbridge.message_budget import MAX_UNAUTHORIZED_BYTES

_READ_BYTES = 32 << 10
"""Bytes read at once; all their frames are parsed before another client has its turn. With the
default of asyncio, 256 KiB, full of small frames, others would wait for a tenth of a second."""
_LAST_WORDS_S = 1.0
_MAX_BLOCKED_S = 60.0
"""Time in which a client must read some of what waits for it. Pings would wait behind that."""
_CONTROL = (Opcode.PING, Opcode.PONG)
_MESSAGES = (Opcode.TEXT, Opcode.BINARY, Opcode.CONT)


class GuardedConnection(ServerConnection):
    """A connection of a server that may require a token; see `guarded`."""

    has_token = False
    """Whether the server requires a token."""
    max_bytes = MAX_UNAUTHORIZED_BYTES
    """Largest message of an authorized client."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._last_frames: deque[Frame] = deque()
        """The last frame of each message that the application has not taken."""
        self._progress_check: asyncio.TimerHandle | None = None
        """While more waits for the client than the system buffers."""
        self._recv_unbounded: Callable[[Frame], None] = self.protocol.recv_frame
        self.protocol.recv_frame = self._recv_frame  # type: ignore[method-assign]
        if self.has_token:
            self.protocol.max_message_size = MAX_UNAUTHORIZED_BYTES
            self.protocol.recv_frame = self._recv_first  # type: ignore[method-assign]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Implements asyncio's method; reads in small pieces."""
        transport.max_size = _READ_BYTES  # type: ignore[attr-defined]
        self._held = PausedTransport(cast("asyncio.Transport", transport))
        self._limits = FrameLimits(self._held, self.loop, self._end)
        super().connection_made(cast("asyncio.BaseTransport", self._held))

    def pause_writing(self) -> None:
        """Implements asyncio's method; ends the connection if the client reads nothing."""
        super().pause_writing()
        self._expect_progress()

    def resume_writing(self) -> None:
        """Implements asyncio's method: the client has read."""
        super().resume_writing()
        self._limits.answers_read()
        self._cancel_progress_check()

    def connection_lost(self, exc: Exception | None) -> None:
        """Implements asyncio's method; resolves cycles of references, see `core.collector`."""
        self._limits.close()
        self._cancel_progress_check()
        super().connection_lost(exc)
        protocol = self.protocol
        protocol.parser.close()
        for error in (protocol.parser_exc, protocol.handshake_exc):
            if error is not None:
                error.__traceback__ = None  # its frames hold what was read last
        protocol.select_subprotocol = None  # type: ignore[method-assign, assignment]
        protocol.recv_frame = _ignore  # type: ignore[method-assign, assignment]
        self._recv_unbounded = _ignore

    def set_connection_exc(self, exc: BaseException | None) -> None:
        """Implements the method of `websockets`; drops the frames, which hold this connection."""
        super().set_connection_exc(exc)
        if exc is not None:
            exc.__traceback__ = exc.__context__ = None

    async def keepalive(self) -> None:
        """Implements the method of `websockets`; its task keeps no error, which would hold it."""
        with suppress(asyncio.CancelledError):
            await super().keepalive()

    def data_received(self, data: bytes) -> None:
        """Implements asyncio's method; counts what is incomplete."""
        super().data_received(data)
        protocol = self.protocol
        self._limits.arrived(len(protocol.reader.buffer) + (protocol.current_size or 0))

    async def recv(self, decode: bool | None = None) -> Any:
        """Receives the next message."""
        message = await super().recv(decode)
        self._limits.taken()
        if self._last_frames:
            self._last_frames.popleft().data = b""  # the parser refers to it until the next one
        return message

    async def send_all(self, messages: Sequence[str | bytes]) -> None:
        """Sends messages with one call of the system; returns when there is room for more."""
        async with self.send_context():
            for message in messages:
                if isinstance(message, str):
                    self.protocol.send_text(message.encode())
                else:
                    self.protocol.send_binary(message)

    def send_data(self) -> None:
        """Implements the method of `websockets`; joins what it would write piece by piece."""
        pieces = self.protocol.writes
        if len(pieces) > 1 and all(pieces):  # an empty one is the end of the stream
            self.protocol.writes = [b"".join(pieces)]
        super().send_data()

    def _expect_progress(self) -> None:
        unsent = self.transport.get_write_buffer_size()
        self._progress_check = self.loop.call_later(_MAX_BLOCKED_S, self._check_progress, unsent)

    def _check_progress(self, unsent: int) -> None:
        if self.transport.get_write_buffer_size() < unsent:
            self._expect_progress()
        else:
            self.transport.abort()

    def _cancel_progress_check(self) -> None:
        if self._progress_check is not None:
            self._progress_check.cancel()
            self._progress_check = None

    def _end(self, reason: str) -> None:
        """Closes the connection, with the reason if the client reads it soon."""
        self.protocol.fail(CloseCode.TRY_AGAIN_LATER, reason)
        self.send_data()
        self.loop.call_later(_LAST_WORDS_S, self.transport.abort)

    def allow(self) -> None:
        """Accepts messages of the server's full size: the client has sent the token."""
        self._unguard()
        self.transport.resume_reading()

    def _recv_frame(self, frame: Frame) -> None:
        """Raises `ProtocolError`, which ends the connection, beyond a number of fragments."""
        if frame.opcode is Opcode.CONT:
            if not self._limits.fragment():
                raise ProtocolError(f"more than {MAX_FRAGMENTS} fragments")
        elif frame.opcode in _CONTROL:
            self._limits.control_frame()
            if frame.opcode is Opcode.PING and self.paused:
                self._limits.unread_answer()
        else:
            self._limits.message()
        if frame.fin and frame.opcode in _MESSAGES:
            self._limits.whole(len(frame.data) + (self.protocol.current_size or 0))
            self._last_frames.append(frame)
        self._recv_unbounded(frame)

    def _recv_first(self, frame: Frame) -> None:
        self._recv_frame(frame)
        if frame.fin and frame.opcode in _MESSAGES:
            self._unguard()  # bytes that have arrived already may begin with a long message
            self.transport.pause_reading()

    def _unguard(self) -> None:
        self.protocol.max_message_size = self.max_bytes
        self.protocol.recv_frame = self._recv_frame  # type: ignore[method-assign]


def _ignore(_frame: Frame) -> None:
    """Does nothing."""


def guarded(token: str | None, max_bytes: int) -> type[GuardedConnection]:
    """Returns the class of the connections of one server."""
    attributes = {"has_token": token is not None, "max_bytes": max_bytes}
    return type("GuardedConnection", (GuardedConnection,), attributes)
