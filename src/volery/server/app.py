"""Routes of the server; those of its state and of the present world are here."""

from __future__ import annotations

import asyncio
from importlib.metadata import version
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute

from volery.bridges.origins import Origins
from volery.server.auth import Role, Tokens
from volery.server.auth_middleware import AuthMiddleware
from volery.server.gallery import title_of
from volery.server.page import PageFiles, index
from volery.server.recordings import bring_recording, recording, recordings
from volery.server.replies import RefusedError, refused
from volery.server.rosbridge_route import serve_rosbridge
from volery.server.scenarios import card_image, scenarios
from volery.server.server_state import ServerActivity, ServerState
from volery.server.tensorboard.route import TensorBoardRoute
from volery.server.uploads.route import upload
from volery.server.world_files import WorldFiles
from volery.world.trees.model import DetailLevel

_FOR_GOOD = "private, max-age=31536000, immutable"
"""For URLs with the id (`?world=`): another world has another URL."""
_GLB_TYPE = "model/gltf-binary"


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
            Route("/api/status", _status),
            Route("/api/world.glb", _world_glb),
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


async def _status(request: Request) -> Response:
    """Returns state, scenario and world; to a client without a token only that it needs one."""
    site: ServerState = request.app.state.site
    role: Role | None = request.state.role
    return JSONResponse(_state_for(site, role), headers={"Cache-Control": "no-store"})


def _state_for(site: ServerState, role: Role | None) -> dict[str, Any]:
    common: dict[str, Any] = {
        "version": version("volery"),
        "role": role,
        "token_needed": role is None,
    }
    if role is None:
        nothing = {"state": None, "scenario": None, "description": "", "message": "", "world": None}
        return nothing | {"title": "", "tensorboard": False, "unasked": False} | common
    now, world = site.situation, site.world
    geometry = None if world is None else world.geometry
    return {
        "state": ServerActivity.ENDED if world is not None and world.has_ended else now.state,
        "scenario": now.scenario,
        "title": title_of(now.scenario or ""),
        "description": now.description,
        "message": now.message,
        "world": None if geometry is None else geometry.id,
        "tensorboard": site.tensorboard is not None,
        "unasked": site.unasked,
        **common,
    }


async def _world_glb(request: Request) -> Response:
    """Returns the geometry, or 304 if the browser has it; `?detail=` is that of the trees."""
    site: ServerState = request.app.state.site
    files: WorldFiles = request.app.state.world_files
    detail = _detail_of(request.query_params.get("detail", DetailLevel.SENSING))
    scenario = None if site.world is None else site.world.scenario
    geometry = None if site.world is None else site.world.geometry
    if scenario is None or geometry is None:
        raise RefusedError(404, "no world is loaded")
    zips = "gzip" in request.headers.get("accept-encoding", "")
    tag = f'"{geometry.id}-{detail}{"-gz" if zips else ""}"'
    named = request.query_params.get("world") == geometry.id
    kept = _FOR_GOOD if named else "no-cache"
    headers = {"ETag": tag, "Cache-Control": kept, "Vary": "Accept-Encoding"}
    if tag in request.headers.get("if-none-match", ""):
        return Response(None, 304, headers)
    file = await files.get(scenario, geometry, detail)
    if zips:
        return Response(file.zipped, 200, {**headers, "Content-Encoding": "gzip"}, _GLB_TYPE)
    return Response(file.plain, 200, headers, _GLB_TYPE)


def _detail_of(text: str) -> DetailLevel:
    try:
        return DetailLevel(text)
    except ValueError:
        known = ", ".join(DetailLevel)
        raise RefusedError(400, f"detail must be one of {known}, not '{text[:40]}'") from None


async def _respond_refusal(_request: Request, error: Exception) -> Response:
    assert isinstance(error, RefusedError)
    return refused(error.status, str(error))


async def _respond_problem(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    known = {404: f"nothing exists at {request.url.path[:200]}"}
    return refused(error.status_code, known.get(error.status_code, error.detail))
