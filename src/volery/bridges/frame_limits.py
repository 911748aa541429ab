"""Limits what a WebSocket client sends besides whole messages: control frames and fragments.

Servers stop reading from a client after each message until the message is processed. They do not
stop for pings, which they answer even if the client does not read, nor for fragments, which they
collect. A client that floods a server with them would use up its memory and its time. What has
arrived of messages counts in the account of `bridges.unfinished`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any

from volery.bridges.unfinished import ArrivingMessages

MAX_FRAGMENTS = 4096
"""Fragments of one message. Browsers send none below some kilobytes (modelling choice)."""
FRAMES_PER_S = 500.0
"""Mean rate of a client's pings, pongs and fragments (modelling choice)."""
MAX_FRAMES_AHEAD = 1000
"""Frames that a client may send ahead of that rate."""

_FRAGMENT_BYTES = 512
"""Cost of storing a fragment besides its data."""

_UNREAD, _FAST, _FULL = "unread answers", "too many frames", "no room"


class FrameLimits:
    """Limits one connection. All methods belong to the thread of its loop.

    end: closes the connection for a reason.
    """

    def __init__(
        self,
        transport: PausedTransport,
        loop: asyncio.AbstractEventLoop,
        end: Callable[[str], None],
    ) -> None:
        self._transport = transport
        self._loop = loop
        self._arriving = ArrivingMessages(
            loop, end, lambda: transport.hold(_FULL), lambda: transport.release(_FULL)
        )
        self._incomplete = 0
        self._whole: deque[int] = deque()
        """Bytes of each message that the application has not taken."""
        self._num_fragments = 0
        self._frames_ahead = 0.0
        self._counted_s = loop.time()

    def control_frame(self) -> None:
        """Counts a ping or pong; pauses reading if they come too fast."""
        self._count_frame()

    def unread_answer(self) -> None:
        """Pauses reading until `answers_read`, because earlier answers are still unsent."""
        self._transport.hold(_UNREAD)

    def answers_read(self) -> None:
        """Resumes reading after the client has read the answers."""
        self._transport.release(_UNREAD)

    def fragment(self) -> bool:
        """Counts a fragment; returns whether the message may continue."""
        self._num_fragments += 1
        self._count_frame()
        return self._num_fragments <= MAX_FRAGMENTS

    def message(self) -> None:
        """Starts a new message."""
        self._num_fragments = 0

    def whole(self, size: int) -> None:
        """Notes that a message of `size` bytes is complete, and waits for the application."""
        self._num_fragments = 0
        self._whole.append(size)
        self._arriving.finish()

    def taken(self) -> None:
        """Notes that the application has taken a message."""
        if self._whole:
            self._whole.popleft()
            self._note()

    def arrived(self, incomplete: int) -> None:
        """Counts what has arrived of an incomplete message, in bytes, after each read."""
        self._incomplete = incomplete + _FRAGMENT_BYTES * self._num_fragments
        self._note()

    def close(self) -> None:
        """Frees everything after the connection is lost."""
        self._transport.end()
        self._whole.clear()
        self._arriving.close()

    def _note(self) -> None:
        self._arriving.note(self._incomplete, sum(self._whole))

    def _count_frame(self) -> None:
        now_s = self._loop.time()
        earned = (now_s - self._counted_s) * FRAMES_PER_S
        self._counted_s = now_s
        self._frames_ahead = max(0.0, self._frames_ahead - earned) + 1.0
        late = self._frames_ahead - MAX_FRAMES_AHEAD
        if late > 0.0:
            self._transport.hold(_FAST)
            self._transport.release_later(_FAST, self._loop, late / FRAMES_PER_S)


class PausedTransport:
    """A transport that is read while neither its protocol nor any other reason pauses it."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport
        self._reasons: set[str] = set()
        self._timers: dict[str, asyncio.TimerHandle] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def pause_reading(self) -> None:
        """Implements asyncio's method for the protocol."""
        self.hold("protocol")

    def resume_reading(self) -> None:
        """Implements asyncio's method for the protocol."""
        self.release("protocol")

    def hold(self, reason: str) -> None:
        """Pauses reading until `reason` and all others are released."""
        if not self._reasons:
            self._transport.pause_reading()
        self._reasons.add(reason)

    def release(self, reason: str) -> None:
        """Removes `reason`, if present, and resumes reading without further reasons."""
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
        """Cancels all timers after the connection is lost, and resolves the transport's cycle."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        if hasattr(self._transport, "_read_ready_cb"):  # as asyncio does from Python 3.12 on
            self._transport._read_ready_cb = None
