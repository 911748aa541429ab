"""Serves the page during the runs of a command."""

from __future__ import annotations

import errno
import socket
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING

from volery.cli.error_reporting import warn
from volery.cli.flight import RunOptions
from volery.cli.terminal import echo_line
from volery.core.errors import CommandError

if TYPE_CHECKING:
    from volery.scenario.catalog import ScenarioCatalog
    from volery.scenario.schema import Scenario
    from volery.server.page_server import PageServer
    from volery.server.server_state import World
    from volery.server.settings import PageSettings

DEFAULT_ADDRESS = ""
"""Value of `--page` without an address."""


class Page:
    """Represents the page of a command's runs; without a server its methods do nothing."""

    def __init__(self, server: PageServer | None = None) -> None:
        self._server = server

    def building(self, scenario: Scenario, message: str = "") -> None:
        """Reports that a scenario is being built."""
        if self._server is not None:
            self._server.building(scenario.name, scenario.description, message)

    def showing(
        self, world: World, message: str = "", log: str = ""
    ) -> AbstractContextManager[None]:
        """Gives clients access to a world while the context lasts; see `PageServer.showing`."""
        if self._server is None:
            return nullcontext()
        world.gateway.use_low_latency()
        return self._server.showing(world, message, log)


@contextmanager
def page_of(options: RunOptions) -> Iterator[Page]:
    """Serves the page if `--page` is given."""
    if options.page is None:
        yield Page()
        return
    with serving(_settings_of(options)) as page:
        yield page


@contextmanager
def serving(settings: PageSettings, catalog: ScenarioCatalog | None = None) -> Iterator[Page]:
    """Serves the page, with cards of the catalog's scenarios, and prints its address."""
    from volery.server.page import is_built
    from volery.server.page_server import PageServer

    with PageServer(settings, catalog) as server:
        needed = "  (needs the token)" if settings.tokens.needed else ""
        echo_line(f"page    {server.url}{needed}", err=True)
        if not is_built():
            warn("the page is not built: run `make web`; the other addresses work")
        yield Page(server)


def _settings_of(options: RunOptions) -> PageSettings:
    from volery.server.auth import Tokens
    from volery.server.settings import PageSettings

    settings = PageSettings(
        tokens=Tokens(options.token),
        anywhere=options.allow_remote,
        origins=options.origins,
        recordings=options.recordings,
    )
    if options.page == DEFAULT_ADDRESS:
        return replace(settings, port=usual_port(settings.host))
    host, colon, port = (options.page or "").rpartition(":")
    if not port.isdecimal() or not 0 <= int(port) <= 65535 or (colon and not host):
        raise CommandError(f"--page={options.page}: an address is PORT or HOST:PORT")
    return replace(settings, host=host.strip("[]") or settings.host, port=int(port))


def usual_port(host: str) -> int:
    """Returns the page's default port; 0, for a free one, where it is taken, and says so."""
    from volery.server.settings import DEFAULT_PORT

    if not _is_taken(host, DEFAULT_PORT):
        return DEFAULT_PORT
    echo_line(f"port {DEFAULT_PORT} is taken; the page takes a free one", err=True)
    return 0


def _is_taken(host: str, port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            return error.errno == errno.EADDRINUSE
    return False
