"""The page's server in a thread of its own, which outlives the worlds it shows.

with PageServer(PageSettings(port=8080)) as server:
    server.building("hover", "One F450 ...")
    with Simulation(load_scenario("hover")) as simulation, server.showing(simulation):
        simulation.run(speed=1.0)
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine, Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn

from volery.bridges.loop_thread import LoopThread
from volery.bridges.origins import Origins
from volery.bridges.rosbridge.message_budget import MAX_MESSAGE_BYTES
from volery.bridges.unsent import bound_unsent
from volery.core.errors import BridgeError
from volery.core.listener import Listener, Opening, open_listener
from volery.core.network_access import LOOPBACK
from volery.core.rare_log import RepeatFilter
from volery.core.waiting_room import look_at_http
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario
from volery.server.app import make_app
from volery.server.auth import check_rights
from volery.server.http_protocol import HEAD_TIMEOUT_S, http_protocol
from volery.server.server_state import ServerActivity, ServerSituation, ServerState, World
from volery.server.settings import PageSettings
from volery.server.websocket_protocol import PageWebSocket

_KEEPALIVE_S = 20.0
"""Between two pings, and how long an answer may take."""
_LONGEST_CALL_S = 30.0
"""Of the server's own work on a busy machine; nothing in it waits for a client longer."""

_REPEATS = RepeatFilter(bare=("Invalid UTF-8",))
"""Clients can cause uvicorn's warnings without end."""


class PageServer:
    """Serves the page. Use it as a context manager, or call `start` and `stop`.

    shelf: the scenarios of the cards; those that ship and the uploads unless it is given.
    """

    def __init__(self, settings: PageSettings, shelf: ScenarioCatalog | None = None) -> None:
        self._settings = settings
        self._site = ServerState(settings.recordings, shelf or ScenarioCatalog(settings.uploads))
        self._thread = LoopThread("volery-page")
        self._server: uvicorn.Server | None = None
        self._socket: Listener | None = None
        self._serving: asyncio.Task[None] | None = None

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._settings.port if self._socket is None else self._socket.getsockname()[1]

    @property
    def url(self) -> str:
        """What to open in a browser."""
        host = self._settings.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"

    # ---------------------------------------------------------------- for the owner, in his thread

    def start(self) -> None:
        """Begin to serve.

        Raises
        ------
        BridgeError
            The address is taken, not this machine's, or beyond loopback without consent and token.

        """
        settings = self._settings
        check_rights(settings.host, settings.tokens, anywhere=settings.anywhere)
        self._socket = _listen(settings.host, settings.port)
        app = make_app(
            self._site,
            tokens=settings.tokens,
            origins=Origins(settings.origins, token_needed=settings.tokens.needed),
            cookie=f"volery_{self.port}",
            only_loopback=settings.host in LOOPBACK,
        )
        logging.getLogger("uvicorn.error").addFilter(_REPEATS)
        self._server = uvicorn.Server(
            uvicorn.Config(
                app,
                http=http_protocol(self._socket),
                ws=PageWebSocket,
                ws_max_size=MAX_MESSAGE_BYTES,
                ws_ping_interval=_KEEPALIVE_S,
                ws_ping_timeout=_KEEPALIVE_S,
                ws_per_message_deflate=False,  # costs more time than loopback and LANs do
                lifespan="off",
                log_config=None,
                log_level="warning",
                access_log=False,
                server_header=False,
                timeout_graceful_shutdown=2,
            )
        )
        self._thread.start()
        self._call(self._begin(self._server, self._socket))

    def building(self, scenario: str, description: str = "", message: str = "") -> None:
        """Tell that a scenario is being built; `message`: what went wrong before."""
        self._leave(
            ServerSituation(ServerActivity.BUILDING, scenario, description.strip(), message)
        )

    @contextmanager
    def showing(self, world: World, message: str = "") -> Iterator[None]:
        """Let clients into a world, and send them out of it at the end.

        message: what went wrong before, such as that another world could not be built.
        """
        scenario: Scenario | None = getattr(world, "scenario", None)
        name: str | None = getattr(world, "name", None) if scenario is None else scenario.name
        if name is None:
            told = ServerSituation(
                ServerActivity.FAILED if message else ServerActivity.NO_WORLD, message=message
            )
        else:
            what = "A recorded log." if scenario is None else scenario.description.strip()
            told = ServerSituation(ServerActivity.FLYING, name, what, message)
        self._call(self._site.join(world, told))
        try:
            yield
        finally:
            self._leave(
                ServerSituation(ServerActivity.BUILDING, told.scenario, told.description, message)
            )

    def stop(self) -> None:
        """Let everybody go and end the thread; a second time nothing happens."""
        if self._thread.running:
            self._leave(ServerSituation(ServerActivity.NO_WORLD, message="the server ends"))
            if self._server is not None:
                self._server.should_exit = True
            self._call(self._end())
        elif self._socket is not None:
            self._socket.close()
        self._thread.end()

    def __enter__(self) -> PageServer:
        """Start it."""
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_exception: object) -> None:
        """Stop it."""
        self.stop()

    # ------------------------------------------------------------------------------- its own thread

    async def _begin(self, server: uvicorn.Server, listening: Listener) -> None:
        self._serving = asyncio.create_task(server.serve([listening]))
        while not server.started:
            if self._serving.done():
                self._serving.result()
                raise BridgeError("the page's server ended before it began")
            await asyncio.sleep(0.01)

    async def _end(self) -> None:
        if self._serving is not None:
            await asyncio.gather(self._serving, return_exceptions=True)

    def _leave(self, situation: ServerSituation) -> None:
        self._call(self._site.leave(situation))

    def _call(self, work: Coroutine[Any, Any, Any]) -> None:
        self._thread.call(work, _LONGEST_CALL_S)


def _listen(host: str, port: int) -> Listener:
    """A listening socket. `BridgeError` where there cannot be one."""
    try:
        opening = Opening(look_at_http, HEAD_TIMEOUT_S)
        listening = open_listener(host, port, "page", opening=opening)
        bound_unsent(listening)
        return listening
    except (OSError, OverflowError) as error:
        raise BridgeError(
            f"the page's server cannot listen on {host}:{port}: "
            f"{getattr(error, 'strerror', None) or error}; "
            "end the program that has the port, or choose another"
        ) from None
