"""Route `POST ./api/uploads?kind=...&name=...`: turns a file into a scenario.

A map of map_server is a .yaml and its image: the body is the one after the other, `image` the name
of the second one and `head` the size of the first one, bytes.
"""

from __future__ import annotations

import asyncio
import re
import shutil
import tempfile
from pathlib import Path, PurePosixPath

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from volery.core.plain_text import plain
from volery.scenario import library
from volery.scenario.catalog import ScenarioCatalog
from volery.server.bounded_process import BoundedError, run_bounded
from volery.server.replies import RefusedError
from volery.server.request_bodies import check_operator, save_body
from volery.server.server_state import ServerState
from volery.server.uploads.kinds import (
    BOUNDS,
    MAP_SERVER,
    MAX_UPLOADS,
    image_suffix_of,
    kind_of_upload,
    suffix_of,
)

_MAX_CHARACTERS = 30
"""Max length of a scenario's name, before its number."""
_MAX_WORDS = 600
"""Max length of a message, characters."""


async def upload(request: Request) -> Response:
    """Stores a file, checks it by building its world, returns the name of its scenario."""
    check_operator(request)
    site: ServerState = request.app.state.site
    kind_name = request.query_params.get("kind", "")
    kind = kind_of_upload(kind_name)
    called = plain(request.query_params.get("name", "")[:200])
    suffix = suffix_of(called, kind)
    image = image_suffix_of(request.query_params.get("image", "")) if suffix == MAP_SERVER else ""
    folder = site.catalog.folder
    if folder is None:
        raise RefusedError(409, "this server accepts no uploads; start it with `volery serve`")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".upload_", dir=folder) as made:
        path = Path(made) / f"{kind_name}{suffix}"
        await save_body(request, path, kind.max_bytes)
        if image:
            _split(path, request.query_params.get("head", ""), path.with_suffix(image))
        lock: asyncio.Lock = request.app.state.upload_lock
        async with lock:  # one at a time
            if len(site.catalog.added()) >= MAX_UPLOADS:
                raise RefusedError(507, f"there are {MAX_UPLOADS} uploads already; remove some")
            name = name_for(called, site.catalog)
            await asyncio.to_thread(_check, kind_name, path, name, called)
            await asyncio.to_thread(shutil.copytree, made, folder / name)
    return JSONResponse({"scenario": name}, 201)


def _split(path: Path, head: str, image: Path) -> None:
    """Moves what follows the first `head` bytes of a file to the file of an image.

    Raises RefusedError if one of both is empty.
    """
    data = path.read_bytes()
    size = int(head) if head.isdecimal() and len(head) < 9 else 0
    if not 0 < size < len(data):
        raise RefusedError(400, "head is the size of the .yaml, before the bytes of its image")
    path.write_bytes(data[:size])
    image.write_bytes(data[size:])


def name_for(called: str, catalog: ScenarioCatalog) -> str:
    """Returns a free scenario name similar to the client's file name."""
    stem = PurePosixPath(called.replace("\\", "/")).stem.lower()
    words = re.sub(r"[^a-z0-9]+", "_", stem).strip("_")
    base = re.sub(r"^[^a-z]*", "", words)[:_MAX_CHARACTERS].strip("_") or "upload"
    taken = {*library.names(), *catalog.added()}
    names = (base if number == 1 else f"{base}_{number}" for number in range(1, MAX_UPLOADS + 100))
    return next(name for name in names if name not in taken)


def _check(kind: str, path: Path, name: str, called: str) -> None:
    """Builds the world in a separate process. Raises RefusedError with the file's problem."""
    try:
        result = run_bounded(f"{__package__}.validation", (kind, str(path), name, called), BOUNDS)
    except BoundedError as error:
        raise RefusedError(422, str(error)) from None
    if "error" in result:
        plain = str(result["error"]).replace(str(path), called).replace(str(path.parent), "")
        raise RefusedError(422, plain[:_MAX_WORDS])
