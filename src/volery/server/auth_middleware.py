"""Middleware before all routes: authentication, origin checks and security headers.

Sources: OWASP Cheat Sheets on cross-site request forgery (Origin and Sec-Fetch-Site) and on DNS
rebinding (Host); W3C, Content Security Policy Level 3.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from functools import partial
from http.cookies import CookieError, Morsel, SimpleCookie
from typing import NamedTuple
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from volery.bridges.origins import Origins
from volery.core.token_attempts import TokenAttempts
from volery.server.auth import Role, Sessions, Tokens
from volery.server.replies import RefusedError, refused

POLICY = (
    "default-src 'self'; script-src 'self'; worker-src 'self' blob:; "
    "img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; font-src 'self' data:; "
    "connect-src 'self' blob: data: ws: wss:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
"""Blobs carry the images of glTF readers; style-src is for the widgets' library; ws: lets the page
connect to a robot's own rosbridge.
"""
_HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_WRONG_TOKEN_S = 0.5
"""Delay after a wrong token, in addition to the turn (`TokenAttempts`)."""
_GONE_S = 0.2
"""Time for a refused WebSocket to close."""
_HARMLESS = {"GET", "HEAD", "OPTIONS"}
_GUARDED = ("/api/", "/rosbridge", "/tensorboard")
_FOR_ALL = "/api/status"


class _Visitor(NamedTuple):
    role: Role | None
    ticket: str | None
    """To be set as a cookie; None: the browser has one, or needs none."""


class AuthMiddleware:
    """ASGI middleware that authenticates clients; `scope["state"]` then holds the role.

    Parameters
    ----------
    app
        The application behind it.
    tokens, origins
        Accepted tokens and web origins.
    cookie
        Name of the session cookie; other servers of this machine have other names.
    only_loopback
        Whether the server is reachable under names of loopback only.

    """

    def __init__(
        self, app: ASGIApp, *, tokens: Tokens, origins: Origins, cookie: str, only_loopback: bool
    ) -> None:
        self._app = app
        self._tokens = tokens
        self._origins = origins
        self._cookie = cookie
        self._only_loopback = only_loopback
        self._sessions = Sessions()
        self._attempts = TokenAttempts()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        try:
            self._check_origin(scope, headers)
            visitor = await self._recognize(scope, headers, receive)
        except RefusedError as error:
            await _refuse(error, scope, receive, self._polite(send, None))
            return
        scope.setdefault("state", {})["role"] = visitor.role
        await self._app(scope, receive, self._polite(send, visitor.ticket))

    def _check_origin(self, scope: Scope, headers: Headers) -> None:
        """Refuses other sites' pages, and host names that only point to this machine."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if self._only_loopback and not self._origins.knows(host):
            raise RefusedError(
                421,
                f"this server is not called '{host[:80]}'; use localhost, or start it with "
                "--origin for a name of a reverse proxy",
            )
        foreign = headers.get("sec-fetch-site") in ("cross-site", "same-site")
        if scope["type"] == "http" and scope["method"] in _HARMLESS:
            if foreign and headers.get("sec-fetch-mode") != "navigate" and _in_query(scope):
                raise RefusedError(403, "pages of other sites may not send tokens")
            return
        if not self._origins.let_in(origin, host):
            raise RefusedError(403, f"pages of {origin} are refused; allow them with --origin")
        if origin is None and foreign:
            raise RefusedError(403, "pages of other sites are refused")

    async def _recognize(self, scope: Scope, headers: Headers, receive: Receive) -> _Visitor:
        """Returns role and ticket of a request.

        Raises RefusedError if a token is needed and missing or wrong.
        """
        if not self._tokens.needed:
            return _Visitor(Role.OPERATOR, None)
        given = _token_of(scope, headers)
        if given is not None:
            role = await self._role_of(given, scope, receive)
            if role is None:
                await asyncio.sleep(_WRONG_TOKEN_S)
                if scope["path"].startswith(_GUARDED):
                    raise RefusedError(401, "wrong token")
                return _Visitor(None, None)  # the page reports it and asks for another one
            return _Visitor(role, self._sessions.ticket(role))
        role = self._sessions.role_of(_cookie_of(headers, self._cookie))
        path = scope["path"]
        if role is None and path.startswith(_GUARDED) and path != _FOR_ALL:
            raise RefusedError(
                401, "a token is needed: ?token=, or the header Authorization: Bearer"
            )
        return _Visitor(role, None)

    async def _role_of(self, given: str, scope: Scope, receive: Receive) -> Role | None:
        """Returns the role of a token, after other attempts of the same address."""
        client: tuple[str, int] | None = scope.get("client")
        async with self._attempts.turn(client[0] if client else "?"):
            role = self._tokens.role_of(given)
            if role is None:
                # a WebSocket cannot be read before it is accepted
                gone = partial(_wait_for_end, receive) if scope["type"] == "http" else None
                await self._attempts.penalize(gone)
        return role

    def _polite(self, send: Send, ticket: str | None) -> Send:
        """Wraps `send` to add the headers and the session cookie."""

        async def polite(message: Message) -> None:
            kinds = ("http.response.start", "websocket.http.response.start", "websocket.accept")
            if message["type"] in kinds:
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
                if ticket is not None:
                    # Without a Path it is valid for the folder of the page, below any prefix.
                    cookie = f"{self._cookie}={ticket}; HttpOnly; SameSite=Strict"
                    headers.append("Set-Cookie", cookie)
            await send(message)

        return polite


async def _wait_for_end(receive: Receive) -> None:
    """Waits until the client has left; discards its data."""
    while (await receive())["type"] != "http.disconnect":
        pass


def _in_query(scope: Scope) -> str | None:
    """Returns the token in the URL."""
    query: str = scope["query_string"].decode("latin-1")
    given = parse_qs(query).get("token")
    return given[0] if given else None


def _token_of(scope: Scope, headers: Headers) -> str | None:
    given = _in_query(scope)
    if given is not None:
        return given
    scheme, _, bearer = headers.get("authorization", "").partition(" ")
    return bearer.strip() if scheme.lower() == "bearer" else None


def _cookie_of(headers: Headers, name: str) -> str | None:
    try:
        found: Morsel[str] | None = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return None
    return None if found is None else str(found.value)


async def _refuse(error: RefusedError, scope: Scope, receive: Receive, send: Send) -> None:
    response: Response = refused(error.status, str(error))
    if scope["type"] == "http":
        await response(scope, receive, send)
        return
    await WebSocket(scope, receive, send).send_denial_response(response)
    # uvicorn logs an error if this returns before the connection is closed
    with suppress(TimeoutError):
        async with asyncio.timeout(_GONE_S):
            while True:
                await receive()
