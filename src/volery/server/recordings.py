"""`./api/recordings`: logs that were made here, to fetch, and logs that visitors bring."""

from __future__ import annotations

import asyncio
import re
import time
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from volery.bridges.logs.reader import summarize
from volery.core.errors import VoleryError
from volery.server.bodies import check_pilot, save_body
from volery.server.replies import RefusedError
from volery.server.site import Site

MOST_BYTES = 2_000_000_000
"""Of a log that somebody brings."""
_SUFFIXES = (".mcap", ".bag")
_NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9_. -]{0,99}\.(mcap|bag)$")
_WAITING = ".incoming_"
_STILL_S = 3.0
"""A log that was written to since then may be growing."""


async def recordings(request: Request) -> Response:
    """All logs of the folder, the newest first."""
    site: Site = request.app.state.site
    told = [] if site.recordings is None else await asyncio.to_thread(_listed, site.recordings)
    return JSONResponse(told, headers={"Cache-Control": "no-store"})


async def recording(request: Request) -> Response:
    """One log, to keep."""
    site: Site = request.app.state.site
    name: str = request.path_params["name"]
    found = None if site.recordings is None else site.recordings / name
    if found is None or not _NAME.match(name) or found.is_symlink() or not found.is_file():
        raise RefusedError(404, f"there is no recording '{name[:100]}'")
    return FileResponse(found, media_type="application/octet-stream", filename=name)


async def bring_recording(request: Request) -> Response:
    """Take a log, and look whether it is one."""
    check_pilot(request)
    site: Site = request.app.state.site
    folder = site.recordings
    if folder is None:
        raise RefusedError(409, "this server keeps no recordings; start it with --recordings")
    called = request.query_params.get("name", "")[:200]
    suffix = PurePosixPath(called.replace("\\", "/")).suffix.lower()
    if suffix not in _SUFFIXES:
        raise RefusedError(415, f"logs are read from {', '.join(_SUFFIXES)}, not '{suffix[:20]}'")
    folder.mkdir(parents=True, exist_ok=True)
    waiting = folder / f"{_WAITING}{id(request):x}{suffix}"
    try:
        await save_body(request, waiting, MOST_BYTES)
        try:
            found = await asyncio.to_thread(summarize, waiting)
        except VoleryError as error:
            raise RefusedError(422, str(error).replace(str(waiting), called)) from None
        if not found.messages:
            raise RefusedError(422, f"there is no message in it. {found.trouble}".strip())
        name = _free_name(folder, called, suffix)
        waiting.rename(folder / name)
    finally:
        waiting.unlink(missing_ok=True)
    return JSONResponse({"name": name}, 201)


def _listed(folder: Path) -> list[dict[str, Any]]:
    if not folder.is_dir():
        return []
    files = [path for path in folder.iterdir() if _NAME.match(path.name) and path.is_file()]
    files.sort(key=lambda path: path.stat().st_mtime_ns, reverse=True)
    return [_told(path) for path in files if not path.is_symlink()]


def _told(path: Path) -> dict[str, Any]:
    known = path.stat()
    written = time.time() - known.st_mtime < _STILL_S  # its end would have to be looked for
    seconds = None if written else _seconds(path, known.st_mtime_ns, known.st_size)
    kind = path.suffix[1:]
    return {"name": path.name, "bytes": known.st_size, "seconds": seconds, "kind": kind}


@lru_cache(maxsize=10_000)
def _seconds(path: Path, _changed_ns: int, _size: int) -> float | None:
    """How long a log is, as long as it stays as it is; None where it cannot be read."""
    try:
        return round(summarize(path).duration_s, 3)
    except (VoleryError, OSError):
        return None


def _free_name(folder: Path, called: str, suffix: str) -> str:
    """A name of our own that reminds of the client's."""
    stem = PurePosixPath(called.replace("\\", "/")).stem
    base = re.sub(r"[^A-Za-z0-9_-]+", "_", stem).strip("_-")[:60] or "log"
    number, name = 1, f"{base}{suffix}"
    while (folder / name).exists():
        number += 1
        name = f"{base}_{number}{suffix}"
    return name
