"""The page's server in its own thread; it continues to run when the world changes.

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
from volery.core.pending_connections import look_at_http
from volery.core.rare_log import RepeatFilter
from volery.scenario.catalog import ScenarioCatalog
from volery.server.app import make_app
from volery.server.auth import check_rights
from volery.server.http_protocol import HEAD_TIMEOUT_S, http_protocol
from volery.server.server_state import ServerActivity, ServerSituation, ServerState, World
from volery.server.settings import PageSettings
from volery.server.tensorboard.process import TensorBoardProcess, tensorboard_command
from volery.server.websocket_protocol import PageWebSocket

_KEEPALIVE_S = 20.0
"""Period of pings, and timeout of their responses."""
_LONGEST_CALL_S = 30.0
"""Timeout of the server's own work on a busy machine; it waits for no client longer."""

_REPEATS = RepeatFilter(bare=("Invalid UTF-8",))
"""Clients can cause uvicorn's warnings without limit."""


class PageServer:
    """Serves the page. Use it as a context manager, or call `start` and `stop`.

    catalog: the scenarios of the cards; default: shipped ones and uploads.
    """

    def __init__(self, settings: PageSettings, catalog: ScenarioCatalog | None = None) -> None:
        self._settings = settings
        self._site = ServerState(settings.recordings, catalog or ScenarioCatalog(settings.uploads))
        self._site.unasked = settings.unasked
        self._thread = LoopThread("volery-page")
        self._server: uvicorn.Server | None = None
        self._socket: Listener | None = None
        self._serving: asyncio.Task[None] | None = None

    @property
    def port(self) -> int:
        """Port of the server."""
        return self._settings.port if self._socket is None else self._socket.getsockname()[1]

    @property
    def url(self) -> str:
        """URL of the page."""
        host = self._settings.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"

    # ----------------------------------------------------------------- called by the owner's thread

    def start(self) -> None:
        """Starts to serve.

        Raises
        ------
        BridgeError
            The address is in use, not this machine's, or beyond loopback without permission and
            token.
        VoleryError
            TensorBoard is asked for and cannot be started.

        """
        settings = self._settings
        check_rights(settings.host, settings.tokens, anywhere=settings.anywhere)
        folder = settings.tensorboard
        command = None if folder is None else tensorboard_command(folder)
        self._socket = _listen(settings.host, settings.port)
        if command is not None:
            self._site.tensorboard = TensorBoardProcess(command)
            self._site.tensorboard.start()
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
        """Reports that a scenario is being built; `message`: an earlier error."""
        self._leave(
            ServerSituation(ServerActivity.BUILDING, scenario, description.strip(), message)
        )

    @contextmanager
    def showing(self, world: World, message: str = "", log: str = "") -> Iterator[None]:
        """Connects clients to a world, and disconnects them at the end.

        message: an earlier error, such as that another world could not be built. log: name of the
        log that is played.
        """
        scenario = world.scenario
        name = log if scenario is None else scenario.name
        if not name:
            situation = ServerSituation(
                ServerActivity.FAILED if message else ServerActivity.NO_WORLD, message=message
            )
        else:
            what = "A recorded log." if scenario is None else scenario.description.strip()
            situation = ServerSituation(ServerActivity.FLYING, name, what, message)
        self._call(self._site.join(world, situation))
        try:
            yield
        finally:
            self._leave(
                ServerSituation(
                    ServerActivity.BUILDING, situation.scenario, situation.description, message
                )
            )

    def stop(self) -> None:
        """Disconnects all clients and ends the thread; further calls have no effect."""
        if self._thread.running:
            self._leave(ServerSituation(ServerActivity.NO_WORLD, message="the server ends"))
            if self._server is not None:
                self._server.should_exit = True
            self._call(self._end())
        elif self._socket is not None:
            self._socket.close()
        self._thread.end()
        if self._site.tensorboard is not None:
            self._site.tensorboard.stop()

    def __enter__(self) -> PageServer:
        """Starts the server."""
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_exception: object) -> None:
        """Stops the server."""
        self.stop()

    # ---------------------------------------------------------------------- in the server's thread

    async def _begin(self, server: uvicorn.Server, listening: Listener) -> None:
        self._serving = asyncio.create_task(server.serve([listening]))
        while not server.started:
            if self._serving.done():
                self._serving.result()
                raise BridgeError("the page's server ended during its start")
            await asyncio.sleep(0.01)

    async def _end(self) -> None:
        if self._serving is not None:
            await asyncio.gather(self._serving, return_exceptions=True)

    def _leave(self, situation: ServerSituation) -> None:
        self._call(self._site.leave(situation))

    def _call(self, work: Coroutine[Any, Any, Any]) -> None:
        self._thread.call(work, _LONGEST_CALL_S)


def _listen(host: str, port: int) -> Listener:
    """Returns a listening socket. Raises BridgeError if the address cannot be used."""
    try:
        opening = Opening(look_at_http, HEAD_TIMEOUT_S)
        listening = open_listener(host, port, "page", opening=opening)
        bound_unsent(listening)
        return listening
    except (OSError, OverflowError) as error:
        raise BridgeError(
            f"the page's server cannot listen on {host}:{port}: "
            f"{getattr(error, 'strerror', None) or error}; "
            "stop the program that uses the port, or choose another port"
        ) from None
