"""HTTP connections of the page's server: a request must come whole within a time.

uvicorn waits without end for the head of a request, and for the rest of a body that it has answered
already. A few hundred connections that send one byte now and then would keep all others out.
"""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from volery.core.listener import Listener

HEAD_TIMEOUT_S = 10.0
"""For the head of a request, and for the rest of a body after its answer (modelling choice)."""
READ_BYTES = 64 << 10
"""At once, and so what is kept of requests that a client sends before the answer to another."""


def http_protocol(listener: Listener) -> type[H11Protocol]:
    """Returns the protocol of the connections that `listener` accepts."""

    class PageProtocol(_DeadlineProtocol):
        """One connection."""

        _listener = listener

    return PageProtocol


class _DeadlineProtocol(H11Protocol):
    """uvicorn's own, with a deadline for what the client has to send."""

    _listener: Listener
    _deadline: asyncio.TimerHandle | None = None
    _proven = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """As of asyncio."""
        transport.max_size = READ_BYTES  # type: ignore[attr-defined]
        super().connection_made(transport)
        self._watch()

    def handle_events(self) -> None:
        """As of uvicorn: there are new bytes, or the next request has its turn."""
        super().handle_events()
        if not self._proven and self.conn.their_state not in (h11.IDLE, h11.ERROR):
            self._proven = True
            self._listener.prove(self.transport)
        self._watch()

    def on_response_complete(self) -> None:
        """As of uvicorn."""
        super().on_response_complete()
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """As of asyncio."""
        self._stop_watch()
        super().connection_lost(exc)

    def _watch(self) -> None:
        """Sets the deadline where the client has to send something, else takes it back."""
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
