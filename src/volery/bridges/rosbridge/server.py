"""rosbridge v2 server: a bridge for roslib, roslibpy, Foxglove, ROS# and web pages."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from functools import partial
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit
from weakref import WeakSet

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from volery.bridges.origins import Origins
from volery.bridges.rosbridge.access_policy import AccessPolicy
from volery.bridges.rosbridge.fair_queue import FairQueue
from volery.bridges.rosbridge.first_message import GuardedConnection, guarded
from volery.bridges.rosbridge.message_budget import MAX_MESSAGE_BYTES
from volery.bridges.rosbridge.message_encoder import Generation, MessageEncoder
from volery.bridges.rosbridge.protocol import RosbridgePeer, ServerContext
from volery.bridges.rosbridge.rosapi import RosApi
from volery.bridges.rosbridge.rosapi_parameters import Parameters
from volery.bridges.rosbridge.tf_republisher import TfRepublisher
from volery.bridges.rosbridge.token_check import TokenCheck
from volery.bridges.rosbridge.websocket_session import Bell, converse, post_to
from volery.bridges.rosbridge.wire import CBOR_PROTOCOL
from volery.bridges.unsent import bound_unsent
from volery.core.errors import BridgeError
from volery.core.listener import UNIX, Listener, Opening, open_listener
from volery.core.network_access import LOOPBACK, check_address, check_token, shows_token, tend
from volery.core.pending_connections import look_at_http
from volery.core.rare_log import RepeatFilter
from volery.core.token_attempts import TokenAttempts
from volery.graph.session import Gateway

_log = logging.getLogger(__name__)
_handshakes = logging.getLogger(f"{__name__}.handshakes")
_handshakes.addFilter(RepeatFilter(bare=("opening handshake failed",)))
"""Logger of `websockets`, in which clients can cause any number of warnings."""

DEFAULT_PORT = 9090
MAX_CLIENTS = 1000
HANDSHAKE_TIMEOUT_S = 10.0
"""Timeout of a WebSocket's request, including the wait for the check of its token."""
_ONCE = ("Host", "Origin", "Authorization")
"""Headers that identify a request's origin; a repeated one is ambiguous."""


_FOXGLOVE = "foxglove."
_USE_ROSBRIDGE = (
    "this is rosbridge: choose the connection 'Rosbridge' in place of 'Foxglove WebSocket'"
)


