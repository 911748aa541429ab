"""How the server answers."""

from __future__ import annotations

from starlette.responses import JSONResponse

from volery.core.errors import VoleryError


class RefusedError(VoleryError):
    """A request that is not fulfilled: HTTP status, and one sentence for people."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


def refused(status: int, message: str) -> JSONResponse:
    """`{"error": message}`."""
    return JSONResponse({"error": message}, status, headers={"Cache-Control": "no-store"})
