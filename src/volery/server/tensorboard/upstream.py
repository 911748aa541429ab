"""A small HTTP client of a server on loopback: one GET on a connection of its own, by h11."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import h11

MAX_BODY_BYTES = 64 << 20
"""Limit of a response; the largest file of TensorBoard's page has 7 MB."""
_READ_BYTES = 64 << 10
_CONNECT_S = 5.0
_PAUSE_S = 60.0
"""Timeout of each piece of a response; a large folder is read for seconds."""


class UpstreamError(Exception):
    """Raised if the server cannot be reached or its response is broken, late or too long."""


@dataclass
class UpstreamResponse:
    """Status and headers of a response, whose body is read piece by piece."""

    status: int
    headers: Sequence[tuple[bytes, bytes]]
    _reader: asyncio.StreamReader
    _connection: h11.Connection
    _count: int = field(default=0, init=False)

    async def read(self) -> bytes:
        """Returns the next piece of the body; empty: the end. Raises UpstreamError."""
        event = await _next_event(self._reader, self._connection)
        while isinstance(event, h11.Data) and not event.data:
            event = await _next_event(self._reader, self._connection)
        if isinstance(event, h11.EndOfMessage):
            return b""
        if not isinstance(event, h11.Data):
            raise UpstreamError("its response is broken")
        self._count += len(event.data)
        if self._count > MAX_BODY_BYTES:
            raise UpstreamError(f"its response has more than {MAX_BODY_BYTES >> 20} MB")
        return bytes(event.data)


class Upstream:
    """One request to a port of loopback, as an asynchronous context manager.

    port: of 127.0.0.1. target: path and query. headers: besides Host and Connection.
    """

    def __init__(self, port: int, target: str, headers: Sequence[tuple[bytes, bytes]]) -> None:
        self._port = port
        self._target = target
        self._headers = headers
        self._writer: asyncio.StreamWriter | None = None

    async def __aenter__(self) -> UpstreamResponse:
        """Sends the request and returns the head of the response. Raises UpstreamError."""
        try:
            return await self._ask()
        except BaseException:
            self._close()
            raise

    async def __aexit__(self, *_exception: object) -> None:
        """Closes the connection."""
        self._close()

    async def _ask(self) -> UpstreamResponse:
        connection = h11.Connection(h11.CLIENT)
        host = f"127.0.0.1:{self._port}".encode()
        named = [(b"Host", host), (b"Connection", b"close"), *self._headers]
        try:
            async with asyncio.timeout(_CONNECT_S):
                reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
            self._writer = writer
            head = connection.send(h11.Request(method="GET", target=self._target, headers=named))
            writer.write((head or b"") + (connection.send(h11.EndOfMessage()) or b""))
            await writer.drain()
        except (OSError, h11.LocalProtocolError) as error:
            raise UpstreamError(str(error) or "it does not answer") from None
        event = await _next_event(reader, connection)
        while isinstance(event, h11.InformationalResponse):
            event = await _next_event(reader, connection)
        if not isinstance(event, h11.Response):
            raise UpstreamError("its response is broken")
        return UpstreamResponse(event.status_code, list(event.headers), reader, connection)

    def _close(self) -> None:
        if self._writer is not None:
            with suppress(OSError):
                self._writer.transport.abort()


async def _next_event(reader: asyncio.StreamReader, connection: h11.Connection) -> object:
    try:
        while (event := connection.next_event()) is h11.NEED_DATA:
            async with asyncio.timeout(_PAUSE_S):
                connection.receive_data(await reader.read(_READ_BYTES))
    except TimeoutError:
        raise UpstreamError(f"it sends nothing for {_PAUSE_S:g} s") from None
    except (OSError, h11.RemoteProtocolError) as error:
        raise UpstreamError(f"its response is broken ({error})") from None
    return event
