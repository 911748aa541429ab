"""Connects a socket, a frame parser and an outbox in one event loop.

Bytes are received into and sent from their final memory: asyncio's own transports would copy each
message twice.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import NamedTuple, Protocol

from volery.bridges.ros_tcp.wire import Bytes, RosTcpFrame, RosTcpFrameParser
from volery.bridges.unfinished import ArrivingMessages
from volery.core.errors import BridgeError
from volery.core.network_access import tend
from volery.core.preamble import Preamble

_BATCHES_A_TURN = 16
"""Batches after which others have their turn."""
_FRAMES_A_TURN = 32
"""Frames beyond which a peer is read in small parts, so that a flood does not delay others."""
_CHUNK_BYTES = 2048
_MAX_CHUNK_BYTES = 256 << 10
"""Limit of one read, which copies as long as the peer refills the socket: a read of 16 MB took a
tenth of a second."""
_PREAMBLE_BYTES = 16
_FAREWELL_S = 1.0


class Outgoing(Protocol):
    """Frames to send."""

    @property
    def crowded(self) -> bool:
        """Whether so many bytes wait that no more should be caused."""

    def gather(self) -> list[Bytes]:
        """Returns parts of whole frames to send next, a bounded number; none if nothing waits."""


class ServerEnd(NamedTuple):
    """A server's checks of the first bytes of a client."""

    preamble: Preamble
    prove: Callable[[], None]
    """Called when a valid frame has arrived."""
    note_foreign_protocol: Callable[[str], None]
    """Called with the protocol of a client that uses another one."""


class Throttle(Protocol):
    """Limits reading from a peer that costs too much; `graph.read_budget.Reading`."""

    def begin(self) -> None:
        """Starts the measurement of decoding."""

    def end(self, frames: int, size: int) -> float:
        """Ends the measurement of decoding. Returns its cost, s."""

    def pause_s(self) -> float:
        """Returns the time for which not to read, s; 0: read on."""


