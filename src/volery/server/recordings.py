"""Route `./api/recordings`: downloads recorded logs and uploads others."""

from __future__ import annotations

import asyncio
import re
import threading
import time
from collections import OrderedDict
from pathlib import Path, PurePosixPath
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from volery.bridges.logs.recordings_quota import room_left
from volery.core.errors import RecordingError
from volery.core.plain_text import plain
from volery.server.log_check import look_into
from volery.server.replies import RefusedError
from volery.server.request_bodies import check_operator, save_body
from volery.server.server_state import ServerState

MAX_BYTES = 2_000_000_000
"""Max size of an uploaded log."""
_SUFFIXES = (".mcap", ".bag")
_NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9_. -]{0,99}\.(mcap|bag)$")
_WAITING = ".incoming_"
_STILL_S = 3.0
"""A log changed within this time may still grow."""
_MAX_KNOWN = 10_000


async def recordings(request: Request) -> Response:
    """Returns all logs of the folder, newest first."""
    site: ServerState = request.app.state.site
    listed = [] if site.recordings is None else await asyncio.to_thread(_listed, site.recordings)
    return JSONResponse(listed, headers={"Cache-Control": "no-store"})


async def recording(request: Request) -> Response:
    """Returns one log as a download."""
    site: ServerState = request.app.state.site
    name: str = request.path_params["name"]
    found = None if site.recordings is None else site.recordings / name
    if found is None or not _NAME.match(name) or found.is_symlink() or not found.is_file():
        raise RefusedError(404, f"there is no recording '{name[:100]}'")
    return FileResponse(found, media_type="application/octet-stream", filename=name)


async def bring_recording(request: Request) -> Response:
    """Stores an uploaded log after a check."""
    check_operator(request)
    site: ServerState = request.app.state.site
    folder = site.recordings
    if folder is None:
        raise RefusedError(409, "this server stores no recordings; start it with --recordings-dir")
    called = plain(request.query_params.get("name", "")[:200])
    suffix = PurePosixPath(called.replace("\\", "/")).suffix.lower()
    if suffix not in _SUFFIXES:
        raise RefusedError(415, f"logs are read from {', '.join(_SUFFIXES)}, not '{suffix[:20]}'")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        max_bytes = min(MAX_BYTES, await asyncio.to_thread(room_left, folder))
    except RecordingError as error:
        raise RefusedError(507, str(error)) from None
    waiting = folder / f"{_WAITING}{id(request):x}{suffix}"
    try:
        await save_body(request, waiting, max_bytes)
        lock: asyncio.Lock = request.app.state.upload_lock
        async with lock:  # one at a time
            (found,) = await asyncio.to_thread(look_into, [waiting], play=True)
        if "error" in found:
            raise RefusedError(422, found["error"].replace(str(waiting), called))
        if not found["messages"]:
            raise RefusedError(422, f"the log holds no messages. {found['problem']}".strip())
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
    files = [path for path in files if not path.is_symlink()]
    _durations.learn(files)
    return [_describe(path) for path in files]


def _describe(path: Path) -> dict[str, Any]:
    size, seconds = path.stat().st_size, _durations.of(path)
    return {"name": path.name, "bytes": size, "seconds": seconds, "kind": path.suffix[1:]}


class _Durations:
    """Caches the durations of logs until the files change."""

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[Path, int, int], float | None] = OrderedDict()
        self._looking = threading.Lock()

    def of(self, path: Path) -> float | None:
        """Returns seconds; None if the log cannot be read, grows, or is being read."""
        return self._known.get(_version(path))

    def learn(self, paths: list[Path]) -> None:
        """Reads new logs, unless another request does."""
        if not self._looking.acquire(blocking=False):
            return
        try:
            fresh = [(path, _version(path)) for path in paths if not _may_be_growing(path)]
            fresh = [(path, version) for path, version in fresh if version not in self._known]
            found = look_into([path for path, _ in fresh])
            for (_, version), result in zip(fresh, found, strict=True):
                self._known[version] = result.get("seconds")
            while len(self._known) > _MAX_KNOWN:
                self._known.popitem(last=False)
        finally:
            self._looking.release()


def _version(path: Path) -> tuple[Path, int, int]:
    known = path.stat()
    return path, known.st_mtime_ns, known.st_size


def _may_be_growing(path: Path) -> bool:
    """Returns whether a log has just changed: its end would have to be searched for.

    A time far ahead is that of a clock that has been set back since.
    """
    return abs(time.time() - path.stat().st_mtime) < _STILL_S


_durations = _Durations()


def _free_name(folder: Path, called: str, suffix: str) -> str:
    """Returns a safe, unused name similar to the client's."""
    stem = PurePosixPath(called.replace("\\", "/")).stem
    base = re.sub(r"[^A-Za-z0-9_-]+", "_", stem).strip("_-")[:60] or "log"
    number, name = 1, f"{base}{suffix}"
    while (folder / name).exists():
        number += 1
        name = f"{base}_{number}{suffix}"
    return name
