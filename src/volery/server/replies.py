"""Error responses of the server."""

from __future__ import annotations

from starlette.responses import JSONResponse

from volery.core.errors import VoleryError


class RefusedError(VoleryError):
    """A refused request: HTTP status, and one sentence for users."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


def refused(status: int, message: str) -> JSONResponse:
    """Returns the response `{"error": message}`."""
    return JSONResponse({"error": message}, status, headers={"Cache-Control": "no-store"})
