"""Route `./api/world.glb`: the geometry of the present world."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from volery.server.replies import RefusedError
from volery.server.server_state import ServerState
from volery.server.world_files import WorldFiles
from volery.world.trees.model import DetailLevel

_FOR_GOOD = "private, max-age=31536000, immutable"
"""For URLs with the id (`?world=`): another world has another URL."""
_TYPE = "model/gltf-binary"


async def world_glb(request: Request) -> Response:
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
        return Response(file.zipped, 200, {**headers, "Content-Encoding": "gzip"}, _TYPE)
    return Response(file.plain, 200, headers, _TYPE)


def _detail_of(text: str) -> DetailLevel:
    try:
        return DetailLevel(text)
    except ValueError:
        known = ", ".join(DetailLevel)
        raise RefusedError(400, f"detail must be one of {known}, not '{text[:40]}'") from None
