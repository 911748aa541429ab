"""HTTP connections of the page's server, with a deadline for requests.

uvicorn waits without limit for the head of a request, and for the rest of a body after the
response. A few hundred connections that send one byte now and then would block all other clients.
"""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from volery.core.listener import Listener

HEAD_TIMEOUT_S = 10.0
"""Deadline for the head of a request, and for the rest of a body after its response (modelling
choice).
"""
READ_BYTES = 64 << 10
"""Max bytes of a read, and so of requests that are buffered before the response to another."""


def http_protocol(listener: Listener) -> type[H11Protocol]:
    """Returns the protocol of the connections that `listener` accepts."""

    class PageProtocol(_DeadlineProtocol):
        """One connection."""

        _listener = listener

    return PageProtocol


class _DeadlineProtocol(H11Protocol):
    """uvicorn's protocol with a deadline for the client's data."""

    _listener: Listener
    _deadline: asyncio.TimerHandle | None = None
    _proven = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Implements asyncio.Protocol."""
        transport.max_size = READ_BYTES  # type: ignore[attr-defined]
        super().connection_made(transport)
        self._watch()

    def handle_events(self) -> None:
        """Overrides uvicorn's method: there are new bytes, or the next request begins."""
        super().handle_events()
        if not self._proven and self.conn.their_state not in (h11.IDLE, h11.ERROR):
            self._proven = True
            self._listener.prove(self.transport)
        self._watch()

    def on_response_complete(self) -> None:
        """Overrides uvicorn's method."""
        super().on_response_complete()
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Implements asyncio.Protocol."""
        self._stop_watch()
        super().connection_lost(exc)

    def _watch(self) -> None:
        """Sets the deadline if the client has to send data, else cancels it."""
        if not self._is_client_due() or self.transport.is_closing():
            self._stop_watch()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(HEAD_TIMEOUT_S, self._end)

    def _is_client_due(self) -> bool:
        state = self.conn.their_state
        answered = self.cycle is not None and self.cycle.response_complete
        return state is h11.IDLE or (state is h11.SEND_BODY and answered)

    def _stop_watch(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _end(self) -> None:
        self._deadline = None
        self._listener.note_slow_client()
        self.transport.abort()