class RosTcpConnection:
    """Reads frames, passes them to `take`, and sends what the outbox gathers.

    broken: called with the reason why the rest cannot be read; frames that it puts into the outbox
    are still sent. closed: called once with the reason of the end. server_end: a server's checks of
    a new client; None for a client. throttle: None for an unlimited peer.
    """

    def __init__(
        self,
        sock: socket.socket,
        parser: RosTcpFrameParser,
        outbox: Outgoing,
        take: Callable[[RosTcpFrame], None],
        broken: Callable[[str], None],
        closed: Callable[[str], None],
        server_end: ServerEnd | None = None,
        throttle: Throttle | None = None,
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._sock = sock
        self.parser = parser
        self._outbox = outbox
        self._take = take
        self._broken = broken
        self._closed = closed
        self._unproven = server_end
        self._throttle = throttle
        self._paused: asyncio.TimerHandle | None = None
        self._has_room = True
        self._arriving = ArrivingMessages(
            self._loop, self.close, lambda: self._set_room(False), lambda: self._set_room(True)
        )
        self._unsent: list[Bytes] = []
        self._blocked = False
        self._chunk_bytes = _CHUNK_BYTES
        self._reading = True
        self._ending = False
        self._open = True
        self.last_received_s = self.last_sent_s = self._loop.time()
        """Times of the loop's clock."""
        sock.setblocking(False)
        tend(sock)
        self._loop.add_reader(sock, self._readable)

    def flush(self) -> None:
        """Sends queued frames as far as the peer accepts them."""
        if self._open and not self._blocked:
            self._write()

    def finish(self) -> None:
        """Stops reading, sends queued frames, then closes."""
        if self._open and not self._ending:
            self._ending = True
            self._loop.call_later(_FAREWELL_S, self.close, "it violated the protocol")
            self.flush()

    def close(self, reason: str) -> None:
        """Ends the connection now; further calls do nothing."""
        if not self._open:
            return
        self._open = False
        if self._paused is not None:
            self._paused.cancel()
        self._loop.remove_reader(self._sock)
        self._loop.remove_writer(self._sock)
        self._sock.close()
        self._unsent.clear()
        self.parser.end()
        self._arriving.close()
        self._closed(reason)

    def _readable(self) -> None:
        space = self.parser.space()
        try:
            count = self._sock.recv_into(space[: self._chunk_bytes])
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            self.close(str(error.strerror))
            return
        if not count:
            self.close("it has disconnected")
            return
        self.last_received_s = self._loop.time()
        if self._ending:  # unread bytes would make the system discard our last frames
            return
        if self._is_foreign(space[:count]):
            return
        try:
            frames = self.parser.written(count)
            if frames:
                self._arriving.finish()
            self._arriving.note(self.parser.num_incomplete)
            self._prove(bool(frames))
            flood = len(frames) > _FRAMES_A_TURN
            self._chunk_bytes = (
                _CHUNK_BYTES if flood else min(2 * self._chunk_bytes, _MAX_CHUNK_BYTES)
            )
            self._take_all(frames, count)
        except BridgeError as error:
            self._broken(str(error))
            self.finish()
        if self._open and not self._ending and self._must_pause():
            self._reading = False
            self._loop.remove_reader(self._sock)

    def _is_foreign(self, data: memoryview) -> bool:
        """Ends a connection with another protocol; returns whether it did.

        Nothing need be held back: no frame is whole before its first bytes show the protocol.
        """
        if self._unproven is None:
            return False
        preamble = self._unproven.preamble
        preamble.feed(bytes(data[:_PREAMBLE_BYTES]))
        if preamble.refused is None:
            return False
        self._unproven.note_foreign_protocol(preamble.refused)
        self.close(f"it uses {preamble.refused}")
        return True

    def _prove(self, has_frames: bool) -> None:
        if self._unproven is not None and (has_frames or self.parser.keepalives):
            self._unproven.prove()
            self._unproven = None

    def _take_all(self, frames: list[RosTcpFrame], size: int) -> None:
        if self._throttle is None:
            for frame in frames:
                self._take(frame)
            return
        self._throttle.begin()
        try:
            for frame in frames:
                self._take(frame)
        finally:
            self._throttle.end(len(frames), size)

    def _must_pause(self) -> bool:
        """Returns whether to pause reading: the peer does not read answers, or costs too much."""
        pause_s = 0.0 if self._throttle is None else self._throttle.pause_s()
        if pause_s and self._paused is None:
            self._paused = self._loop.call_later(pause_s, self._pause_over)
        return self._outbox.crowded or bool(pause_s) or not self._has_room

    def _set_room(self, has_room: bool) -> None:
        self._has_room = has_room
        if has_room:
            self._read_again()

    def _pause_over(self) -> None:
        self._paused = None
        self._read_again()

    def _write(self) -> None:
        try:
            for _ in range(_BATCHES_A_TURN):
                if not self._unsent:
                    self._unsent = self._outbox.gather()
                    if not self._unsent:
                        self._idle()
                        return
                self._forget(self._sock.sendmsg(self._unsent))
                self.last_sent_s = self._loop.time()
                self._read_again()
        except (BlockingIOError, InterruptedError):
            pass
        except OSError as error:
            self.close(str(error.strerror))
            return
        self._block(True)

    def _read_again(self) -> None:
        if self._open and not self._reading and not self._must_pause():
            self._reading = True
            self._loop.add_reader(self._sock, self._readable)

    def _idle(self) -> None:
        """Handles the empty queue."""
        self._block(False)
        if self._ending:
            with contextlib.suppress(OSError):
                self._sock.shutdown(socket.SHUT_WR)

    def _block(self, blocked: bool) -> None:
        if blocked and not self._blocked:
            self._loop.add_writer(self._sock, self._write)
        elif self._blocked and not blocked:
            self._loop.remove_writer(self._sock)
        self._blocked = blocked

    def _forget(self, sent: int) -> None:
        """Removes sent bytes from the front."""
        parts = self._unsent
        gone = 0
        while gone < len(parts) and sent >= len(parts[gone]):
            sent -= len(parts[gone])
            gone += 1
        del parts[:gone]
        if sent:
            parts[0] = memoryview(parts[0])[sent:]
