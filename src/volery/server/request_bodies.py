"""Writes request bodies to files, with limits on size and time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from pathlib import Path

from starlette.requests import ClientDisconnect, Request

from volery.core.errors import reason_of
from volery.server.auth import Role
from volery.server.replies import RefusedError

LONGEST_PAUSE_S = 30.0
"""Max time between two pieces of a body (modelling choice)."""
MIN_BYTES_S = 1000.0
"""Min average rate of a body, after the first such time (modelling choice)."""


async def save_body(request: Request, path: Path, max_bytes: int) -> int:
    """Writes the body of a request to `path`; returns the number of bytes.

    Raises RefusedError if it is empty, larger than `max_bytes`, or too slow; the written part
    remains.
    """
    too_large = RefusedError(413, f"the file is larger than the limit of {_size(max_bytes)}")
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced) > max_bytes:
        raise too_large
    size = 0
    with path.open("xb") as file:
        try:
            async for chunk in _pieces_in_time(request):
                size += len(chunk)
                if size > max_bytes:
                    raise too_large
                file.write(chunk)
        except OSError as error:
            raise RefusedError(507, f"the file cannot be saved: {reason_of(error)}") from None
        except ClientDisconnect:
            raise RefusedError(400, "the upload was interrupted") from None
    if not size:
        raise RefusedError(400, "the file is empty")
    return size


async def _pieces_in_time(request: Request) -> AsyncIterator[bytes]:
    """Yields the pieces of a body. Raises RefusedError for a client that sends too slowly."""
    pieces, size, began_s = aiter(request.stream()), 0, time.monotonic()
    while True:
        try:
            async with asyncio.timeout(LONGEST_PAUSE_S):
                piece = await anext(pieces, None)
        except TimeoutError:
            raise RefusedError(408, f"no data received for {LONGEST_PAUSE_S:g} s") from None
        if piece is None:
            return
        yield piece
        size += len(piece)
        elapsed_s = time.monotonic() - began_s
        if elapsed_s > LONGEST_PAUSE_S and size < MIN_BYTES_S * elapsed_s:
            raise RefusedError(408, f"the upload is slower than {MIN_BYTES_S:g} bytes/s")


def check_operator(request: Request) -> None:
    """Raises RefusedError for a viewer: uploads change the server."""
    if request.state.role is not Role.OPERATOR:
        raise RefusedError(403, "a viewer may not upload files; use the operators' token")


def _size(count: int) -> str:
    return f"{count / 1e6:g} MB"