class RosbridgeServer:
    """Serves clients of the graph over WebSocket.

    Clients of the port control the UAVs. So the server listens on loopback unless `anywhere` is
    set, and then requires a token: as `{"op": "auth", "token": ...}` (also what roslib's
    `authenticate` sends as `mac`), as `?token=` in the URL, or in the header
    `Authorization: Bearer`.

    A web page of another site, open in a browser on this machine, can connect to loopback too.
    Browsers send the page's origin, and only pages from localhost, from the server's own address,
    and from `origins` are accepted. Programs without an origin are accepted.

    A client that does not read loses its own messages; it does not delay others, and the server
    disconnects it when it answers no pings, or reads nothing for a minute.

    Parameters
    ----------
    host, port
        Listening address; port 0 takes a free port, see `port`. `unix:PATH` is a Unix-domain
        socket, which only programs that may open the path can reach.
    path
        The only path served, such as `/rosbridge`; None: every path.
    token
        Token that clients must send; needed beyond loopback.
    anywhere
        Allows listening beyond loopback.
    max_message_bytes
        Largest message accepted from a client.
    generation
        Spelling and serialization for clients: `ros1` has `secs` and `nsecs`, types as
        `std_msgs/String` and ROS 1 bytes in CBOR-RAW, `ros2` has `sec` and `nanosec`,
        `std_msgs/msg/String` and CDR. Both are always accepted.
    origins
        Further accepted web origins, such as `https://studio.example.org`.
    keepalive_s
        Time between two pings, and timeout of an answer; None: no pings.
    gate
        Makes the access policy of a new client; None: no restrictions.

    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        path: str | None = None,
        token: str | None = None,
        anywhere: bool = False,
        max_message_bytes: int = MAX_MESSAGE_BYTES,
        generation: Generation = "ros2",
        origins: Sequence[str] = (),
        keepalive_s: float | None = 20.0,
        parameters: Parameters | None = None,
        gate: Callable[[], AccessPolicy] | None = None,
    ) -> None:
        self.host = host
        self.port = port
        self._path = path
        self._token = token or None
        self._anywhere = anywhere
        self._max_bytes = max_message_bytes
        self._generation: Generation = generation
        self._origins = Origins(origins, token_needed=bool(token))
        self._keepalive_s = keepalive_s
        self._parameters = parameters
        self._gate = gate
        self._server: Server | None = None
        self._listener: Listener | None = None
        self._attempts = TokenAttempts()
        self._refused_foxglove = False
        """Whether that has been logged, which happens once."""
        self._rosapi: RosApi | None = None
        self._transforms: TfRepublisher | None = None
        self._clients: set[ServerConnection] = set()
        self._shown: WeakSet[ServerConnection] = WeakSet()
        """Clients whose request for a connection carried the token."""
        self._gateway: Gateway | None = None
        self._shared = ServerContext()
        self._queue = FairQueue()

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        if self._is_local:
            return f"rosbridge {self.host}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"rosbridge ws://{host}:{self.port}{self._path or ''}"

    @property
    def _is_local(self) -> bool:
        """Whether it listens on a Unix-domain socket."""
        return self.host.startswith(UNIX)

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    async def start(self, gateway: Gateway) -> None:
        """Starts the server.

        Raises
        ------
        BridgeError
            The address is taken, not this machine's, or beyond loopback without consent and token.

        """
        if not self._is_local:
            check_address(self.host, anywhere=self._anywhere, flag="--allow-remote and --token")
            check_token(self.host, self._token)
        graph = gateway.graph
        self._gateway = gateway
        self._shared = ServerContext(
            MessageEncoder(self._generation), graph.now_ns, self._token, self._max_bytes
        )
        try:
            opening = Opening(look_at_http, HANDSHAKE_TIMEOUT_S)
            self._listener = open_listener(self.host, self.port, "rosbridge", opening=opening)
            self._server = await serve(
                self._serve,
                sock=self._listener,
                open_timeout=HANDSHAKE_TIMEOUT_S,
                logger=_handshakes,
                process_request=self._check_request,
                select_subprotocol=_select_subprotocol,
                compression=None,  # compression would cost more time than loopback and LANs do
                max_size=self._max_bytes,
                max_queue=1,  # waiting messages may be as large
                create_connection=guarded(self._token, self._max_bytes),
                ping_interval=self._keepalive_s,
                ping_timeout=self._keepalive_s,
                close_timeout=1.0,
            )
        except OSError as error:
            raise BridgeError(
                f"rosbridge cannot listen on {self.host}:{self.port}: {error.strerror or error}; "
                f"end the program that has the port, or choose another: --bridge rosbridge=PORT"
            ) from None
        if not self._is_local:
            self.port = next(iter(self._server.sockets)).getsockname()[1]
        self._rosapi = RosApi(gateway, self._generation, graph.now_ns, self._parameters)
        self._rosapi.start()
        self._transforms = TfRepublisher(gateway)
        self._transforms.start()

    async def stop(self) -> None:
        """Disconnects all clients."""
        if self._rosapi is not None:
            self._rosapi.stop()
            self._rosapi = None
        if self._transforms is not None:
            self._transforms.stop()
            self._transforms = None
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()
            self._server = None

    # ---------------------------------------------------------------------------------- access

    async def _check_request(
        self, connection: ServerConnection, request: Request
    ) -> Response | None:
        """Refuses unauthorized requests before they are connected."""
        url = urlsplit(request.path)
        if self._path is not None and url.path.rstrip("/") != self._path.rstrip("/"):
            return connection.respond(HTTPStatus.NOT_FOUND, f"rosbridge is at {self._path}\n")
        for name in _ONCE:
            if len(request.headers.get_all(name)) > 1:
                return connection.respond(
                    HTTPStatus.BAD_REQUEST, f"{name} is given more than once\n"
                )
        foreign = self._foreign_protocol(connection, request)
        foreign = foreign or self._foreign_page(connection, request)
        if foreign is not None:
            return foreign
        given = parse_qs(url.query).get("token", [None])[0]
        scheme, _, bearer = request.headers.get("Authorization", "").partition(" ")
        if given is None and scheme.lower() == "bearer":
            given = bearer.strip()
        if given is not None and not await self._is_token(given, connection):
            return connection.respond(HTTPStatus.UNAUTHORIZED, "wrong token\n")
        if len(self._clients) >= MAX_CLIENTS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many clients\n")
        if given is not None:
            self._shown.add(connection)
            _allow(connection)
        return None

    def _foreign_protocol(self, connection: ServerConnection, request: Request) -> Response | None:
        """Returns the refusal of a client of Foxglove's protocol, which would receive nothing."""
        offered = ",".join(request.headers.get_all("Sec-WebSocket-Protocol")).split(",")
        if not any(name.strip().startswith(_FOXGLOVE) for name in offered):
            return None
        if not self._refused_foxglove:
            self._refused_foxglove = True
            _log.warning("a Foxglove client was refused: %s", _USE_ROSBRIDGE)
        return connection.respond(HTTPStatus.BAD_REQUEST, f"{_USE_ROSBRIDGE}\n")

    def _foreign_page(self, connection: ServerConnection, request: Request) -> Response | None:
        """Returns the refusal of another site's page; None: the request is not of such a page."""
        origin, host = request.headers.get("Origin"), request.headers.get("Host", "")
        if self.host in LOOPBACK and not self._origins.knows(host):
            return connection.respond(
                HTTPStatus.MISDIRECTED_REQUEST,
                f"this server is not called '{host[:80]}'; use localhost, or start it with "
                "--origin for a name of a reverse proxy\n",
            )
        if not self._origins.let_in(origin, host):
            return connection.respond(
                HTTPStatus.FORBIDDEN,
                f"pages of {origin} are not accepted; start with --origin {origin}\n",
            )
        return None

    async def _is_token(self, given: str, connection: ServerConnection) -> bool:
        """Returns whether this is the token; attempts of one address are checked in turn."""
        async with self._attempts.turn(_address_of(connection)):
            is_right = shows_token(given, self._token)
            if not is_right:
                await self._attempts.penalize(connection.wait_closed)
        return is_right

    def _prove(self, connection: ServerConnection) -> None:
        if self._listener is not None:
            self._listener.prove(connection.transport)

    # -------------------------------------------------------------------------------- one client

    async def _serve(self, connection: ServerConnection) -> None:
        assert self._gateway is not None
        assert isinstance(connection, GuardedConnection)
        loop = asyncio.get_running_loop()
        address = connection.remote_address or ("?", 0)
        for sent in (connection.request, connection.response):
            if sent is not None:
                sent.headers.clear()  # dozens of objects that have served
        sock = connection.transport.get_extra_info("socket")
        tend(sock)
        bound_unsent(sock)
        session = self._gateway.open(f"rosbridge {address[0]}:{address[1]}")
        bell = Bell(loop)
        peer = RosbridgePeer(
            session,
            self._shared,
            wake=bell.ring,
            post=post_to(loop),
            authorized=connection in self._shown,
            gate=None if self._gate is None else self._gate(),
        )
        peer.on_authorized = lambda: _allow(connection)
        self._clients.add(connection)
        prove = partial(self._prove, connection)
        checkpoint = TokenCheck(
            self._attempts, _address_of(connection), connection.wait_closed, prove
        )
        if peer.authorized:
            prove()
        try:
            problem = await converse(connection, bell, peer, self._queue, checkpoint)
        finally:
            self._clients.discard(connection)
        if problem is not None and not isinstance(problem, ConnectionClosed):
            _log.error("serving %s failed", session.name, exc_info=problem)


def _address_of(connection: ServerConnection) -> str:
    return str((connection.remote_address or ("?",))[0])


def _allow(connection: ServerConnection) -> None:
    """Accepts large messages: the client has sent the token."""
    if isinstance(connection, GuardedConnection):
        connection.allow()


def _select_subprotocol(_connection: ServerConnection, offered: Sequence[Any]) -> Any:
    return CBOR_PROTOCOL if CBOR_PROTOCOL in offered else None
