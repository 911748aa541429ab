"""Routes of the server."""

from __future__ import annotations

import asyncio

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Mount, Route, WebSocketRoute

from volery.bridges.origins import Origins
from volery.server.auth import Tokens
from volery.server.auth_middleware import AuthMiddleware
from volery.server.page import PageFiles, index
from volery.server.recordings import bring_recording, recording, recordings
from volery.server.replies import RefusedError, refused
from volery.server.rosbridge_route import serve_rosbridge
from volery.server.scenarios import card_image, scenarios
from volery.server.server_state import ServerState
from volery.server.status import status
from volery.server.tensorboard.route import TensorBoardRoute
from volery.server.uploads.route import upload
from volery.server.world_files import WorldFiles
from volery.server.world_route import world_glb


def make_app(
    site: ServerState, *, tokens: Tokens, origins: Origins, cookie: str, only_loopback: bool
) -> Starlette:
    """Returns the application; for the arguments after `site` see `AuthMiddleware`."""
    guard = Middleware(
        AuthMiddleware, tokens=tokens, origins=origins, cookie=cookie, only_loopback=only_loopback
    )
    tensorboard = TensorBoardRoute()
    app = Starlette(
        routes=[
            Route("/", index),
            Route("/index.html", index),
            Route("/api/status", status),
            Route("/api/world.glb", world_glb),
            Route("/api/scenarios", scenarios),
            Route("/api/scenarios/{name}.jpg", card_image),
            Route("/api/uploads", upload, methods=["POST"]),
            Route("/api/recordings", recordings, methods=["GET"]),
            Route("/api/recordings", bring_recording, methods=["POST"]),
            Route("/api/recordings/{name}", recording),
            WebSocketRoute("/rosbridge", serve_rosbridge),
            Route("/tensorboard", tensorboard),
            Route("/tensorboard/{path:path}", tensorboard),
            Mount("/", PageFiles()),
        ],
        middleware=[guard],
        exception_handlers={RefusedError: _respond_refusal, HTTPException: _respond_problem},
    )
    app.state.site = site
    app.state.world_files = WorldFiles()
    app.state.upload_lock = asyncio.Lock()
    return app


async def _respond_refusal(_request: Request, error: Exception) -> Response:
    assert isinstance(error, RefusedError)
    return refused(error.status, str(error))


async def _respond_problem(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    known = {404: f"nothing exists at {request.url.path[:200]}"}
    return refused(error.status_code, known.get(error.status_code, error.detail))
