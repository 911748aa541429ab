"""Route `./tensorboard/`: passes requests that only read on to TensorBoard.

TensorBoard's page reads some curves by POST, and everything by GET under `?tensorboardColab=true`.
The route adds this parameter and refuses other methods: it changes nothing, so viewers may use it.
"""

from __future__ import annotations

import asyncio
import re
from urllib.parse import parse_qsl, quote, urlencode

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import RedirectResponse
from starlette.types import Receive, Scope, Send

from volery.server.replies import RefusedError
from volery.server.server_state import ServerState
from volery.server.tensorboard.process import PREFIX
from volery.server.tensorboard.upstream import (
    MAX_BODY_BYTES,
    Upstream,
    UpstreamError,
    UpstreamResponse,
)

_PLUGINS = frozenset(
    {"audio", "custom_scalars", "distributions", "graphs", "histograms", "hparams", "images"}
    | {"mesh", "pr_curves", "scalars", "text", "timeseries"}
)
"""Plugins of TensorBoard that only read event files; installed ones may do anything by GET."""
_PATH = re.compile(r"[\w.,:=@-]+(/[\w.,:=@-]+)*", re.ASCII)
_REQUEST_HEADERS = ("accept", "accept-encoding", "if-none-match", "if-modified-since")
"""The rest stays here, above all cookies and tokens."""
_RESPONSE_HEADERS = frozenset(
    b"content-type content-encoding content-length content-disposition cache-control expires etag "
    b"last-modified vary".split()
)
_POLICY = (
    b"default-src 'self'; script-src 'self' 'unsafe-eval'; worker-src 'self' blob:; "
    b"img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; font-src 'self' data:; "
    b"connect-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; "
    b"frame-ancestors 'self'"
)
"""For TensorBoard's page, whose widgets compile templates."""
_GET_ONLY = "tensorboardColab"
_MAX_REQUESTS = 32
"""Requests at a time; a browser sends 6."""
_WHOLE_S = 600.0
"""Timeout of a whole response, for clients that read slowly."""


class TensorBoardRoute:
    """ASGI application of all addresses below `./tensorboard`."""

    def __init__(self) -> None:
        self._count = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Responds with what TensorBoard responds. Raises RefusedError."""
        request = Request(scope, receive)
        below: str | None = request.path_params.get("path")
        path = "" if below is None else f"/{below}"
        port = _check(request, path)
        if path in ("", "/") and request.query_params.get(_GET_ONLY) != "true":
            folder = "" if path else f"{PREFIX[1:]}/"
            home = RedirectResponse(f"{folder}?{_GET_ONLY}=true", 307)
            home.headers["Cache-Control"] = "no-store"
            await home(scope, receive, send)
            return
        if self._count >= _MAX_REQUESTS:
            raise RefusedError(503, "too many requests to TensorBoard at a time; try again")
        self._count += 1
        try:
            await _pass(port, _target(path, scope), Headers(scope=scope), send)
        finally:
            self._count -= 1


def _check(request: Request, path: str) -> int:
    """Returns TensorBoard's port. Raises RefusedError for what is not there or not allowed."""
    site: ServerState = request.app.state.site
    if site.tensorboard is None:
        raise RefusedError(404, "there is no TensorBoard; start the server with --tensorboard DIR")
    if request.method != "GET":
        raise RefusedError(405, "TensorBoard is for looking: GET only")
    parts = path[1:].split("/")
    plugins = {name for name, after in zip(parts[1:], parts, strict=False) if after == "plugin"}
    if (path not in ("", "/") and not _PATH.fullmatch(path[1:])) or ".." in parts:
        raise RefusedError(404, f"nothing exists at {request.url.path[:200]}")
    if not plugins <= _PLUGINS:
        raise RefusedError(403, f"the page serves TensorBoard's own plugins {sorted(_PLUGINS)}")
    port = site.tensorboard.port
    if port is None:
        raise RefusedError(502, "TensorBoard has ended; start the server again")
    return port


def _target(path: str, scope: Scope) -> str:
    """Returns path and query for TensorBoard, without a token."""
    query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
    kept = urlencode([(name, value) for name, value in query if name != "token"])
    return f"{PREFIX}{quote(path, safe='/,:=@')}{f'?{kept}' if kept else ''}"


async def _pass(port: int, target: str, asked: Headers, send: Send) -> None:
    """Sends TensorBoard's response piece by piece; breaks it off if its end does not arrive."""
    named = [name for name in _REQUEST_HEADERS if name in asked]
    headers = [(name.encode(), asked[name].encode("latin-1")) for name in named]
    begun = False
    try:
        async with asyncio.timeout(_WHOLE_S), Upstream(port, target, headers) as response:
            start = _start(response)
            piece = await response.read()
            begun = True
            await send(start)
            while piece:
                await send({"type": "http.response.body", "body": piece, "more_body": True})
                piece = await response.read()
            await send({"type": "http.response.body", "body": b""})
    except (UpstreamError, TimeoutError) as error:
        if not begun:
            why = str(error) or "it takes too long"
            raise RefusedError(502, f"TensorBoard does not answer: {why}") from None
        # a response without its end: uvicorn closes the connection, so the client sees the break


def _start(response: UpstreamResponse) -> dict[str, object]:
    """Returns the start of the response. Raises UpstreamError for one that is too long."""
    kept = [(name, value) for name, value in response.headers if name in _RESPONSE_HEADERS]
    named = dict(kept)
    length = named.get(b"content-length", b"0")
    if int(length) > MAX_BODY_BYTES:
        raise UpstreamError(f"its response has more than {MAX_BODY_BYTES >> 20} MB")
    if b"cache-control" not in named:
        kept.append((b"cache-control", b"no-store"))
    if named.get(b"content-type", b"").startswith(b"text/html"):
        kept.append((b"content-security-policy", _POLICY))
    return {"type": "http.response.start", "status": response.status, "headers": kept}
