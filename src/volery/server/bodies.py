"""Bodies of requests: written to a file as they come, and no more of them than allowed."""

from __future__ import annotations

from pathlib import Path

from starlette.requests import ClientDisconnect, Request

from volery.server.replies import RefusedError
from volery.server.rights import Role


async def save_body(request: Request, path: Path, most_bytes: int) -> int:
    """Write the body of a request to `path`; the number of bytes.

    Raises `RefusedError` where there are none, or more than `most_bytes`; what was written stays.
    """
    too_large = RefusedError(413, f"more than {_size(most_bytes)}; that is the most taken here")
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced) > most_bytes:
        raise too_large
    size = 0
    with path.open("xb") as file:
        try:
            async for chunk in request.stream():
                size += len(chunk)
                if size > most_bytes:
                    raise too_large
                file.write(chunk)
        except ClientDisconnect:
            raise RefusedError(400, "the file did not come whole") from None
    if not size:
        raise RefusedError(400, "the file is empty")
    return size


def check_pilot(request: Request) -> None:
    """`RefusedError` for a viewer: what is brought here changes something."""
    if request.state.role is not Role.PILOT:
        raise RefusedError(403, "a viewer may not bring files; show the pilots' token")


def _size(count: int) -> str:
    return f"{count / 1e6:g} MB"
