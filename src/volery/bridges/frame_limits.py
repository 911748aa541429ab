"""Bounds of what a WebSocket client sends beside whole messages: control frames, fragments.

Servers stop reading from a client for each message until it is taken. They do not for pings, which
they answer also where the client reads no answers, nor for fragments, which they collect one by
one. A client that floods a server with them would take its memory and its time.
"""

from __future__ import annotations

import asyncio
from typing import Any

MAX_FRAGMENTS = 4096
"""Of one message. Browsers send none below some kilobytes (modelling choice)."""
FRAMES_PER_S = 500.0
"""Pings, pongs and fragments of a client, on average (modelling choice)."""
MAX_FRAMES_AHEAD = 1000
"""Those that it may send in advance."""

_UNREAD, _FAST = "unread answers", "too many frames"


class FrameLimits:
    """The bounds of one connection. All methods belong to the thread of its loop."""

    def __init__(self, transport: HeldTransport, loop: asyncio.AbstractEventLoop) -> None:
        self._transport = transport
        self._loop = loop
        self._num_fragments = 0
        self._frames_ahead = 0.0
        self._counted_s = loop.time()

    def control_frame(self) -> None:
        """Counts a ping or pong; reads no more for a while where they come too fast."""
        self._count_frame()

    def unread_answer(self) -> None:
        """Reads no more until `answers_read`: a ping was answered, and earlier answers wait."""
        self._transport.hold(_UNREAD)

    def answers_read(self) -> None:
        """The client has read what waited."""
        self._transport.release(_UNREAD)

    def fragment(self) -> bool:
        """Counts a fragment; returns whether the message may go on."""
        self._num_fragments += 1
        self._count_frame()
        return self._num_fragments <= MAX_FRAGMENTS

    def message(self) -> None:
        """A message begins."""
        self._num_fragments = 0

    def _count_frame(self) -> None:
        now_s = self._loop.time()
        earned = (now_s - self._counted_s) * FRAMES_PER_S
        self._counted_s = now_s
        self._frames_ahead = max(0.0, self._frames_ahead - earned) + 1.0
        late = self._frames_ahead - MAX_FRAMES_AHEAD
        if late > 0.0:
            self._transport.hold(_FAST)
            self._transport.release_later(_FAST, self._loop, late / FRAMES_PER_S)


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
