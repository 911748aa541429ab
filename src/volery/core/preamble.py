"""Detects web browsers on ports that speak a binary protocol.

Any web page that a user opens can send bytes to ports of the user's machine: `fetch` with
`mode: 'no-cors'` sends a POST whose body the page chooses, and a parser that searches for frames
finds one after the HTTP head. The first bytes of a connection identify such a client: an HTTP
method, or the ClientHello of TLS.

Sources: RFC 9110 section 9 and RFC 5789 (methods), RFC 9113 section 3.4 (preface of HTTP/2), RFC
8446 section 5.1 and appendix D (record type 22, version 3.x).
"""

from __future__ import annotations

_METHODS = (
    b"GET ",
    b"HEAD ",
    b"POST ",
    b"PUT ",
    b"DELETE ",
    b"CONNECT ",
    b"OPTIONS ",
    b"TRACE ",
    b"PATCH ",
    b"PRI * HTTP/2",
)
_TLS = b"\x16\x03"


class Preamble:
    """Checks the first bytes of one connection, in pieces of any size.

    `feed` withholds bytes only while they may be the start of a forbidden preamble, so a binary
    protocol passes with its first byte.
    """

    def __init__(self) -> None:
        self._held = b""
        self._decided = False
        self.refused: str | None = None
        """Protocol of a client whose connection must end: `HTTP` or `TLS`."""

    def feed(self, data: bytes) -> bytes:
        """Returns the bytes for the parser: none while undecided or refused."""
        if self._decided:
            return b"" if self.refused else data
        held = self._held + data
        self.refused = _protocol_of(held)
        self._decided = self.refused is not None or not _may_become_one(held)
        if self._decided:
            self._held = b""
            return b"" if self.refused else held
        self._held = held
        return b""


def _protocol_of(first: bytes) -> str | None:
    """Returns the forbidden protocol of a connection with these first bytes."""
    if first.startswith(_METHODS):
        return "HTTP"
    return "TLS" if first.startswith(_TLS) else None


def _may_become_one(first: bytes) -> bool:
    """Returns whether further bytes can complete a forbidden preamble."""
    return any(preamble.startswith(first) for preamble in (*_METHODS, _TLS))
