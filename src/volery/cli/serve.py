"""`volery serve`: the page, and one world after the other behind it, until Ctrl-C."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from volery.cli.bridge_checks import check_bridges, token_gaps
from volery.cli.bridges import fit_out, open_bridges
from volery.cli.error_reporting import complain_of, warn
from volery.cli.flight import RunOptions
from volery.cli.interrupt import Interrupts
from volery.cli.pages import Page, serving
from volery.cli.trust import with_trust
from volery.core.allocator import return_large_blocks
from volery.core.collector import spared_objects
from volery.core.errors import VoleryError
from volery.scenario import changes
from volery.scenario.changes import LogRequest

if TYPE_CHECKING:
    from volery.scenario.catalog import ScenarioCatalog
    from volery.scenario.changes import WorldRequest
    from volery.scenario.schema import Scenario
    from volery.server.settings import PageSettings

_log = logging.getLogger(__name__)

_THREADS = 2
_GLANCE_S = 0.02
"""Wall seconds between looks at clients of a paused world, and at Ctrl-C without a world."""
_FAREWELL_S = 0.1
"""Time for the last answer to reach its client."""


@dataclass(frozen=True)
class ServeOptions:
    """What the command line asked for."""

    first: RunOptions
    """The scenario to begin with, and what holds for all of them."""
    page: PageSettings


class _StoppedError(Exception):
    """Ctrl-C was pressed; raised between two steps."""


def serve(options: ServeOptions) -> None:
    """Serve until Ctrl-C, or until a client lets the simulator quit.

    Raises `VoleryError` where the first scenario cannot be built or the server cannot listen.
    """
    from volery.scenario.catalog import ScenarioCatalog

    check_bridges(options.first)
    for gap in token_gaps(options.first):
        warn(gap)
    first = _first_scenario(with_trust(options.first))
    shelf = ScenarioCatalog(options.page.uploads, options.page.recordings, given=first)
    return_large_blocks()
    with Interrupts() as interrupts, serving(options.page, shelf) as page:
        host = _Host(options, page, interrupts, _Wish(first, options.first.speed, shelf))
        while host.goes_on:
            host.go_on()
    typer.echo("the server has ended", err=True)


class _Wish:
    """What is to be flown next: the first scenario, then what clients ask for."""

    def __init__(self, scenario: Scenario, speed: float | None, shelf: ScenarioCatalog) -> None:
        self.shelf = shelf
        """What may be flown."""
        self.speed = speed
        """Factor of real time to begin with; None: as fast as possible."""
        self.asked = True
        self._wanted: Scenario | Path | None = scenario
        self.quit: Callable[[], None] = _nothing

    def ask(self, request: WorldRequest | LogRequest | None) -> None:
        """End the present flight for another one; `VoleryError` where that cannot be."""
        if request is None:
            self.want(None)
        elif isinstance(request, LogRequest):
            self.want(request.path)
        else:
            self.want(changes.apply(self.shelf.load(request.name), request.changes))
            speed = request.changes.speed
            self.speed = self.speed if speed is None else speed or None
        self.quit()

    def want(self, what: Scenario | Path | None) -> None:
        """Have this flown next, or this log played; None: no world at all."""
        self.asked, self._wanted = True, what

    def take(self) -> Scenario | Path | None:
        """What to do now; what is asked for from here on comes after it."""
        self.asked, self.quit = False, _nothing
        return self._wanted


class _Host:
    """Builds worlds and flies them, one at a time."""

    def __init__(
        self, options: ServeOptions, page: Page, interrupts: Interrupts, wish: _Wish
    ) -> None:
        self._options = options
        self._page = page
        self._interrupts = interrupts
        self._wish = wish
        self._present: Scenario | None = None
        """What was built last."""
        self._problem = ""
        """What went wrong last, for the page."""
        self._quits = False

    @property
    def goes_on(self) -> bool:
        """Whether there is more to do."""
        return not (self._quits or self._interrupts.pressed)

    def go_on(self) -> None:
        """Do what is wished for until something else is; after a failure go back."""
        wanted = self._wish.take()
        if wanted is None:
            self._wait()
            return
        try:
            if isinstance(wanted, Path):
                self._play(wanted)
            else:
                self._fly(wanted)
        except Exception as error:  # a mistake of ours in one world must not end the others
            if self._present is None:
                raise
            what = str(error) if isinstance(error, VoleryError) else _unexpected(error)
            self._problem = f"{wanted.name}: {what}"
            complain_of(error, self._problem)
            self._wish.want(None if self._present is wanted else self._present)

    def _fly(self, scenario: Scenario) -> None:
        """Build a world and stay with it."""
        from volery import Simulation

        first, page = self._options.first, self._page
        page.building(scenario, self._problem)
        threads = _THREADS if first.threads is None else first.threads
        with Simulation(
            fit_out(scenario, first),
            threads=threads,
            recordings=first.recordings,
            on_load=self._wish.ask,
            shelf=self._wish.shelf,
        ) as simulation:
            self._present, self._wish.quit = scenario, simulation.quit
            self._interrupts.be_gentle()
            shown = page.showing(simulation, self._problem)
            with spared_objects(), open_bridges(simulation, first), shown:
                self._problem = ""
                typer.echo(f"flying  {scenario.name}", err=True)
                self._stay(simulation)
            self._quits = simulation.quitting and not self._wish.asked

    def _play(self, log: Path) -> None:
        """Open a log and stay with it."""
        from volery.runtime.replay.log_player import LogPlayer

        with LogPlayer(
            log, on_load=self._wish.ask, on_close=self._return, shelf=self._wish.shelf
        ) as player:
            if player.scenario is not None:
                self._page.building(player.scenario, self._problem)
            _ = player.geometry  # made here: the server only reads it
            self._wish.quit = player.quit
            self._interrupts.be_gentle()
            first, page = self._options.first, self._page
            shown = page.showing(player, self._problem)
            with spared_objects(), open_bridges(player, first), shown:
                self._problem = ""
                typer.echo(f"playing {log.name}", err=True)
                while not (self._wish.asked or player.quitting or self._interrupts.pressed):
                    player.wait(_GLANCE_S)
                player.wait(_FAREWELL_S)
            self._quits = player.quitting and not self._wish.asked

    def _return(self) -> None:
        """Fly again what was flown before a log."""
        self._wish.want(self._present)
        self._wish.quit()

    def _stay(self, simulation: Any) -> None:
        """Fly; at the end hold still there, until a reset or something else is asked for."""
        speed = self._wish.speed
        try:
            while not simulation.quitting:
                simulation.run(speed=speed, on_progress=self._look)
                speed = simulation.speed
                simulation.wait_at_end(self._look)
        except _StoppedError:
            return
        time.sleep(_FAREWELL_S)

    def _look(self, _progress: Any = None) -> None:
        if self._interrupts.pressed:
            raise _StoppedError

    def _wait(self) -> None:
        """Keep the bridges open with no world behind them."""
        from volery.runtime.idle_server import IdleServer

        idle = IdleServer(self._wish.ask, self._wish.shelf)
        with open_bridges(idle, self._options.first), self._page.showing(idle, self._problem):
            typer.echo("no world is loaded", err=True)
            self._problem = ""
            while not (self._wish.asked or idle.quitting or self._interrupts.pressed):
                idle.wait(_GLANCE_S)
            idle.wait(_FAREWELL_S)
        self._quits = idle.quitting


def _first_scenario(options: RunOptions) -> Scenario:
    from volery import load_scenario
    from volery.scenario import overrides

    return overrides.apply(
        load_scenario(options.scenario, trust=options.trust),
        uavs=options.uavs,
        seconds=options.seconds,
        seed=options.seed,
    )


def _unexpected(error: Exception) -> str:
    """A sentence for what should not happen; where it did is logged."""
    _log.error("a world ended with an error", exc_info=error)
    return f"internal error: {type(error).__name__}: {error}"


def _nothing() -> None:
    """Nothing can be ended before it has begun."""
