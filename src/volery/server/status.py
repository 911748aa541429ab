"""Route `./api/status`: the state of the server."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from volery.server.auth import Role
from volery.server.gallery import title_of
from volery.server.server_state import ServerActivity, ServerState


async def status(request: Request) -> Response:
    """Returns state, scenario and world; to a client without a token only that it needs one."""
    site: ServerState = request.app.state.site
    role: Role | None = request.state.role
    return JSONResponse(_status(site, role), headers={"Cache-Control": "no-store"})


def _status(site: ServerState, role: Role | None) -> dict[str, Any]:
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
